"""What `tautwave sim DRIVER` has behind its devices: axes without a rig and without hands."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tautwave.errors import ConfigError
from tautwave.models.plant_params import PlantParams
from tautwave.models.servo import ServoParams
from tautwave.truth import AxisModel


def free_axis(
    period: float,
    inertia: float,
    damping: float,
    *,
    seed: tuple[int, ...],
    coulomb: float = 0.0,
    servo: ServoParams | None = None,
    encoder_quantum: float = 0.0,
    effort_quantum: float = 0.0,
    effort_limit: float = math.inf,
) -> AxisModel:
    """Return the truth of an axis at rest, without hand, wall and faults; SI of its kind."""
    plant = PlantParams(
        mass=inertia,
        viscous=damping,
        coulomb=coulomb,
        grip_stiffness=0.0,
        grip_damping=0.0,
        spring_stiffness=0.0,
        spring_position=0.0,
        wall_stiffness=0.0,
        wall_damping=0.0,
        wall_position=0.0,
        wall_side=1.0,
    )
    return AxisModel(
        period=period,
        plant=plant,
        foam=None,
        servo=servo,
        reference=(),
        start_position=0.0,
        encoder_quantum=encoder_quantum,
        position_noise=0.0,
        effort_quantum=effort_quantum,
        velocity_quantum=0.0,
        effort_limit=effort_limit,
        command_delay=0.0,
        missing_probability=0.0,
        seed=seed,
    )


def require_distinct(option: str, ids: Sequence[int], devices: str) -> None:
    """Refuse ids of which one is given twice.

    Raises
    ------
    ConfigError
        It names the option.
    """
    if len(set(ids)) < len(ids):
        listed = ", ".join(str(one) for one in ids)
        raise ConfigError(
            f"{option} {listed}: two {devices} cannot share an id; list each one once"
        )
