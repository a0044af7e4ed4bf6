"""What each end of a pair supplied in a run, compared with what its law claimed beforehand.

Both are as the end's encoder sees it, from the recording. A device that is beyond its velocity
limit by more than its motor can have made of it was hit from outside: what the motor gave in the
periods until the guard acted, the effort that acted times the way, is a blow. It is not part of the
claim, and reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tautwave.analysis.rise import NOTHING, Rise, surplus_of
from tautwave.report.claims import ROUNDING
from tautwave.report.figures.envelope import Floats
from tautwave.report.motors import motion
from tautwave.report.run.rundir import SIDES, Run, block
from tautwave.report.units import number, quantity


class End(NamedTuple):
    """One end of a pair: what it supplied at its worst moment, in impacts, and what it claimed [J].

    `flow` is all that passed to and fro; `beyond` what it supplied beyond reserve and leak, None
    where those are not known: a stall may cost that once, not again and again.
    """

    axis: str
    given: float
    blow: float
    claim: float
    flow: float
    beyond: Rise | None = None

    @property
    def goes_on(self) -> bool:
        """Whether it supplies more than reserve and leak in many of the seconds, unhit."""
        return self.beyond is not None and self.beyond.lasting and self.blow == 0.0

    @property
    def passed(self) -> bool:
        """Whether it kept its claim, blows apart, and does not go on."""
        return (
            self.given - self.blow <= self.claim + ROUNDING * self.flow + NOTHING
            and not self.goes_on
        )

    @property
    def sentence(self) -> str:
        """A broken claim or a blow in a sentence; empty without either."""
        given, claim = quantity(self.given, "J", 3), quantity(self.claim, "J", 3)
        blow = f"{quantity(self.blow, 'J', 3)} of it in an impact beyond its velocity limit"
        if self.passed and self.blow == 0.0:
            return ""
        if self.passed:
            return f"{self.axis} port: supplied {given}, {blow}; its claim is {claim}."
        if self.beyond is not None and self.goes_on:
            share = f"{100.0 * self.beyond.share:.0f} % of the seconds"
            return (
                f"{self.axis} port: supplied {given} of its claim of {claim}, which is for a "
                f"stall; it went on supplying more than its reserve and leak in {share}."
            )
        apart = f", {blow}" if self.blow > 0.0 else ""
        return (
            f"{self.axis} port: supplied {given}{apart}, more than its claim of {claim}; its "
            "encoder, delay or driver differs from the rig."
        )


def ends_of(run: Run) -> Iterator[End]:
    """Yield every end that has a claim and is recorded."""
    for pair in run.pairs:
        own = block(run.summary, "pairs", pair)
        claims = block(own, "claim_j")
        for side in SIDES:
            claim = number(claims.get(side))
            ports = [f"{pair}.{what}_{side}.absorbed" for what in ("port", "account", "damper")]
            read = run.read(*ports)
            if claim is None or not read or not run.rows:
                continue
            # A matched end's damper is part of it: what the tank paid for it did not come out.
            taken = np.sum(list(read.values()), axis=0)
            axis = f"{side}.{pair}"
            flow = run.read(f"{axis}.gross_flow").get(f"{axis}.gross_flow", np.zeros(1))
            weight = 1.0 if side == "master" else 1.0 / (number(own.get("power_ratio")) or 1.0)
            passed = float(np.nanmax(flow)) / weight
            yield End(
                axis,
                max(0.0, -float(np.nanmin(taken))) / weight,
                blow(run, pair, side) / weight,
                claim,
                passed,
                _beyond(run, axis, taken / -weight, passed),
            )


def _beyond(run: Run, axis: str, given: Floats, flow: float) -> Rise | None:
    """Return what an end supplied beyond twice its reserve and its leak [J].

    A port begins each engagement with its reserve.
    """
    element = block(run.summary, "certificate", "elements", f"{axis} port")
    reserve, leak = number(element.get("reserve_j")), number(element.get("leak_w"))
    if reserve is None or leak is None or run.time is None or run.rows < 2:
        return None
    times = run.read("operation.engagement").get("operation.engagement", np.ones(run.rows))
    known = np.isfinite(given)
    time = run.time[known] - run.time[0]
    allowed = 2.0 * reserve * np.maximum(times[known], 1.0) + leak * time
    return surplus_of(time, given[known], allowed, flow) if len(time) > 1 else None


def blow(run: Run, pair: str, side: str) -> float:
    """Return what a motor gave while its device was too fast by itself [J, pair's]."""
    axis = f"{side}.{pair}"
    keys = block(run.rig, side, "axes", pair)
    limit = number(keys.get("velocity_limit"))
    mass = number(block(keys, "inertia").get("lower")) or math.inf
    own_push = (number(keys.get("effort_limit")) or 0.0) / mass
    names = (f"{axis}.port_energy", f"{pair}.wall_{side}.absorbed")
    read = run.read(*names)
    if limit is None or names[0] not in read:
        return 0.0
    moved, time, good = motion(run, axis)
    taken = read[names[0]] - read.get(names[1], np.zeros(run.rows))
    gave = -np.diff(taken[good])
    fast = np.abs(moved) > (limit + 0.5 * own_push * time) * time
    return float(np.sum(np.maximum(gave[fast], 0.0)))
