"""Columns of the recording that a pair and its axes own, and how they are filled once a cycle.

Every element of the coupling has three: energy absorbed so far, energy stored now, energy
dissipated so far (negative: generated), all in pair units [J]. Each is kept by the element from
its own inputs. `port_energy` of an axis is what its motor took out of the device (effort sent
times displacement measured): the sum over axes has to be the sum over elements.
"""

from __future__ import annotations

from tautwave.columns import ACCOUNT, Column, names
from tautwave.contracts import Row
from tautwave.controller.axis import stored_in_wall
from tautwave.controller.pair import effort_error, position_error
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairView
from tautwave.controller.steps import Law, Steps

AXIS = (
    Column("position", "rad, m", "as measured"),
    Column("velocity", "rad/s, m/s", "as used by the controller, after its filter"),
    Column(
        "commanded",
        "N m, N; rad/s, m/s",
        "what was written to the device: effort, or velocity on an admittance axis",
    ),
    Column(
        "port_effort",
        "N m, N",
        "effort of the coupling at this port, opposite to the motor's",
    ),
    Column("valid", "0, 1", "whether this cycle has a sample of the axis"),
    Column(
        "port_energy",
        "J",
        "energy absorbed by the motor from the device so far: applied effort times displacement",
    ),
    Column("gross_flow", "J", "the same, with all increments counted as positive"),
    Column(
        "uncertainty",
        "J",
        "uncertainty of `port_energy` where an effort did not act for whole periods, or was "
        "only sampled",
    ),
    Column(
        "limited",
        "",
        "what limits the command, a sum: 1 the coupling's share of the axis, 2 effort_limit "
        "(of a velocity: velocity_limit), 4 effort_rate_limit, 8 the drive's steps, 16 the "
        "ceiling of a ramp, 32 a stop, 64 the bound for stalls (stall_energy_j); 0: what "
        "coupling and wall ask for is sent",
    ),
)
"""What every axis writes, in the order of `fill_axis`."""

MEASURED = Column(
    "measured_effort",
    "N m, N",
    "admittance axes, and those with an effort_sensor: external effort, measured",
)

WALL = Column("wall_effort", "N m, N", "effort of the local wall")

PAIR = (
    Column("position_error", "rad, m", "master less slave, in the master's units"),
    Column(
        "effort_error",
        "N m, N",
        "sum of both ports' efforts in the master's units; 0 in equilibrium",
    ),
)
"""What every pair writes after its axes."""

ACCOUNTS = {
    "wall_SIDE": "local virtual wall",
    "compensation_SIDE": "friction compensation; negative: supplied",
    "inertia_SIDE": "inertia compensation, by account; negative: supplied",
}
"""Elements of any pair beside those of its coupling."""


def axis_columns(name: str, p: AxisParams, law: Law) -> list[str]:
    """Return the column names of one axis, e.g. `master.wrist`; filled by `fill_axis`."""
    columns = [*names(AXIS), *names(law.signals)]
    if not p.impedance or p.senses:
        columns.append(MEASURED.name)
    if p.site.has_wall:
        columns.append(WALL.name)
    return [f"{name}.{column}" for column in columns]


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams, law: Law) -> list[str]:
    """Return the names of a pair's elements in the order of their columns."""
    sides = (("master", p1), ("slave", p2))
    walls = [f"wall_{side}" for side, p in sides if p.site.has_wall]
    helps = [f"compensation_{side}" for side, p in sides if p.site.compensates]
    lifts = [f"inertia_{side}" for side, p in sides if p.site.compensates_inertia]
    return [*law.elements(q, p1, p2), *walls, *helps, *lifts]


def pair_columns(name: str, q: PairParams, p1: AxisParams, p2: AxisParams, law: Law) -> list[str]:
    """Return the column names of one pair, in the order of `fill_pair`."""
    return [
        *axis_columns(f"master.{name}", p1, law),
        *axis_columns(f"slave.{name}", p2, law),
        *(f"{name}.{column}" for column in names(PAIR)),
        *(
            f"{name}.{element}.{part}"
            for element in element_names(q, p1, p2, law)
            for part in ACCOUNT
        ),
    ]


def fill_axis(out: Row, at: int, s: AxisState, p: AxisParams, weight: float, steps: Steps) -> int:
    """Write the columns of one axis at index `at`; return the next index."""
    out[at] = s.position
    out[at + 1] = s.velocity
    out[at + 2] = s.command
    out[at + 3] = s.port_effort
    out[at + 4] = 0.0
    if s.valid:
        out[at + 4] = 1.0
    out[at + 5] = weight * s.port_energy
    out[at + 6] = weight * s.gross_flow
    out[at + 7] = weight * s.uncertainty
    out[at + 8] = s.limited
    at = at + 9
    at = steps.fill_signals(out, at, s, p)
    if not p.impedance or p.senses:
        out[at] = s.outside
        at = at + 1
    if p.site.has_wall:
        out[at] = s.wall_effort
        at = at + 1
    return at


def fill_element(out: Row, at: int, absorbed: float, stored: float, dissipated: float) -> int:
    """Write the account of one element at index `at`; return the next index."""
    out[at] = absorbed
    out[at + 1] = stored
    out[at + 2] = dissipated
    return at + 3


def fill_wall(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the account of a local wall, if there is one."""
    if not p.site.has_wall:
        return at
    weight = p.weight
    stored = weight * (stored_in_wall(s, p) - s.wall_stored_at_start)
    return fill_element(out, at, weight * s.wall_absorbed, stored, weight * s.wall_dissipated)


def fill_compensation(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the account of a friction compensation, if there is one: what it gives is negative."""
    if not p.site.compensates:
        return at
    taken = p.weight * s.help_absorbed
    return fill_element(out, at, taken, 0.0, taken)


def fill_inertia(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the account of the inertia compensation, if there is one."""
    if not p.site.compensates_inertia:
        return at
    e = s.inertia
    stored = e.funds - p.site.inertia.account.reserve
    lost = e.spilled + e.charged - e.paid
    return fill_element(out, at, p.weight * e.work, p.weight * stored, p.weight * lost)


def fill_pair(out: Row, at: int, pair: PairView, steps: Steps) -> int:
    """Write all columns of a pair at index `at`; return the next index."""
    one, two, p1, p2 = pair.one, pair.two, pair.p1, pair.p2
    at = fill_axis(out, at, one, p1, p1.weight, steps)
    at = fill_axis(out, at, two, p2, p2.weight, steps)
    out[at] = position_error(pair)
    out[at + 1] = effort_error(pair)
    at = steps.fill_elements(out, at + 2, pair)
    at = fill_wall(out, at, one, p1)
    at = fill_wall(out, at, two, p2)
    at = fill_compensation(out, at, one, p1)
    at = fill_compensation(out, at, two, p2)
    at = fill_inertia(out, at, one, p1)
    return fill_inertia(out, at, two, p2)
