"""What motors and ports supplied, beside what was claimed; reads summaries, without NumPy."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from tautwave.report.units import number, quantity

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


def kept_claims(summary: Mapping[str, Any]) -> Iterator[Kept]:
    """Yield the judgement of every end that has one in a summary."""
    after = (summary.get("certificate") or {}).get("after_run") or {}
    for axis, end in (after.get("ends") or {}).items():
        given, blow, claim = (number(end.get(f"{key}_j")) for key in ("given", "blow", "claim"))
        if given is not None and claim is not None:
            true = number(end.get("true_j"))
            yield Kept(axis, given, blow or 0.0, claim, true, end.get("passed"))


def claims_sentence(ends: list[Kept]) -> str:
    """Return the end that came nearest to its claim, or broke it, as a sentence without full stop.

    Both are as its encoder saw it.
    """
    worst = max(ends, key=lambda end: (end.given - end.blow) / max(end.claim, 1e-300))
    given, claim = quantity(worst.given - worst.blow, "J", 3), quantity(worst.claim, "J", 3)
    text = f"{worst.axis} supplied {given} of the {claim} that it claims"
    if worst.passed is False:
        text = f"{worst.axis} supplied {given}, and claims {claim}"
    for end in ends:
        if end.blow > 0.0:
            text += f"; {end.axis} {quantity(end.blow, 'J', 3)} more in an external impact"
    return text


def exceeds(motors: Mapping[str, Any], gross_flow: float, blows: float = 0.0) -> bool:
    """Return whether motors delivered more than `stated_debt` and what blows from outside made.

    `motors` is a pair's `motors` in the summary (`tautwave.report.motors.motor_energy`),
    `gross_flow` and `blows` in J.
    """
    worst, debt = number(motors.get("worst")), number(motors.get("stated_debt"))
    if worst is None or debt is None:
        return False
    return worst > debt + blows + ROUNDING * gross_flow


def blows_of(summary: Mapping[str, Any], pair: str) -> float:
    """Return what the motors of a pair gave in blows from outside [J]."""
    return sum(end.blow for end in kept_claims(summary) if end.axis.split(".", 1)[1] == pair)
