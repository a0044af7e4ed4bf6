"""A rig's beliefs about its devices and hands, in the form the analysis needs."""

from __future__ import annotations

from typing import NamedTuple

from tautwave.config import Axis, Foam, Rig, SolidWall, Spring, simulation_of
from tautwave.rig import command_delays, true_delay_s
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay

SIDES = ("master", "slave")


class Contact(NamedTuple):
    """Stiffness [N m/rad or N/m] and damping [N m s/rad or N s/m] that an end may touch."""

    stiffness: float
    damping: float
    text: str


def declared_delays(rig: Rig) -> dict[str, CommandDelay]:
    """Return the command delay that each axis' driver declares."""
    return command_delays(rig)


def delay_in_periods(rig: Rig, delay: CommandDelay) -> float:
    """Return a command delay in periods, with its fraction."""
    return delay.periods + delay.remainder_s / rig.period_s


def stated_environment(rig: Rig, pair: str) -> Contact | None:
    """Return the environment of a simulated slave, in contact; None if it is free.

    Foam counts with its tangent stiffness at the slave's effort limit, without its loss.
    """
    environment = None if rig.simulation is None else rig.simulation.environment.get(pair)
    if isinstance(environment, Spring):
        return Contact(environment.stiffness, 0.0, "the simulation's spring")
    if isinstance(environment, SolidWall):
        return Contact(environment.stiffness, environment.damping, "the simulation's wall")
    if isinstance(environment, Foam):
        limit = rig.slave.axes[pair].effort_limit
        depth = (limit / environment.stiffness) ** (1.0 / environment.exponent)
        tangent = (
            environment.exponent * environment.stiffness * depth ** (environment.exponent - 1.0)
        )
        return Contact(tangent, 0.0, "the simulation's foam, pressed as hard as may be")
    return None


def stated_contact(rig: Rig, axis_name: str) -> Contact | None:
    """Return what is attached to an axis: the hand at the master, the environment at the slave."""
    side, pair = axis_name.split(".")
    if side == "slave":
        return stated_environment(rig, pair)
    hand = stated_hand(rig, pair)
    return Contact(hand.hand.stiffness, hand.hand.damping, hand.text)


def drive_lag(rig: Rig, axis_name: str) -> float | None:
    """Return the velocity lag [s] that a simulation states for an admittance axis, else None.

    A follower's goal has none.
    """
    if rig.simulation is None or rig.axes[axis_name].follower is not None:
        return None
    return simulation_of(rig, axis_name).velocity_time_constant_s


def assumed(
    axis: Axis, name: str, *, inertia: bool = False, damping: bool = False, coulomb: bool = False
) -> list[str]:
    """Return a condition for each assumed parameter of an axis."""
    conditions = []
    if inertia and axis.inertia is not None and _is_assumed(axis.inertia.source):
        conditions.append(
            f"the inertia of {name} is at least {axis.inertia.lower:g}, {axis.inertia.source}"
        )
    if damping and axis.damping.lower > 0.0 and _is_assumed(axis.damping.source):
        conditions.append(
            f"the damping of {name} is at least {axis.damping.lower:g}, {axis.damping.source}"
        )
    if coulomb and axis.coulomb.lower > 0.0 and _is_assumed(axis.coulomb.source):
        conditions.append(
            f"the Coulomb friction of {name} is at least {axis.coulomb.lower:g}, "
            f"{axis.coulomb.source}"
        )
    return conditions


def _is_assumed(source: str) -> bool:
    return "assum" in source.lower()


def broken_inertia(rig: Rig, axis_name: str) -> str | None:
    """Return a clause if a simulation contradicts `inertia.lower`, else None."""
    axis = rig.axes[axis_name]
    if rig.simulation is None or axis.inertia is None:
        return None
    truth = simulation_of(rig, axis_name).inertia
    if truth >= axis.inertia.lower:
        return None
    return (
        f"the device's simulated inertia {truth:g} is below inertia.lower "
        f"{axis.inertia.lower:g}; lower that to {truth:g}"
    )


def broken_damping(rig: Rig, axis_name: str) -> str | None:
    """Return a clause if a simulation contradicts `damping.lower`, else None."""
    axis = rig.axes[axis_name]
    if rig.simulation is None or axis.causality == "admittance":
        return None
    truth = simulation_of(rig, axis_name).damping
    if truth >= axis.damping.lower:
        return None
    return (
        f"the device's simulated damping {truth:g} is below damping.lower "
        f"{axis.damping.lower:g}; lower that to {truth:g}"
    )


def broken_coulomb(rig: Rig, axis_name: str) -> str | None:
    """Return a clause if a simulation contradicts `coulomb.lower`, else None."""
    believed = rig.axes[axis_name].coulomb.lower
    truth = believed if rig.simulation is None else simulation_of(rig, axis_name).coulomb
    if truth >= believed:
        return None
    return (
        f"the device's simulated Coulomb friction {truth:g} is below coulomb.lower "
        f"{believed:g}; lower that to {truth:g}"
    )


def broken_delay(rig: Rig, axis_name: str, delay: CommandDelay) -> str | None:
    """Return a clause if a simulation contradicts the declared command delay."""
    if rig.simulation is None:
        return None
    truth = true_delay_s(rig, axis_name, delay)
    declared = delay.periods * rig.period_s + delay.remainder_s
    if abs(truth - declared) <= 1e-6 * rig.period_s:
        return None
    return (
        f"the device's simulated commands act after {truth:g} s, and its driver declares "
        f"{declared:g} s"
    )
