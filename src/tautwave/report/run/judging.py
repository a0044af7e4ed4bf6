"""What the rows of a run say of the energy that its couplings generated, and what they claimed.

Three rules. The *spring* of a law whose ends are those of one: the greatest rise of its books
beyond what the devices' damping could have taken (`report.coupled`). The *ends* of a pair with
claims, each beside its own (`report.ends`). All else by its *sum*: what it gave since the start
beyond that damping; of a scene what its held efforts gave, for what its network makes of itself is
meant.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from tautwave.analysis.rise import Floats, Rise, damping_work, surplus_of
from tautwave.certificate.belief import SIDES, declared_delays
from tautwave.config import Rig
from tautwave.config.keys.control import SCENE
from tautwave.report.coupled import both_sampled, coupled_rise, is_spring, stall_claim
from tautwave.report.hooks import report_hooks
from tautwave.report.run.rundir import Run
from tautwave.report.units import quantity
from tautwave.rig import axis_allowance, coupling_part, pair_scale

RULES = {
    "spring": "by what its spring holds, from sample to sample",
    "ends": "end by end, by what it claims",
    "sum": "by the sum of all that it gave since the start, as no tighter rule applies",
}


REMEDY = "It was not passive: lower its stiffness, or reduce lost samples and stalls."
"""What follows from such a sentence where passivity is required."""

ALLOWED = "The rig requires only stability with the stated hand, which allows that."
"""What follows where it is not."""


class Judged(NamedTuple):
    """What a coupling, or a scene, generated in a run.

    Attributes
    ----------
    name : str
        `coupling of PAIR` or `scene`.
    rule : str
        One of `RULES`.
    rise : Rise
        What it generated beyond what the damping of its devices could have dissipated.
    claim : float
        What it may have [J].
    """

    name: str
    rule: str
    rise: Rise
    claim: float

    @property
    def passed(self) -> bool:
        """Whether it generated no more than it claims, and does not go on."""
        return not self.rise.exceeds(self.claim)

    @property
    def sentence(self) -> str:
        """What it generated too much, with both numbers; empty if it passed."""
        if self.passed:
            return ""
        supplied, taken = quantity(self.rise.given, "J", 3), quantity(self.rise.taken, "J", 3)
        claims = f"claims {quantity(self.claim, 'J', 3)}" if self.claim > 0.0 else "claims nothing"
        text = (
            f"{self.name}: it gave {supplied} more than the damping of its devices, by its lower "
            f"bounds, could have dissipated ({taken} in all); it {claims}"
        )
        if self.rise.lasting:
            text += f", and it generated energy in {100.0 * self.rise.share:.0f} % of the seconds"
        return f"{text}."

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "rule": self.rule,
            "given_j": self.rise.given,
            "damping_j": self.rise.taken,
            "claim_j": self.claim,
            "floor_j": self.rise.floor,
            "share_of_seconds": self.rise.share,
            "passed": self.passed,
            "sentence": self.sentence,
        }


def judged_of(run: Run, rig: Rig) -> Iterator[Judged]:
    """Yield what a scene generated, and each coupling whose ends claim nothing themselves.

    One of two sites sees half of a coupling, and is not judged by it.
    """
    if rig.scene is not None:
        supplied = report_hooks().given(run)
        rise = None
        if supplied is not None:
            rise = _given_since_start(run, rig, dict.fromkeys(rig.axes, 1.0), supplied)
        if rise is not None:
            yield Judged(SCENE, "sum", rise, report_hooks().claim(rig))
        return
    if run.site is not None or coupling_part(rig).claim:
        return
    spring = is_spring(rig)
    for pair in run.pairs:
        rise = coupled_rise(run, rig, pair) if spring else summed_rise(run, rig, pair)
        if rise is not None:
            claim = stall_claim(rig, pair) if spring else 0.0
            yield Judged(f"coupling of {pair}", "spring" if spring else "sum", rise, claim)


def summed_rise(run: Run, rig: Rig, pair: str) -> Rise | None:
    """Return what the coupling of a pair gave since the start, None where its rows do not say."""
    ratio = pair_scale(rig.coupling.pairs[pair]).power
    weights = {f"{side}.{pair}": 1.0 if side == "master" else 1.0 / ratio for side in SIDES}
    name = f"{pair}.coupler.absorbed"
    absorbed = run.read(name).get(name)
    if absorbed is None:
        return None
    return _given_since_start(run, rig, weights, -absorbed)


def _given_since_start(
    run: Run, rig: Rig, weights: Mapping[str, float], given: Floats
) -> Rise | None:
    read = run.read(*(f"{axis}.{what}" for axis in weights for what in ("position", "valid")))
    if run.rows < 2 or len(read) < 2 * len(weights):
        return None
    at = np.flatnonzero(both_sampled(run, list(weights), read))
    if len(at) < 2:
        return None
    skipped = run.read("skipped_slots").get("skipped_slots", np.zeros(run.rows))
    time = np.cumsum(1.0 + np.nan_to_num(skipped))[at] / run.rate_hz
    delays = declared_delays(rig)
    damped = np.zeros(len(at))
    for axis, weight in weights.items():
        moved = np.diff(read[f"{axis}.position"][at])
        left = weight * axis_allowance(rig, axis, delays[axis]).coupling_damping
        damped[1:] += np.cumsum(damping_work(left, moved, np.diff(time)))
    total = given[at] - given[at[0]]
    return surplus_of(time, total, damped, float(np.sum(np.abs(np.diff(total)))))
