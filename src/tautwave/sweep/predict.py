"""From a rig to the linear analysis of one of its pairs: state matrix, least damped mode.

The assumptions are in `tautwave.analysis.ports.sampled_loop`; local walls, a unilateral environment
and Coulomb friction are left out, so this is motion in free space or at a spring, small and smooth.
"""

from __future__ import annotations

from tautwave import registry
from tautwave.analysis.ports.loop_modes import Mode, least_damped
from tautwave.analysis.ports.multirate import (
    RatedEnd,
    common_slots,
    least_damped_rated,
)
from tautwave.analysis.ports.sampled_loop import (
    Device,
    LinearEnd,
    Site,
)
from tautwave.config import Rig, SolidWall
from tautwave.errors import ConfigError
from tautwave.rig import axis_model, command_delays, coupling_part, line_delay, velocity_gain


def pair_ends(rig: Rig, name: str, *, contact: bool = False) -> tuple[LinearEnd, LinearEnd]:
    """Return master's and slave's end of a pair, in SI of their axes.

    Parameters
    ----------
    rig : Rig
        With a `simulation` block: the truth is needed.
    name : str
        The pair.
    contact : bool
        Treat a wall at the slave as a spring and damper in permanent contact; else it is absent.

    Raises
    ------
    ConfigError
        Nothing is simulated, or an axis takes velocities.
    """
    if rig.simulation is None:
        raise ConfigError(f"{rig.name}: a prediction requires a simulation block")
    delays = command_delays(rig)
    keys = rig.coupling.pairs[name]
    linear = registry.load_named(linear_of(rig))
    ends: list[LinearEnd] = []
    for side in ("master", "slave"):
        axis = f"{side}.{name}"
        inertia = rig.axes[axis].inertia
        if inertia is None:
            raise ConfigError(
                f"{axis}: predictions are for impedance axes, this one takes velocity"
            )
        believed = delays[axis]
        device = true_device(rig, axis, contact=contact and side == "slave")
        site = Site(
            rig.axis_period_s(axis),
            0.5 * rig.axis_period_s(axis) / inertia.lower,
            velocity_gain(rig, rig.axes[axis]),
            believed.periods,
            believed.remainder_s / rig.axis_period_s(axis),
        )
        ends.append(linear(keys, side, device, site))
    return ends[0], ends[1]


def rated_ends(rig: Rig, name: str, *, contact: bool = False) -> tuple[RatedEnd, RatedEnd]:
    """Return both ends of a pair with their rates; see `pair_ends`."""
    ends = pair_ends(rig, name, contact=contact)
    divisors = [rig.axis_divisor(f"{side}.{name}") for side in ("master", "slave")]
    one, two = (RatedEnd(end, n) for end, n in zip(ends, divisors, strict=True))
    return one, two


def linear_of(rig: Rig) -> str:
    """Return the name of the linear end of a rig's law.

    Raises
    ------
    ConfigError
        Its part has none.
    """
    named: str = coupling_part(rig).linear
    if not named:
        raise ConfigError(
            f"{rig.name}: law {rig.coupling.law} has no linear model (its part provides none), "
            f"so nothing can be predicted"
        )
    return named


def pair_mode(rig: Rig, name: str, *, samples: int | None = None, contact: bool = False) -> Mode:
    """Return the least damped mode of one pair; see `pair_ends`.

    `samples` replaces the rig's own delay (one way, in samples).
    """
    one, two = rated_ends(rig, name, contact=contact)
    delay = line_delay(rig).samples if samples is None else samples
    if common_slots(one, two) > 1:
        return least_damped_rated(one, two, delay, rig.period_s)
    return least_damped(one.end, two.end, delay, rig.period_s)


def true_device(rig: Rig, axis: str, *, contact: bool = False) -> Device:
    """Return the simulated device of an axis, its hand or environment included."""
    truth = axis_model(rig, axis, 1)
    plant = truth.plant
    wall = (
        contact
        and rig.simulation is not None
        and isinstance(rig.simulation.environment.get(axis.split(".")[1]), SolidWall)
    )
    return Device(
        mass=plant.mass,
        damping=plant.viscous + plant.grip_damping + (plant.wall_damping if wall else 0.0),
        stiffness=plant.grip_stiffness
        + plant.spring_stiffness
        + (plant.wall_stiffness if wall else 0.0),
        # On a slow bus a command waits for the next exchange.
        command_delay=max(truth.command_delay, 1.0 if rig.axis_divisor(axis) > 1 else 0.0),
    )
