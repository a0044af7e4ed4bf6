"""The think part of one axis: the controller's live steps fed with a motion of the hand."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from tautwave.bench.calls import GUARDED, SERVO_SITE, SITE, WALLED
from tautwave.bench.chunks import Work
from tautwave.controller.axis import close_axis, pass_slot, receive_wave, start_axis, think_axis
from tautwave.controller.records import AxisParams, AxisState
from tautwave.laws.site import SiteParams
from tautwave.models.encoder import quantise

POSITIONS = [quantise(0.12 + 0.05 * math.sin(2e-3 * math.pi * i), 2.094e-5) for i in range(1000)]
"""One second of a 1 Hz swing about a wall at 0.1 rad, as an encoder sees it [rad]."""


class SiteCase(NamedTuple):
    """One kind of axis by the name it has in the table."""

    name: str
    params: SiteParams
    by_wave: bool
    impedance: bool


CASES = (
    SiteCase("wave port, no wall", SITE, by_wave=True, impedance=True),
    SiteCase("wave port, wall touched half the time", WALLED, by_wave=True, impedance=True),
    SiteCase("wave port, controlled wall", GUARDED, by_wave=True, impedance=True),
    SiteCase("position coupling, no wall", SITE, by_wave=False, impedance=True),
    SiteCase("admittance port, wall", SERVO_SITE, by_wave=True, impedance=False),
)
PARTS = ("close", "think", "both")


TABLE = [0.0]


def works() -> dict[str, Work]:
    """Return the work of closing, of thinking, and of both, for every kind of axis."""
    return {f"{case.name}/{part}": _work(*_axis(case), part) for case in CASES for part in PARTS}


def _axis(case: SiteCase) -> tuple[AxisState, AxisParams]:
    site = case.params
    p = AxisParams(
        site=site,
        wave=1.0,
        half_period=0.5 * site.port.period,
        late=0.0,
        ceiling=site.limit.effort if case.impedance else site.limit.velocity,
        weight=1.0,
        delay=0,
        pipe=0,
        by_wave=case.by_wave,
        impedance=case.impedance,
        divisor=1,
        rated=False,
        line_half=0.5 * site.port.period,
    )
    s = AxisState()
    start_axis(s, p, POSITIONS[0], 0.0, 0.0)
    return s, p


def _close(s: AxisState, p: AxisParams, position: float) -> None:
    pass_slot(s, p, TABLE)
    close_axis(s, p, position, 0.01)


def _think(s: AxisState, p: AxisParams, position: float) -> None:
    # Half of what left comes back, as from the far end of a real line.
    receive_wave(s, p, 0.5 * s.leaving)
    s.far_position = position
    think_axis(s, p, TABLE, p.ceiling)


def _both(s: AxisState, p: AxisParams, position: float) -> None:
    pass_slot(s, p, TABLE)
    close_axis(s, p, position, 0.01)
    receive_wave(s, p, 0.5 * s.leaving)
    s.far_position = position
    think_axis(s, p, TABLE, p.ceiling)


def _work(s: AxisState, p: AxisParams, part: str) -> Work:
    step: Callable[[AxisState, AxisParams, float], None] = {
        "close": _close,
        "think": _think,
        "both": _both,
    }[part]
    for position in POSITIONS:  # a full swing, so that every branch has been taken
        _both(s, p, position)
    at = 0

    def work(n: int) -> float:
        nonlocal at
        if at + n > len(POSITIONS):
            at = 0
        chosen = (POSITIONS * (n // len(POSITIONS) + 1))[at : at + n]
        at += n
        began = time.thread_time_ns()
        for position in chosen:
            step(s, p, position)
        return (time.thread_time_ns() - began) * 1e-9

    return work
