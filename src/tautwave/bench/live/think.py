"""The think part of one axis: the controller's live steps fed with a motion of the hand."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

from tautwave.bench.calls import GUARDED, SERVO_SITE, SITE, WALLED, B, T
from tautwave.bench.chunks import Work
from tautwave.contracts import CoupledAxis
from tautwave.controller.axis import close_axis, pass_slot, start_axis, think_axis
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState
from tautwave.controller.steps import Law, NoParams, Steps
from tautwave.laws.site import SiteParams
from tautwave.models.encoder import quantise
from tautwave.registry import load_coupling, load_named

POSITIONS = [quantise(0.12 + 0.05 * math.sin(2e-3 * math.pi * i), 2.094e-5) for i in range(1000)]
"""One second of a 1 Hz swing about a wall at 0.1 rad, as an encoder sees it [rad]."""


class SiteCase(NamedTuple):
    """One kind of axis by the name it has in the table, and the law that holds it."""

    name: str
    params: SiteParams
    law: Law
    end: Any
    impedance: bool = True


def cases() -> tuple[SiteCase, ...]:
    """Return every kind of axis that the shipped couplings hold."""
    wave, position = (load_named(load_coupling(name).law) for name in ("wave", "position"))
    axis = CoupledAxis(T, 1.0, 1e-3, 0.0, 0.0, 0, 2.0, velocity_limit=15.0)
    keys = {"wave_impedance": B, "wave_filter_hz": 100.0, "pole_master": 0.5, "pole_slave": 0.5}
    port = _end("wave", keys, axis)
    servo = _end("wave", keys, axis._replace(inertia=None))
    spring = _end("position", {"stiffness": 1.0, "damping": 5e-3}, axis)
    return (
        SiteCase("wave port, no wall", SITE, wave, port),
        SiteCase("wave port, wall touched half the time", WALLED, wave, port),
        SiteCase("wave port, controlled wall", GUARDED, wave, port),
        SiteCase("position coupling, no wall", SITE, position, spring),
        SiteCase("admittance port, wall", SERVO_SITE, wave, servo, impedance=False),
    )


def _end(law: str, keys: dict[str, float], axis: CoupledAxis) -> Any:
    """Return the constants of a master's end."""
    plugin = load_coupling(law)
    coupling = load_named(plugin.keys).model_validate({"law": law, "pairs": {"lever": keys}})
    return load_named(plugin.end_constants)(coupling.pairs["lever"], "master", axis)


PARTS = ("close", "think", "both")


TABLE = [0.0] * 8
"""No command is under way, no line between: what is exchanged stays in the states."""


class Bench(NamedTuple):
    """Both axes of a pair, of which the first is measured; the second only stands there."""

    pair: PairState
    link: PairParams
    one: AxisState
    two: AxisState
    params: AxisParams
    steps: Steps


def works() -> dict[str, Work]:
    """Return the work of closing, of thinking, and of both, for every kind of axis."""
    return works_of(cases())


def works_of(kinds: Iterable[SiteCase]) -> dict[str, Work]:
    """Return the same for given kinds."""
    return {f"{case.name}/{part}": _work(_axis(case), part) for case in kinds for part in PARTS}


def _axis(case: SiteCase) -> Bench:
    site, law = case.params, case.law
    p = AxisParams(
        site=site,
        half_period=0.5 * site.period,
        late=0.0,
        ceiling=site.limit.effort if case.impedance else site.limit.velocity,
        weight=1.0,
        delay=0,
        pipe=0,
        impedance=case.impedance,
        divisor=1,
        half_slot=0.5 * site.period,
        end=case.end,
    )
    q = PairParams(
        0, 1, False, False, 1.0, 1.0, 1.0, 1.0, 1.0, site.period, 0.5 * site.period, 0.0, 1.0, 0, 0,
        NoParams(),
    )  # fmt: skip
    one, two = AxisState(end=law.end()), AxisState(end=law.end())
    start_axis(one, p, POSITIONS[0], 0.0)
    start_axis(two, p, POSITIONS[0], 0.0)
    return Bench(PairState(link=law.link()), q, one, two, p, law.steps)


def _close(b: Bench, position: float) -> None:
    pass_slot(b.one, b.params, TABLE, b.steps)
    close_axis(b.one, b.params, position, 0.01, b.steps)


def _think(b: Bench, position: float) -> None:
    think_axis(b.one, b.params, TABLE, b.params.ceiling, b.steps)


def _both(b: Bench, position: float) -> None:
    pass_slot(b.one, b.params, TABLE, b.steps)
    close_axis(b.one, b.params, position, 0.01, b.steps)
    b.steps.exchange(b.pair, b.link, b.one, b.two, b.params, b.params, TABLE, True, True, True)
    think_axis(b.one, b.params, TABLE, b.params.ceiling, b.steps)


def _work(b: Bench, part: str) -> Work:
    step: Callable[[Bench, float], None] = {
        "close": _close,
        "think": _think,
        "both": _both,
    }[part]
    for position in POSITIONS:  # a full swing, so that every branch has been taken
        _both(b, position)
    at = 0

    def work(n: int) -> float:
        nonlocal at
        if at + n > len(POSITIONS):
            at = 0
        chosen = (POSITIONS * (n // len(POSITIONS) + 1))[at : at + n]
        at += n
        began = time.thread_time_ns()
        for position in chosen:
            step(b, position)
        return (time.thread_time_ns() - began) * 1e-9

    return work
