"""Turns the knobs between one row and the next: takes whole sets, ramps, records."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, cast

from tautwave.columns import Column
from tautwave.contracts import Row
from tautwave.runtime.tuning.desk import ParameterPage
from tautwave.runtime.tuning.knobs import Knob

RAMP_S = 0.2
GENERATION = Column("tuning.generation", "", "number of parameter sets applied so far")
TUNED = (
    GENERATION,
    Column("tuning.SIDE.AXIS.wall_stiffness", "N m/rad, N/m", "of the local wall, as it acts"),
    Column("tuning.SIDE.AXIS.wall_damping", "N m s/rad, N s/m", "of the local wall"),
    Column("tuning.SIDE.AXIS.wall_position", "rad, m", "of the local wall"),
    Column("tuning.SIDE.AXIS.effort_ceiling", "N m, N", "maximum effort of wall and coupling"),
    Column("tuning.PAIR.wave_filter_hz", "Hz", "corner of the filter in both ports"),
)
"""What is recorded of a rig that is tuned; a knob's column ends in the name of its key."""


class Change(NamedTuple):
    """A set that was taken at a time [s]: its number, and what it asks for, by path."""

    at_s: float
    number: int
    values: dict[str, float]


class Tuning:
    """A source of columns, the values that acted; after each row the next ones are set.

    Parameters
    ----------
    knobs : sequence of Knob
        What may be turned.
    desk : Desk
        Where sets come from.
    period_s : float
        Of the loop [s].
    note : callable
        Called with the time [s] and a sentence on each set.
    """

    def __init__(
        self,
        knobs: Sequence[Knob],
        desk: ParameterPage,
        period_s: float,
        note: Callable[[float, str], None] = lambda at_s, text: None,
    ) -> None:
        self.knobs = knobs
        self.desk = desk
        self.columns = [GENERATION.name, *(knob.column for knob in knobs)]
        self.changes: list[Change] = []
        self.note = note
        self._values = [knob.value for knob in knobs]
        self._goals = list(self._values)
        self._steps = [math.inf] * len(knobs)
        self._slots = max(1.0, RAMP_S / period_s)
        self._busy = False

    def fill(self, row: Row, at: int) -> None:
        """Write what acted in this cycle at index `at`; then turn."""
        row[at] = len(self.changes)
        at += 1
        for place, value in enumerate(self._values):
            row[at + place] = value
        values = self.desk.take()
        if values is not None:
            self._accept(values, cast("Sequence[float]", row)[0])
        if self._busy:
            self._turn()

    def _accept(self, goals: Sequence[float], at_s: float) -> None:
        """Begin to go to a set, unless a value of it is out of its range."""
        for knob, goal in zip(self.knobs, goals, strict=True):
            if not knob.low <= goal <= knob.high:
                span = f"{knob.low:g} to {knob.high:g} {knob.unit}"
                self.note(at_s, f"refused: {knob.path} is {span}")
                return
        changed = {
            knob.path: goal
            for knob, goal, value in zip(self.knobs, goals, self._goals, strict=True)
            if goal != value
        }
        self._goals = list(goals)
        self._steps = [
            abs(goal - value) / self._slots if knob.ramped else math.inf
            for knob, goal, value in zip(self.knobs, goals, self._values, strict=True)
        ]
        self._busy = True
        self.changes.append(Change(round(at_s, 9), len(self.changes) + 1, changed))
        text = ", ".join(f"{path} {value:g}" for path, value in changed.items())
        self.note(at_s, text or "unchanged")

    def _turn(self) -> None:
        """Bring every knob that may be turned now one step nearer."""
        self._busy = False
        for place, knob in enumerate(self.knobs):
            value, goal, step = self._values[place], self._goals[place], self._steps[place]
            if value == goal:
                continue
            self._busy = True
            if not knob.turning.ready(goal):
                continue
            near = abs(goal - value) <= step
            value = goal if near else value + math.copysign(step, goal - value)
            knob.turning.turn(value)
            self._values[place] = value

    def summary(self) -> list[dict[str, Any]]:
        """Return what was changed, for the summary."""
        return [change._asdict() for change in self.changes]
