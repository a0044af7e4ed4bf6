"""The certificate as plain data: verdicts, their conditions, and sentences for people."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from tautwave.files import json_ready
from tautwave.types import CommandDelay

VERDICTS = ("passive", "passive_quantised", "coupled_stable")
"""Verdicts of a rig, always all three; `require` names the one that has to pass."""


class Verdict(NamedTuple):
    """One verdict.

    Attributes
    ----------
    passed : bool
        Holds, if need be under conditions.
    reason : str
        By which theorem, or why not: one sentence.
    conditions : tuple of str
        Unmeasured assumptions that the verdict rests on; empty for a plain pass.
    margin : float or None
        Margin, > 0 if it passes; unit and meaning are in `reason` or in the element.
    """

    passed: bool
    reason: str
    conditions: tuple[str, ...] = ()
    margin: float | None = None

    @property
    def state(self) -> str:
        """`passed`, `conditional` or `failed`."""
        if not self.passed:
            return "failed"
        return "conditional" if self.conditions else "passed"

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "passed": self.passed,
            "state": self.state,
            "reason": self.reason,
            "conditions": list(self.conditions),
            "margin": self.margin,
        }


class Element(NamedTuple):
    """One element of the rig: a wall, a port, the line, a filter, a scaling, a coupling.

    `axis` is the full name of its axis or, where it belongs to no axis, the pair's name.
    `numbers` holds everything that was computed, `sentences` the text for people. `more` computes
    further ones on which no verdict rests, and which take long.
    """

    name: str
    kind: str
    axis: str
    passive: Verdict
    passive_quantised: Verdict
    numbers: Mapping[str, Any]
    sentences: tuple[str, ...]
    more: Callable[[], tuple[Mapping[str, Any], tuple[str, ...]]] | None = None

    def whole(self) -> Element:
        """Return it with what `more` computes."""
        if self.more is None:
            return self
        numbers, sentences = self.more()
        return self._replace(
            numbers={**self.numbers, **numbers}, sentences=(*self.sentences, *sentences), more=None
        )

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "name": self.name,
            "kind": self.kind,
            "axis": self.axis,
            "passive": self.passive.as_dict(),
            "passive_quantised": self.passive_quantised.as_dict(),
            "numbers": dict(self.numbers),
            "sentences": list(self.sentences),
        }


class LoopCase(NamedTuple):
    """One linear regime of a pair: what is in contact, mass taken [kg or kg m^2], and its mode.

    `radius` is the greatest |z|, `growth` ln|z| / T [1/s], `frequency` [Hz]. NaN if the small gain
    of both ends already shows stability.
    """

    contact: str
    mass: str
    stable: bool
    radius: float
    growth: float
    frequency: float


class PairLoop(NamedTuple):
    """Coupled stability of one pair with the stated hand."""

    pair: str
    verdict: Verdict
    hand: str
    cases: tuple[LoopCase, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain data."""
        return {
            "pair": self.pair,
            "verdict": self.verdict.as_dict(),
            "hand": self.hand,
            "cases": [case._asdict() for case in self.cases],
        }


def _nothing(*_: Any) -> Iterable[Element]:
    return ()


def _no_remedy(rig: Any, pair: str) -> str:
    return "Lower the coupling's stiffness or the delay, or raise the damping."


class CouplingVerdict(NamedTuple):
    """The passivity verdict that the part of a law declares: its `verdict`.

    Attributes
    ----------
    pair_elements : callable
        `(rig, pair, delays)`: the elements that belong to neither axis, at least one.
    axis_elements : callable
        `(rig, axis_name, delays, damping)`: those of one axis, `damping` of its device being taken
        by its local wall [N m s/rad or N s/m].
    remedy : callable
        `(rig, pair)`: what to change in an unstable pair, a sentence.
    contracting : bool
        The line carries waves: if both ends return less than arrives, any delay is stable.
    picture : str
        Text of the picture if there is no wall; empty: it draws the waves that ports return.
    """

    pair_elements: Callable[[Any, str, Mapping[str, CommandDelay]], Iterable[Element]]
    axis_elements: Callable[[Any, str, Mapping[str, CommandDelay], float], Iterable[Element]] = (
        _nothing
    )
    remedy: Callable[[Any, str], str] = _no_remedy
    contracting: bool = False
    picture: str = "no picture for this coupling"


class Certificate(NamedTuple):
    """What is guaranteed for a rig, and under which conditions.

    Attributes
    ----------
    rig : str
        Its name.
    require : str
        The verdict that decides.
    verdicts : mapping of str to Verdict
        All of `VERDICTS`.
    elements, loops : tuples
        Element by element, pair by pair.
    walls : mapping of str to dict
        By axis: requested and rendered stiffness, and whether `derate` reduced it.
    """

    rig: str
    require: str
    verdicts: Mapping[str, Verdict]
    elements: tuple[Element, ...]
    loops: tuple[PairLoop, ...]
    walls: Mapping[str, Mapping[str, Any]]

    @property
    def passed(self) -> bool:
        """Whether the required verdict holds."""
        return self.verdicts[self.require].passed

    def sentences(self) -> list[str]:
        """Return why the required verdict fails, each with its remedy; empty if it holds."""
        if self.passed:
            return []
        if self.require == "coupled_stable":
            return [loop.verdict.reason for loop in self.loops if not loop.verdict.passed]
        reasons = []
        for element in self.elements:
            verdict = getattr(element, self.require)
            if not verdict.passed:
                reasons.append(verdict.reason)
        return reasons

    def as_dict(self) -> dict[str, Any]:
        """Return plain data for JSON, None where a number is not finite."""
        data: dict[str, Any] = json_ready(
            {
                "passed": self.passed,
                "state": self.verdicts[self.require].state,
                "require": self.require,
                "verdicts": {name: verdict.as_dict() for name, verdict in self.verdicts.items()},
                "sentences": self.sentences(),
                "elements": [element.as_dict() for element in self.elements],
                "loops": [loop.as_dict() for loop in self.loops],
                "walls": {axis: dict(wall) for axis, wall in self.walls.items()},
            }
        )
        return data


def join_verdicts(verdicts: Iterable[Verdict], passing: str) -> Verdict:
    """Return the verdict that passes if all do; `passing` is then its reason."""
    every = list(verdicts)
    failing = [verdict.reason for verdict in every if not verdict.passed]
    if failing:
        more = f" (and {len(failing) - 1} more)" if len(failing) > 1 else ""
        return Verdict(False, failing[0] + more)
    conditions = tuple(dict.fromkeys(c for verdict in every for c in verdict.conditions))
    return Verdict(True, passing, conditions)
