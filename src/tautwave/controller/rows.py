"""Columns of the recording that a pair and its axes own, and how they are filled once a cycle.

Every element of the coupling has three: energy absorbed so far, energy stored now, energy
dissipated so far (negative: generated), all in pair units [J]. Each is kept by the element from
its own inputs. `port_energy` of an axis is what its motor took out of the device (effort sent
times displacement measured): the sum over axes has to be the sum over elements.
"""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.contracts import Row
from tautwave.controller.axis import stored_in_wall, waiting_energy
from tautwave.controller.pair import effort_error, position_error
from tautwave.controller.rates import stored_in_converter
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState


def axis_columns(name: str, p: AxisParams) -> list[str]:
    """Return the column names of one axis, e.g. `master.wrist`; filled by `fill_axis`."""
    names = ["position", "velocity", "commanded", "port_effort", "valid"]
    names += ["port_energy", "gross_flow", "uncertainty"]
    if p.by_wave:
        names += ["wave_in", "wave_out"]
    if not p.impedance:
        names += ["measured_effort"]
    if p.site.has_wall:
        names += ["wall_effort"]
    return [f"{name}.{column}" for column in names]


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the names of a pair's elements in the order of their columns."""
    sides = (("master", p1), ("slave", p2))
    names: list[str] = []
    if q.by_wave:
        for side, p in sides:
            names.append(f"port_{side}")
            if has_damper(p):
                names.append(f"damper_{side}")
        names += [f"converter_{side}" for side, p in sides if p.divisor > 1]
        if q.filtered:
            names += ["filter_master", "filter_slave"]
        if q.samples > 0:
            names.append("line")
    else:
        names.append("coupler")
    names += [f"wall_{side}" for side, p in sides if p.site.has_wall]
    return names


def pair_columns(name: str, q: PairParams, p1: AxisParams, p2: AxisParams) -> list[str]:
    """Return the column names of one pair, in the order of `fill_pair`."""
    return [
        *axis_columns(f"master.{name}", p1),
        *axis_columns(f"slave.{name}", p2),
        f"{name}.position_error",
        f"{name}.effort_error",
        *(
            f"{name}.{element}.{part}"
            for element in element_names(q, p1, p2)
            for part in ("absorbed", "stored", "dissipated")
        ),
    ]


def has_damper(p: AxisParams) -> bool:
    """Return whether a damper stands in series with the port, so that no wave is reflected."""
    return p.site.port.slip > 0.0 and p.impedance


def fill_axis(out: Row, at: int, s: AxisState, p: AxisParams, weight: float) -> int:
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
    at = at + 8
    if p.by_wave:
        out[at] = s.arrived
        out[at + 1] = s.leaving
        at = at + 2
    if not p.impedance:
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


def fill_port(
    out: Row,
    at: int,
    s: AxisState,
    p: AxisParams,
    table: MutableSequence[float],
) -> int:
    """Write the accounts of a wave port and of its series damper."""
    weight = p.weight
    waiting = waiting_energy(s, p, table)
    at = fill_element(
        out,
        at,
        weight * (s.port_absorbed + waiting),
        weight * (s.account + waiting),
        -weight * s.forgiven,
    )
    if has_damper(p):
        lost = weight * s.damper_dissipated
        at = fill_element(out, at, lost, 0.0, lost)
    return at


def fill_converter(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the account of a rate converter, if there is one."""
    if p.divisor == 1:
        return at
    return fill_element(out, at, s.rate_absorbed, stored_in_converter(s, p), s.rate_dissipated)


def fill_wall(out: Row, at: int, s: AxisState, p: AxisParams) -> int:
    """Write the account of a local wall, if there is one."""
    if not p.site.has_wall:
        return at
    weight = p.weight
    stored = weight * (stored_in_wall(s, p) - s.wall_stored_at_start)
    return fill_element(out, at, weight * s.wall_absorbed, stored, weight * s.wall_dissipated)


def fill_pair(
    out: Row,
    at: int,
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> int:
    """Write all columns of a pair at index `at`; return the next index."""
    at = fill_axis(out, at, one, p1, p1.weight)
    at = fill_axis(out, at, two, p2, p2.weight)
    out[at] = position_error(c, q, one, two)
    out[at + 1] = effort_error(q, one, two)
    at = at + 2
    if q.by_wave:
        at = fill_port(out, at, one, p1, table)
        at = fill_port(out, at, two, p2, table)
        at = fill_converter(out, at, one, p1)
        at = fill_converter(out, at, two, p2)
        if q.filtered:
            at = fill_element(
                out,
                at,
                c.filter_master_absorbed,
                c.filter_master_stored,
                c.filter_master_dissipated,
            )
            at = fill_element(
                out, at, c.filter_slave_absorbed, c.filter_slave_stored, c.filter_slave_dissipated
            )
        if q.samples > 0:
            at = fill_element(out, at, c.line_energy, c.line_energy, 0.0)
    else:
        at = fill_element(out, at, c.absorbed, c.stored - c.start_stored, c.dissipated)
    at = fill_wall(out, at, one, p1)
    return fill_wall(out, at, two, p2)
