"""The steps of a position coupling: constants, state, and what of it is recorded.

Both sides see the far one's position and velocity, a delay old; the books are those of the spring
between the present positions, whose losses are negative where delay and sampling create energy.
"""

from __future__ import annotations

from collections.abc import MutableSequence
from dataclasses import dataclass
from typing import NamedTuple

from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import Law, Steps
from tautwave.laws.coupler import coupler_effort, coupler_loss, coupler_stored


class PositionEndParams(NamedTuple):
    """Spring [N m/rad or N/m] and damper [N m s/rad or N s/m] as one side feels them."""

    stiffness: float
    damping: float


@dataclass(slots=True)
class PositionEnd:
    """What one side sees of the other, in its own units, and the energy it took [J]."""

    far_position: float = 0.0
    far_velocity: float = 0.0
    absorbed: float = 0.0


@dataclass(slots=True)
class PositionLink:
    """The books of the spring [J], its stretch [rad or m], and where the line stands."""

    absorbed: float = 0.0
    stored: float = 0.0
    start_stored: float = 0.0
    dissipated: float = 0.0
    error: float = 0.0
    at: int = 0


def start(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    gap: float,
    table: MutableSequence[float],
) -> None:
    """Begin with the line full of where both stand, at rest."""
    for i in range(q.samples):
        table[q.line + i] = one.position
        table[q.line + q.samples + i] = two.position
        table[q.line + 2 * q.samples + i] = 0.0
        table[q.line + 3 * q.samples + i] = 0.0
    one.end.absorbed = 0.0
    two.end.absorbed = 0.0
    w = c.link
    w.at = 0
    w.error = 0.0
    book_spring(c, q, one, two, p1)
    w.start_stored = w.stored
    w.dissipated = 0.0


def engage(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
) -> None:
    """See each other for the first time."""
    see_far_sides(c, q, one, two, table)


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Book what the coupler took from the device."""
    s.end.absorbed += port * displacement


def book_spring(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, p1: AxisParams
) -> None:
    """Book the spring between the present positions, in pair units."""
    w = c.link
    stiffness = p1.end.stiffness
    absorbed = one.end.absorbed + q.weight * two.end.absorbed
    far = q.to_master * (two.position - c.offset)
    error = one.position - far
    w.stored = coupler_stored(stiffness, one.position, far)
    w.dissipated += coupler_loss(stiffness, absorbed - w.absorbed, w.error, error)
    w.absorbed = absorbed
    w.error = error


def exchange_states(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, table: MutableSequence[float]
) -> tuple[float, float, float, float]:
    """Pass one slot; return far position and velocity at the master, then at the slave."""
    if q.samples == 0:
        return two.position, two.velocity, one.position, one.velocity
    w = c.link
    at = q.line + w.at
    ahead = table[at]
    table[at] = one.position
    at = at + q.samples
    back = table[at]
    table[at] = two.position
    at = at + q.samples
    ahead_rate = table[at]
    table[at] = one.velocity
    at = at + q.samples
    back_rate = table[at]
    table[at] = two.velocity
    w.at += 1
    if w.at == q.samples:
        w.at = 0
    return back, back_rate, ahead, ahead_rate


def see_far_sides(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, table: MutableSequence[float]
) -> None:
    """Exchange positions and velocities, each given in the units of the side that sees it."""
    back, back_velocity, ahead, ahead_velocity = exchange_states(c, q, one, two, table)
    here = one.end
    there = two.end
    here.far_position = q.to_master * (back - c.offset)
    here.far_velocity = q.to_master * back_velocity
    there.far_position = q.ratio * ahead + c.offset
    there.far_velocity = q.ratio * ahead_velocity


def exchange(
    c: PairState,
    q: PairParams,
    one: AxisState,
    two: AxisState,
    p1: AxisParams,
    p2: AxisParams,
    table: MutableSequence[float],
    here: bool,
    due_one: bool,
    due_two: bool,
) -> None:
    """Pass one slot; in one that the loop saw, book the spring and see the far sides."""
    if here:
        book_spring(c, q, one, two, p1)
        see_far_sides(c, q, one, two, table)
    else:
        exchange_states(c, q, one, two, table)


def think(s: AxisState, p: AxisParams, coast: float) -> float:
    """Return the resisting effort of spring and damper [N m or N]."""
    e = s.end
    k = p.end
    return coupler_effort(
        k.stiffness, k.damping, s.position, s.velocity, e.far_position, e.far_velocity
    )


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> tuple[str, ...]:
    """Return the name of the only element."""
    return ("coupler",)


def fill_elements(
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
    """Write the books of the coupler."""
    w = c.link
    return fill_element(out, at, w.absorbed, w.stored - w.start_stored, w.dissipated)


law = Law(
    name="position",
    steps=Steps(
        start=start,
        engage=engage,
        close=close,
        exchange=exchange,
        think=think,
        fill_elements=fill_elements,
    ),
    end=PositionEnd,
    link=PositionLink,
    elements=element_names,
)
