"""Laws of what each side sees of the other: its position, velocity and effort, a delay old.

Such a law says which effort it asks for. Passing what is seen, turning it into the units of the
side that sees it, and the books of a spring between the sides are the same for all, and are here.
`law_...` are functions of the law: bound when it is made.
"""

from __future__ import annotations

from collections.abc import Callable, MutableSequence, Sequence
from dataclasses import dataclass
from typing import Any

from tautwave.columns import Column
from tautwave.contracts import Row
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, PairView
from tautwave.controller.rows import fill_element
from tautwave.controller.steps import (
    Guard,
    Holding,
    Law,
    Steps,
    fill_each,
    no_close,
    no_effort,
)
from tautwave.controller.wrapping import bound
from tautwave.laws.coupler import coupler_loss, coupler_stored

RINGS = 6
"""Places per slot of delay: position, velocity and effort each way."""


@dataclass(slots=True)
class SeenEnd:
    """What one side sees of the other, in its own units, and the energy it took [J].

    `effort` [N m or N] is what it shows of itself beside position and velocity. That of the far
    side arrives as it balances here: turned round by the sign, over the force scale.
    """

    far_position: float = 0.0
    far_velocity: float = 0.0
    far_effort: float = 0.0
    effort: float = 0.0
    absorbed: float = 0.0


@dataclass(slots=True)
class SeenLink:
    """The books of the spring [J], its stretch [rad or m], and where the line stands."""

    absorbed: float = 0.0
    stored: float = 0.0
    start_stored: float = 0.0
    dissipated: float = 0.0
    error: float = 0.0
    at: int = 0


def no_begin(s: AxisState) -> None:
    """Reset nothing: the law keeps no state of its own."""


def no_spring(q: PairParams, p1: AxisParams, p2: AxisParams) -> float:
    """Return 0: no spring of the law has its energy booked."""
    return 0.0


def where_it_is(s: AxisState) -> tuple[float, float]:
    """Return position and velocity: what the far side sees by default."""
    return s.position, s.velocity


law_begin = no_begin
law_keep = no_close
law_spring = no_spring
law_shown = where_it_is


def start(pair: PairView, gap: float) -> None:
    """Fill the line with the present positions of both sides, at rest."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    for i in range(q.samples):
        table[q.line + i] = one.position
        table[q.line + q.samples + i] = two.position
        for ring in range(2, RINGS):
            table[q.line + ring * q.samples + i] = 0.0
    one.end.absorbed = 0.0
    two.end.absorbed = 0.0
    one.end.effort = 0.0
    two.end.effort = 0.0
    law_begin(one)
    law_begin(two)
    w = c.link
    w.at = 0
    w.error = 0.0
    book_spring(c, q, one, two, law_spring(q, p1, p2))
    w.start_stored = w.stored
    w.dissipated = 0.0


def close(
    s: AxisState, p: AxisParams, displacement: float, count: float, span: float, port: float
) -> None:
    """Book what the device gave, and let the law keep what it wants of the sample."""
    s.end.absorbed += port * displacement
    law_keep(s, p, displacement, count, span, port)


def book_spring(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, stiffness: float
) -> None:
    """Book a spring between the present positions, all in master units.

    Its losses are negative where delay and sampling create energy.
    """
    w = c.link
    absorbed = one.end.absorbed + q.weight * two.end.absorbed
    far = q.to_master * (two.position - c.offset)
    error = one.position - far
    w.stored = coupler_stored(stiffness, one.position, far)
    w.dissipated += coupler_loss(stiffness, absorbed - w.absorbed, w.error, error)
    w.absorbed = absorbed
    w.error = error


def passed(value: float, table: MutableSequence[float], at: int) -> float:
    """Put a value into its ring and return the one that was there a delay ago."""
    old = table[at]
    table[at] = value
    return old


def see(
    c: PairState, q: PairParams, one: AxisState, two: AxisState, table: MutableSequence[float]
) -> None:
    """Advance the line one slot: each side gets the other's state, in its own units."""
    x, v = law_shown(one)
    y, w = law_shown(two)
    f = one.end.effort
    g = two.end.effort
    n = q.samples
    if n > 0:
        at = q.line + c.link.at
        x = passed(x, table, at)
        y = passed(y, table, at + n)
        v = passed(v, table, at + 2 * n)
        w = passed(w, table, at + 3 * n)
        f = passed(f, table, at + 4 * n)
        g = passed(g, table, at + 5 * n)
        c.link.at += 1
        if c.link.at == n:
            c.link.at = 0
    here = one.end
    there = two.end
    here.far_position = q.to_master * (y - c.offset)
    here.far_velocity = q.to_master * w
    here.far_effort = q.sign * g / q.force_scale
    there.far_position = q.ratio * x + c.offset
    there.far_velocity = q.ratio * v
    there.far_effort = q.sign * q.force_scale * f


law_see = see


def engage(pair: PairView) -> None:
    """Give each side the first state of the other."""
    c, q, one, two, table = pair.c, pair.q, pair.one, pair.two, pair.table
    law_see(c, q, one, two, table)


def exchange(pair: PairView, here: bool, due_one: bool, due_two: bool) -> None:
    """Advance the line one slot; `here`: the loop ran in it, so book the spring."""
    c, q, one, two, p1, p2, table = pair.c, pair.q, pair.one, pair.two, pair.p1, pair.p2, pair.table
    if here:
        book_spring(c, q, one, two, law_spring(q, p1, p2))
    law_see(c, q, one, two, table)


def element_names(q: PairParams, p1: AxisParams, p2: AxisParams) -> Sequence[str]:
    """Return the name of the only element."""
    return ("coupler",)


def fill_elements(out: Row, at: int, pair: PairView) -> int:
    """Write what both devices gave and the spring stores; the rest is dissipated or generated."""
    c = pair.c
    w = c.link
    return fill_element(out, at, w.absorbed, w.stored - w.start_stored, w.dissipated)


def seen_law(
    name: str,
    effort: Callable[..., float] = no_effort,
    *,
    end: Callable[[], Any] = SeenEnd,
    begin: Callable[..., None] = no_begin,
    keep: Callable[..., None] = no_close,
    spring: Callable[..., float] = no_spring,
    shown: Callable[..., tuple[float, float]] = where_it_is,
    holding: Holding | None = None,
    signals: Sequence[Column] = (),
    guards: dict[int, Guard] | None = None,
    alike: bool = False,
) -> Law:
    """Return a law of what each side sees of the other.

    Parameters
    ----------
    name : str
        As in the messages of a run.
    effort : callable
        ``effort(s, p, free_velocity)``: the resisting effort until the next sample, as
        `Steps.compute_effort`.
    end : callable
        State of an end: `SeenEnd` or a slotted dataclass derived from it.
    begin : callable
        ``begin(s)``: forget what a run before left in the law's own part of an end.
    keep : callable
        ``keep(s, p, displacement, count, span, port)``: what it wants of a sample, as
        `Steps.close`; `s.end.effort` is what the far side will see.
    spring : callable
        ``spring(q, p1, p2)``: stiffness of the spring whose energy is booked [N m/rad or N/m,
        master units]. Without one the books take all that the devices gave as lost.
    shown : callable
        ``shown(s)``: what the far side sees as position and velocity, for a law that says something
        else in their place.
    holding, signals, guards, alike
        As in `Law`.
    """
    own = {"law_begin": begin, "law_keep": keep, "law_spring": spring}
    own["law_see"] = bound(see, {"law_shown": shown})
    return Law(
        name=name,
        steps=Steps(
            start=bound(start, own),
            engage=bound(engage, own),
            close=bound(close, own),
            exchange=bound(exchange, own),
            compute_effort=effort,
            fill_signals=fill_each(signals),
            fill_elements=fill_elements,
        ),
        end=end,
        link=SeenLink,
        signals=signals,
        elements=element_names,
        accounts={"coupler": "spring and damper between the devices"},
        guards=guards or {},
        rings=RINGS,
        spring=spring,
        shown=shown,
        holding=holding,
        alike=alike,
    )
