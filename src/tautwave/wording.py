"""Messages of a part for `check` and the report; figures are SI."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.types import CommandDelay


class PlanLine(NamedTuple):
    """An element of a rig for `check`: whether it is in, why, and why not."""

    element: str
    used: bool
    why: str
    why_not: str = "not in the rig"


class Hint(tuple[str, str]):
    """Subject and sentence on what would be better, and the `key=value` that does it, if one does.

    Attributes
    ----------
    change : str
        For `--set`; "" where no single value does.
    """

    change: str

    def __new__(cls, subject: str, sentence: str, change: str = "") -> Hint:
        """Create one."""
        made = super().__new__(cls, (subject, sentence))
        made.change = change
        return made


def _no_lines(*_: Any) -> Sequence[PlanLine]:
    return ()


def _no_sentences(*_: Any) -> Sequence[tuple[str, str]]:
    return ()


def _law_of(rig: Any) -> str:
    return f"law {rig.coupling.law}, {rig.coupling.delay_s:g} s each way"


def _no_text(*_: Any) -> str:
    return ""


class Standing(NamedTuple):
    """Statics of a pair while both devices are held still.

    `offset`: offset between them per unit of effort held at the master [rad/(N m) or m/N, master];
    `held_share`: the share of the coupling's effort that they get [1]; `text` describes one of
    them; `cost` says what the offset is made of, and what a smaller one costs.
    """

    offset: float = 0.0
    held_share: float = 1.0
    text: str = ""
    cost: str = ""


def _no_standing(*_: Any) -> Standing:
    return Standing()


class CouplingMessages(NamedTuple):
    """Messages of a coupling for `check` and the report, without a full stop.

    `coupling(rig)` is one line; `plan(rig)` and `pair_plan(rig, name)` give its elements, in or
    left out; `facts(rig, delays)` and `hints(rig)` subject and sentence. `standing(rig, name,
    delays, tau)` is a `Standing`, tau [s] the one-way delay in all. Of a recording, `pair(settings,
    effort, position, number)` describes one pair from the keys in `rig.yaml`; `offset_caption` and
    `offset_cause` say what causes the steady-state offset ({delay} in the cause: only with one).
    """

    coupling: Callable[[Any], str] = _law_of
    plan: Callable[[Any], Iterable[PlanLine]] = _no_lines
    pair_plan: Callable[[Any, str], Iterable[PlanLine]] = _no_lines
    facts: Callable[[Any, Mapping[str, CommandDelay]], Iterable[tuple[str, str]]] = _no_sentences
    hints: Callable[[Any], Iterable[tuple[str, str]]] = _no_sentences
    standing: Callable[[Any, str, Mapping[str, CommandDelay], float], Standing] = _no_standing
    pair: Callable[[Mapping[str, Any], str, str, Callable[[Any], str]], str] = _no_text
    offset_caption: str = ""
    offset_cause: str = "its coupling"
