"""Columns that simulated devices add to a row of the controller, and those for a sweep."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from tautwave.controller.pair import effort_error, position_error
from tautwave.controller.records import PairView
from tautwave.simulation.kernel.device import device_forces, device_stored
from tautwave.simulation.kernel.records import DeviceParams, DeviceState


def fill_device(out: MutableSequence[float], at: int, b: DeviceState, d: DeviceParams) -> int:
    """Write the truth of one axis at index `at`; return the next index."""
    hand, environment = device_forces(b, d, b.reference, b.rate)
    kinetic, grip, surroundings = device_stored(b, d, b.reference)
    out[at] = b.x
    out[at + 1] = b.v
    at = at + 2
    if d.last >= 0:
        out[at] = b.reference
        out[at + 1] = hand
        at = at + 2
    out[at] = environment
    out[at + 1] = b.hand_work
    out[at + 2] = b.motor_work - b.pushed
    out[at + 3] = kinetic
    out[at + 4] = grip
    out[at + 5] = surroundings
    out[at + 6] = b.grip_loss
    out[at + 7] = b.viscous_loss
    out[at + 8] = b.coulomb_loss
    out[at + 9] = b.environment_loss - b.pushed
    return at + 10


def fill_measured(
    out: MutableSequence[float],
    at: int,
    pair: PairView,
    bodies: Sequence[DeviceState],
    devices: Sequence[DeviceParams],
) -> int:
    """Write the few columns of a pair that `measured_columns` names; return the next index.

    The energy is that of masses, grip and environment of both sides, in master units.
    """
    q = pair.q
    b1 = bodies[q.master]
    b2 = bodies[q.slave]
    kinetic, grip, surroundings = device_stored(b1, devices[q.master], b1.reference)
    far_kinetic, far_grip, far_surroundings = device_stored(b2, devices[q.slave], b2.reference)
    out[at] = position_error(pair)
    out[at + 1] = effort_error(pair)
    out[at + 2] = b1.x
    out[at + 3] = b2.x
    energy = kinetic + grip + surroundings
    energy = energy + q.weight * far_kinetic
    energy = energy + q.weight * far_grip
    out[at + 4] = energy + q.weight * far_surroundings
    return at + 5


def measured_columns(pair: str) -> tuple[str, ...]:
    """Return the names of what `fill_measured` writes; `PAIR.energy` is no recording's column."""
    return (
        f"{pair}.position_error",
        f"{pair}.effort_error",
        f"true.master.{pair}.position",
        f"true.slave.{pair}.position",
        f"{pair}.energy",
    )
