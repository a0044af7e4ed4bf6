"""What has happened in a run since it is watched: what a person looks for at the top of a page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from tautwave.config import Rig
from tautwave.runtime.operate.states import ENGAGED, FAULT, IDLE, LOST, REST, STATES, STOP
from tautwave.summary.model import Entry
from tautwave.summary.repeats import Collapsing, Repeated

STATE = "operation.state"
SILENCES = ("link.silence_s", ".link_silence")
"""How columns end that count time without a packet [s]."""

MAX_KINDS = 200
"""Kinds of entries that a page is given at first."""


def silence_of(rig: Rig) -> float | None:
    """Return the time without a packet from which on a rig's site counts as cut off [s]."""
    return None if rig.link is None else rig.link.silence_s


class SoFar:
    """Engaged time, faults, stops and moments without the other site, and the journal's kinds.

    Parameters
    ----------
    columns : sequence of str
        Of a row; the first is the time [s].
    silence_s : float or None
        Time without a packet from which on a site counts as cut off; None: no network.
    """

    def __init__(self, columns: Sequence[str], silence_s: float | None = None) -> None:
        self._state = columns.index(STATE) if STATE in columns else None
        silent = [k for k, name in enumerate(columns) if name.endswith(SILENCES)]
        self._silent = silent if silence_s is not None else []
        self._silence_s = silence_s or 0.0
        self._width = len(columns)
        self._from_s: float | None = None
        self._until_s = self._engaged_s = 0.0
        self._cut = self._faulted = False
        self._counts = {"faults": 0, "stops": 0, "cut_off": 0}
        self._cause: Entry | None = None
        self._seen = 0
        self._journal = Collapsing()
        self._new: dict[int, Repeated] = {}

    def take_rows(self, rows: Sequence[float]) -> None:
        """Count what the next rows show, one behind the other."""
        width = self._width
        times = rows[::width]
        if self._from_s is None:
            self._from_s = self._until_s = times[0]
        if self._state is not None:
            states = list(rows[self._state :: width])
            share = states.count(float(STATES.index(ENGAGED))) / len(states)
            self._engaged_s += share * (times[-1] - self._until_s)
        self._until_s = times[-1]
        if self._silent:
            for values in zip(*(rows[k::width] for k in self._silent), strict=True):
                cut = max(values) > self._silence_s
                self._counts["cut_off"] += cut and not self._cut
                self._cut = cut

    def take_news(self, entries: Iterable[tuple[int, dict[str, Any]]]) -> None:
        """Count what is new of the newest entries of the journal, each with its number."""
        for number, fields in entries:
            if number <= self._seen:
                continue
            self._seen = number
            entry = Entry(**fields)
            self._new |= self._journal.add(entry)
            if entry.refused:
                continue
            if entry.word == FAULT:
                self._counts["faults"] += 1
                self._cause = self._cause if self._faulted else entry
                self._faulted = True
            elif entry.word == REST and entry.state == IDLE:
                self._faulted, self._cause = False, None
            self._counts["stops"] += entry.word == STOP
            self._counts["cut_off"] += entry.word == LOST and not self._silent

    def take_new(self) -> list[list[Any]]:
        """Return the kinds of entries that are new or came again since the last call."""
        new, self._new = self._new, {}
        return _told(new)

    def kinds(self) -> list[list[Any]]:
        """Return the last kinds of entries: place, entry, how often, and when last [s]."""
        every = dict(enumerate(self._journal.kinds))
        return _told(dict(list(every.items())[-MAX_KINDS:]))

    def facts(self) -> dict[str, Any]:
        """Return the counts, and the first cause of what still has to be acknowledged."""
        return {
            "operated": self._state is not None,
            "from_s": self._from_s,
            "engaged_s": self._engaged_s,
            **self._counts,
            "faulted": self._faulted,
            "cause": None if self._cause is None else self._cause.model_dump(),
        }


def _told(kinds: dict[int, Repeated]) -> list[list[Any]]:
    return [[k, one.first.model_dump(), one.times, one.last_s] for k, one in kinds.items()]
