"""One row of the recording: the order of `runtime.books` and of the simulated axes."""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.laws.wall import wall_stored
from tautwave.offline.device import body_forces, body_stored
from tautwave.offline.rates import stored_rate
from tautwave.offline.records import Body, Couple, DeviceParams, PairParams, Side, SideParams
from tautwave.offline.side import waiting_energy


def fill_side(out: MutableSequence[float], at: int, s: Side, p: SideParams) -> int:
    """Write the columns of one axis at index `at`; return the next index."""
    out[at] = s.position
    out[at + 1] = s.velocity
    out[at + 2] = s.command
    out[at + 3] = s.port
    out[at + 4] = 0.0
    if s.valid:
        out[at + 4] = 1.0
    out[at + 5] = p.weight * s.port_energy
    out[at + 6] = p.weight * s.gross_flow
    out[at + 7] = p.weight * s.uncertainty
    at = at + 8
    if p.by_wave:
        out[at] = s.arrived
        out[at + 1] = s.leaving
        at = at + 2
    if not p.impedance:
        out[at] = s.outside
        at = at + 1
    if p.site.has_wall:
        out[at] = s.wall
        at = at + 1
    return at


def fill_port(out: MutableSequence[float], at: int, s: Side, p: SideParams, waiting: float) -> int:
    """Write the accounts of a wave port and of its series damper."""
    out[at] = p.weight * (s.port_absorbed + waiting)
    out[at + 1] = p.weight * (s.account + waiting)
    out[at + 2] = -p.weight * s.forgiven
    at = at + 3
    if p.site.port.slip > 0.0 and p.impedance:
        out[at] = p.weight * s.burnt
        out[at + 1] = 0.0
        out[at + 2] = p.weight * s.burnt
        at = at + 3
    return at


def fill_rate(out: MutableSequence[float], at: int, s: Side, p: SideParams) -> int:
    """Write the account of a rate converter, if there is one."""
    if p.divisor == 1:
        return at
    out[at] = s.rate_absorbed
    out[at + 1] = stored_rate(s, p)
    out[at + 2] = s.rate_dissipated
    return at + 3


def fill_wall(out: MutableSequence[float], at: int, s: Side, p: SideParams) -> int:
    """Write the account of a local wall, if there is one."""
    if not p.site.has_wall:
        return at
    stored = wall_stored(p.site.wall, s.depth)
    out[at] = p.weight * s.wall_absorbed
    out[at + 1] = p.weight * (stored - s.start_stored)
    out[at + 2] = p.weight * s.wall_dissipated
    return at + 3


def fill_pair(
    out: MutableSequence[float],
    at: int,
    c: Couple,
    q: PairParams,
    one: Side,
    two: Side,
    p1: SideParams,
    p2: SideParams,
    table: MutableSequence[float],
) -> int:
    """Write all columns of a pair at index `at`; return the next index."""
    at = fill_side(out, at, one, p1)
    at = fill_side(out, at, two, p2)
    out[at] = one.position - q.to_master * (two.position - c.offset)
    out[at + 1] = one.port + q.sign * two.port / q.force_scale
    at = at + 2
    if q.by_wave:
        at = fill_port(out, at, one, p1, waiting_energy(one, p1, table))
        at = fill_port(out, at, two, p2, waiting_energy(two, p2, table))
        at = fill_rate(out, at, one, p1)
        at = fill_rate(out, at, two, p2)
        if q.filtered:
            out[at] = c.filter_master_absorbed
            out[at + 1] = c.filter_master_stored
            out[at + 2] = c.filter_master_dissipated
            out[at + 3] = c.filter_slave_absorbed
            out[at + 4] = c.filter_slave_stored
            out[at + 5] = c.filter_slave_dissipated
            at = at + 6
        if q.samples > 0:
            out[at] = c.line_energy
            out[at + 1] = c.line_energy
            out[at + 2] = 0.0
            at = at + 3
    else:
        held = c.stored - c.start_stored
        out[at] = c.absorbed
        out[at + 1] = held
        out[at + 2] = c.dissipated
        at = at + 3
    at = fill_wall(out, at, one, p1)
    return fill_wall(out, at, two, p2)


def fill_body(out: MutableSequence[float], at: int, b: Body, d: DeviceParams) -> int:
    """Write the truth of one axis at index `at`; return the next index."""
    hand, environment = body_forces(b, d, b.reference, b.rate)
    kinetic, grip, surroundings = body_stored(b, d, b.reference)
    out[at] = b.x
    out[at + 1] = b.v
    at = at + 2
    if d.last >= 0:
        out[at] = b.reference
        out[at + 1] = hand
        at = at + 2
    out[at] = environment
    out[at + 1] = b.hand_work
    out[at + 2] = b.motor_work
    out[at + 3] = kinetic
    out[at + 4] = grip
    out[at + 5] = surroundings
    out[at + 6] = b.grip_loss
    out[at + 7] = b.viscous_loss
    out[at + 8] = b.coulomb_loss
    out[at + 9] = b.environment_loss
    return at + 10


def fill_measured(
    out: MutableSequence[float],
    at: int,
    c: Couple,
    q: PairParams,
    one: Side,
    two: Side,
    b1: Body,
    b2: Body,
    d1: DeviceParams,
    d2: DeviceParams,
) -> int:
    """Write the few columns of a pair that `measured_columns` names; return the next index.

    The energy is that of masses, grip and environment of both sides, in master units.
    """
    kinetic, grip, surroundings = body_stored(b1, d1, b1.reference)
    far_kinetic, far_grip, far_surroundings = body_stored(b2, d2, b2.reference)
    out[at] = one.position - q.to_master * (two.position - c.offset)
    out[at + 1] = one.port + q.sign * two.port / q.force_scale
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
