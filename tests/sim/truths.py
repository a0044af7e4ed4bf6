"""Truths of simulated axes."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.models.plant_params import PlantParams
from tautwave.models.servo import ServoParams
from tautwave.truth import AxisModel

PERIOD = 1e-3


def truth(
    *,
    mass: float = 0.5,
    viscous: float = 0.0,
    servo: bool = False,
    delay: float = 0.0,
    quantum: float = 0.0,
    noise: float = 0.0,
    effort_quantum: float = 0.0,
    velocity_quantum: float = 0.0,
    limit: float = 10.0,
    missing: float = 0.0,
    reference: Sequence[float] = (),
    grip: tuple[float, float] = (0.0, 0.0),
    seed: tuple[int, ...] = (1, 2),
) -> AxisModel:
    return AxisModel(
        period=PERIOD,
        plant=PlantParams(mass, viscous, 0.0, *grip, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
        foam=None,
        servo=ServoParams(0.002, 0.0, *grip, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0) if servo else None,
        reference=reference,
        start_position=0.0,
        encoder_quantum=quantum,
        position_noise=noise,
        effort_quantum=effort_quantum,
        velocity_quantum=velocity_quantum,
        effort_limit=limit,
        command_delay=delay,
        missing_probability=missing,
        seed=seed,
    )
