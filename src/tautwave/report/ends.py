"""What each axis of a pair supplied in a run, compared with what was claimed beforehand.

Both are as its encoder sees it, from the recording, and of the port and a local wall together: what
is sent is limited whatever requested it. Of the wall that is what it gave beyond what its spring
held at the start and what the device's damping took while it pushed, for which it is certified.

A device that is beyond its velocity limit by more than its motor can have made of it was hit from
outside: what the motor gave in the periods until the guard acted, the effort that acted times the
way, is a blow. It is not part of the claim, and reported.

A claim may rest on the condition that no gap between two samples is longer than `safe_gap_s`. A run
that had a longer one has to have kept what would have been claimed without: the claim of a prompt
host, and once the kinetic energy at the velocity limit.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tautwave.analysis.claim import NOTHING, Stated
from tautwave.analysis.rise import Rise, surplus_of
from tautwave.report.claims import ROUNDING
from tautwave.report.figures.envelope import Floats
from tautwave.report.motors import motion
from tautwave.report.run.rundir import SIDES, Run, block
from tautwave.report.units import number, quantity
from tautwave.summary.model import CertifiedElement, Pair, Side


class End(NamedTuple):
    """One axis of a pair: what it supplied at its worst moment, in impacts, and its claim [J].

    `flow` is all that passed to and fro; `beyond` what it supplied beyond reserve and leak, None
    where those are not known: a stall may cost that once, not again and again. `gap_s` is the
    longest gap between two of its samples, and `stated` what was stated before the run, None in one
    that did not.
    """

    axis: str
    given: float
    blow: float
    claim: float
    flow: float
    beyond: Rise | None = None
    gap_s: float = 0.0
    stated: Stated | None = None

    @property
    def goes_on(self) -> bool:
        """Whether it supplies more than reserve and leak in many of the seconds, unhit."""
        return self.beyond is not None and self.beyond.lasting and self.blow == 0.0

    @property
    def allowed(self) -> float:
        """Return what it may have supplied, impacts apart [J]."""
        one = self.stated
        if one is None or self.stalled is not True:
            return self.claim
        assert one.kinetic_j is not None
        return min(self.claim, one.prompt_j + one.kinetic_j)

    @property
    def stalled(self) -> bool | None:
        """Whether a gap was longer than its claim assumes; None: it assumes nothing of gaps."""
        one = self.stated
        if one is None or one.kinetic_j is None or one.let_go_j <= one.kinetic_j:
            return None
        return self.gap_s > one.safe_gap_s * (1.0 + ROUNDING)

    @property
    def passed(self) -> bool:
        """Whether it kept its claim, blows apart, and does not go on."""
        return self._within(self.allowed) and not self.goes_on

    def _within(self, most: float) -> bool:
        return self.given - self.blow <= most + ROUNDING * self.flow + NOTHING

    @property
    def sentence(self) -> str:
        """A broken claim, a gap too long or a blow in a sentence; empty without any."""
        supplied, claim = quantity(self.given, "J", 3), quantity(self.claim, "J", 3)
        blow = f"{quantity(self.blow, 'J', 3)} of it in an impact beyond its velocity limit"
        apart = f", {blow}" if self.blow > 0.0 else ""
        late = ""
        if self.stalled and self.stated is not None:
            late = (
                f"it had no sample for {quantity(self.gap_s, 's', 3)}, and its certificate assumes "
                f"at most {quantity(self.stated.safe_gap_s, 's', 3)}"
            )
        if self.beyond is not None and self.goes_on and self._within(self.allowed):
            share = f"{100.0 * self.beyond.share:.0f} % of the seconds"
            return (
                f"{self.axis}: supplied {supplied} of its claim of {claim}, which is for a "
                f"stall; it went on supplying more than its reserve and leak in {share}."
            )
        if not self.passed and self._within(self.claim):
            return (
                f"{self.axis}: supplied {supplied}{apart}, more than the "
                f"{quantity(self.allowed, 'J', 3)} claimed without a stall: {late}."
            )
        if not self.passed:
            return (
                f"{self.axis}: supplied {supplied}{apart}, more than its claim of {claim}; its "
                "encoder, delay or driver differs from the rig."
            )
        if late:
            return f"{self.axis}: {late}; it supplied {supplied}{apart}."
        return f"{self.axis}: supplied {supplied}, {blow}; its claim is {claim}." if apart else ""


def ends_of(run: Run) -> Iterator[End]:
    """Yield every axis that has a claim and is recorded."""
    for pair in run.pairs:
        own = run.result_of(pair)
        for side in SIDES:
            claim = own.claim_j.get(side)
            ports = [f"{pair}.{what}_{side}.absorbed" for what in ("port", "account", "damper")]
            read = run.read(*ports)
            if claim is None or not read or not run.rows:
                continue
            axis = f"{side}.{pair}"
            flow = run.read(f"{axis}.gross_flow").get(f"{axis}.gross_flow", np.zeros(1))
            weight = 1.0 if side == "master" else 1.0 / (own.power_ratio or 1.0)
            # A matched end's damper is part of it: what the tank paid for it did not come out.
            port = np.sum(list(read.values()), axis=0)
            taken = port + _of_wall(run, pair, side, weight)
            passed = float(np.nanmax(flow)) / weight
            yield End(
                axis,
                max(0.0, -float(np.nanmin(taken))) / weight,
                blow(run, pair, side) / weight,
                claim,
                passed,
                _beyond(run, axis, port / -weight, passed),
                longest_gap(run, axis),
                stated_of(own, side),
            )


def _beyond(run: Run, axis: str, given: Floats, flow: float) -> Rise | None:
    """Return what a port supplied beyond twice its reserve and its leak [J], a wall left out.

    A port begins each engagement with its reserve.
    """
    element = port_of(run, axis)
    reserve, leak = element.reserve_j, element.leak_w
    if reserve is None or leak is None or run.time is None or run.rows < 2:
        return None
    times = run.read("operation.engagement").get("operation.engagement", np.ones(run.rows))
    known = np.isfinite(given)
    time = run.time[known] - run.time[0]
    allowed = 2.0 * reserve * np.maximum(times[known], 1.0) + leak * time
    return surplus_of(time, given[known], allowed, flow) if len(time) > 1 else None


def stated_of(pair: Pair, side: Side) -> Stated | None:
    """Return what was stated of one side in a pair's block of a summary; None: nothing was."""
    claim = pair.claims.get(side)
    if claim is None or not set(Stated._fields) <= claim.model_fields_set:
        return None
    return Stated(**{key: getattr(claim, key) for key in Stated._fields})


def port_of(run: Run, axis: str) -> CertifiedElement:
    """Return what the certificate has on an axis' port; all of it unknown where it has nothing."""
    return run.result.certificate.elements.get(f"{axis} port", CertifiedElement())


def _of_wall(run: Run, pair: str, side: str, weight: float) -> Floats:
    """Return by row what a local wall took, with what it may give without a stall [J, pair's]."""
    axis = f"{side}.{pair}"
    names = [f"{pair}.wall_{side}.{what}" for what in ("absorbed", "stored")]
    read = run.read(*names, f"{axis}.wall_effort")
    if len(read) < len(names) + 1:
        return np.zeros(run.rows)
    absorbed, stored, effort = read.values()
    moved, time, good = motion(run, axis)
    damping = number(block(run.rig, side, "axes", pair, "damping").get("lower")) or 0.0
    pushed = (effort[good][:-1] != 0.0) | (np.diff(absorbed[good]) != 0.0)
    damped = np.zeros(run.rows)
    damped[np.flatnonzero(good)[1:]] = np.where(pushed, weight * damping * moved**2 / time, 0.0)
    stored_most = max(0.0, -float(np.nanmin(stored)))
    taken: Floats = absorbed + np.cumsum(damped) + stored_most
    return taken


def longest_gap(run: Run, axis: str) -> float:
    """Return the longest time between two samples of an axis [s]."""
    if f"{axis}.position" not in run.columns:
        return 0.0
    _, time, _ = motion(run, axis)
    return float(time.max(initial=0.0))


def blow(run: Run, pair: str, side: str) -> float:
    """Return what a motor gave while its device was too fast by itself [J, pair's]."""
    axis = f"{side}.{pair}"
    keys = block(run.rig, side, "axes", pair)
    limit = number(keys.get("velocity_limit"))
    mass = number(block(keys, "inertia").get("lower")) or math.inf
    own_push = (number(keys.get("effort_limit")) or 0.0) / mass
    energy = f"{axis}.port_energy"
    read = run.read(energy)
    if limit is None or energy not in read:
        return 0.0
    moved, time, good = motion(run, axis)
    gave = -np.diff(read[energy][good])
    fast = np.abs(moved) > (limit + 0.5 * own_push * time) * time
    return float(np.sum(np.maximum(gave[fast], 0.0)))
