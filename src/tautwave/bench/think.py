"""The think part of one axis: the live `SiteAxis` fed with a motion of the hand."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import NamedTuple

from tautwave.bench.calls import GUARDED, SERVO_SITE, SITE, WALLED
from tautwave.bench.chunks import Work
from tautwave.laws.site import SiteParams
from tautwave.models.encoder import quantise
from tautwave.runtime.site import SiteAxis

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


def works() -> dict[str, Work]:
    """Return the work of closing, of thinking, and of both, for every kind of axis."""
    return {f"{case.name}/{part}": _work(_site(case), part) for case in CASES for part in PARTS}


def _site(case: SiteCase) -> SiteAxis:
    site = SiteAxis(case.params, coupled_by_wave=case.by_wave, impedance=case.impedance)
    site.start(POSITIONS[0], 0.0, 0.0)
    return site


def _close(site: SiteAxis, position: float) -> None:
    site.pass_slot()
    site.close(position, 0.01)


def _think(site: SiteAxis, position: float) -> None:
    # Half of what left comes back, as from the far end of a real line.
    site.receive(0.5 * site.leaving)
    site.think(position, 0.0, site.ceiling)


def _both(site: SiteAxis, position: float) -> None:
    site.pass_slot()
    site.close(position, 0.01)
    site.receive(0.5 * site.leaving)
    site.think(position, 0.0, site.ceiling)


def _work(site: SiteAxis, part: str) -> Work:
    step: Callable[[SiteAxis, float], None] = {"close": _close, "think": _think, "both": _both}[
        part
    ]
    for position in POSITIONS:  # a full swing, so that every branch has been taken
        _both(site, position)
    at = 0

    def work(n: int) -> float:
        nonlocal at
        if at + n > len(POSITIONS):
            at = 0
        chosen = (POSITIONS * (n // len(POSITIONS) + 1))[at : at + n]
        at += n
        began = time.thread_time_ns()
        for position in chosen:
            step(site, position)
        return (time.thread_time_ns() - began) * 1e-9

    return work
