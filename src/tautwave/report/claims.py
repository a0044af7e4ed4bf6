"""What motors and ports supplied, beside what was claimed; reads summaries, without NumPy."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from tautwave.report.units import quantity
from tautwave.summary import Summary
from tautwave.summary.model import Motors

ROUNDING = 1e-9
"""Share of the gross flow by which rounding may exceed a stated debt."""


class Kept(NamedTuple):
    """What one end supplied at its worst moment, in external impacts, and what it claimed [J].

    `true` is what it claims in fact, if the noise is as declared, None where nothing is said of it;
    `passed` is None in a run that was not judged.
    """

    axis: str
    given: float
    blow: float
    claim: float
    true: float | None
    passed: bool | None

    @property
    def verdict(self) -> str:
        """Whether it kept its claim, in a word or two."""
        if not self.passed:
            return "not judged" if self.passed is None else "not kept"
        return "kept"


def kept_claims(summary: Summary) -> Iterator[Kept]:
    """Yield the judgement of every end that has one in a summary."""
    for axis, end in summary.certificate.after_run.ends.items():
        if end.given_j is not None and end.claim_j is not None:
            blow = end.blow_j or 0.0
            yield Kept(axis, end.given_j, blow, end.claim_j, end.true_j, end.passed)


def claims_sentence(ends: list[Kept]) -> str:
    """Return the end that came nearest to its claim, or broke it, as a sentence without full stop.

    Both are as its encoder saw it.
    """
    worst = max(ends, key=lambda end: (end.given - end.blow) / max(end.claim, 1e-300))
    supplied, claim = quantity(worst.given - worst.blow, "J", 3), quantity(worst.claim, "J", 3)
    text = f"{worst.axis} supplied {supplied} of the {claim} that it claims"
    if worst.passed is False:
        text = f"{worst.axis} supplied {supplied}, and claims {claim}"
    for end in ends:
        if end.blow > 0.0:
            text += f"; {end.axis} {quantity(end.blow, 'J', 3)} more in an external impact"
    return text


def exceeds(motors: Motors, gross_flow: float, blows: float = 0.0) -> bool:
    """Return whether motors delivered more than `stated_debt` and what blows from outside made.

    `gross_flow` and `blows` in J.
    """
    worst, debt = motors.worst, motors.stated_debt
    if worst is None or debt is None:
        return False
    return worst > debt + blows + ROUNDING * gross_flow


def blows_of(summary: Summary, pair: str) -> float:
    """Return what the motors of a pair gave in blows from outside [J]."""
    return sum(end.blow for end in kept_claims(summary) if end.axis.split(".", 1)[1] == pair)
