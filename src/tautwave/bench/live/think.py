"""The think part of one axis: the controller's live steps fed with a motion of the hand."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from tautwave.bench.calls import GUARDED, SERVO_SITE, SITE, WALLED, B, T
from tautwave.bench.chunks import Cost, Work, costs
from tautwave.contracts import CoupledAxis
from tautwave.controller.axis import close_axis, decide_command, pass_slot, start_axis
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, PairView
from tautwave.controller.slotted import slotted
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
"""What a cycle costs: slot and close, receive and think, both in turn."""

LANES = 20
"""Axes that are measured at a time; the clock is read once for all."""

TABLE = [0.0] * 8
"""No command is under way, no line between: what is exchanged stays in the states."""


class Bench(NamedTuple):
    """Both axes of a pair, of which the first is measured; the second only stands there."""

    pair: PairView
    steps: Steps


def part_costs(kinds: Sequence[SiteCase], rounds: int) -> dict[str, dict[str, Cost]]:
    """Return the cost of `PARTS` of kinds of axes, by their names."""
    works = {f"{case.name}/{part}": _work(case, part) for case in kinds for part in PARTS}
    taken = costs(works, rounds)
    return {case.name: {part: taken[f"{case.name}/{part}"] for part in PARTS} for case in kinds}


def standing_axis(case: SiteCase) -> Bench:
    """Return an axis that has begun where the motion begins."""
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
    pair = slotted(PairView(PairState(link=law.link()), q, one, two, p, p, TABLE))
    law.steps.start(pair, 0.0)
    return Bench(pair, slotted(law.steps))


def closing(b: Bench) -> Callable[[float], None]:
    """Return what closes a slot at a position."""
    one, p, steps = b.pair.one, b.pair.p1, b.steps

    def close(position: float) -> None:
        pass_slot(one, p, TABLE, steps)
        close_axis(one, p, position, 0.01, steps)

    return close


def thinking(b: Bench) -> Callable[[], None]:
    """Return what receives and thinks."""
    pair, steps = b
    one, p = pair.one, pair.p1
    ceiling = p.ceiling

    def think() -> None:
        steps.exchange(pair, True, True, True)
        decide_command(one, p, TABLE, ceiling, steps)

    return think


def _work(case: SiteCase, part: str) -> Work:
    """Return the work of a part of `LANES` axes in turn, so that each closes what it thought."""
    lanes = [(closing(b), thinking(b)) for b in (standing_axis(case) for _ in range(LANES))]
    closes, thinks = zip(*lanes, strict=True)

    def step(position: float) -> int:
        began = time.thread_time_ns()
        if part == "both":
            for close, think in lanes:
                close(position)
                think()
            return time.thread_time_ns() - began
        for close in closes:
            close(position)
        closed = time.thread_time_ns()
        for think in thinks:
            think()
        return closed - began if part == "close" else time.thread_time_ns() - closed

    at = 50
    for position in POSITIONS[:at]:  # until Python has settled on what it runs
        step(position)

    def work(n: int) -> float:
        nonlocal at
        steps = math.ceil(n / LANES)
        spent = 0
        for _ in range(steps):
            spent += step(POSITIONS[at])
            at = (at + 1) % len(POSITIONS)
        return spent * 1e-9 * n / (steps * LANES)

    return work
