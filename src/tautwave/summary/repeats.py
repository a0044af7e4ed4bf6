"""A journal without its repeats."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import NamedTuple

from tautwave.summary.model import Entry

NUMBER = re.compile(r"(?<![\w.])[-+−]?\d[\d.]*(?:e[-+]?\d+)?")
"""One that is no part of a name."""


class Repeated(NamedTuple):
    """An entry as it came first, how often it came, and when last [s]."""

    first: Entry
    times: int
    last_s: float


def collapsed(entries: Iterable[Entry]) -> list[Repeated]:
    """Return entries with repeats as one, where the first of them was.

    Faults and refusals count as repeats wherever they come, also with other numbers in their text;
    everything else where nothing is left between.
    """
    journal = Collapsing()
    for one in entries:
        journal.add(one)
    return journal.kinds


class Collapsing:
    """The same for entries that are still coming."""

    def __init__(self) -> None:
        self.kinds: list[Repeated] = []
        self._places: dict[tuple[object, ...], int] = {}
        self._last: tuple[object, ...] = ()

    def add(self, one: Entry) -> dict[int, Repeated]:
        """Take the next entry; return its kind, by the place among them."""
        event = one.severity == "note"
        text = NUMBER.sub("0", one.text) if event else one.text
        key = (one.word, one.source, one.state, text, one.refused)
        if key in self._places and (event or key == self._last):
            place = self._places[key]
            before = self.kinds[place]
            self.kinds[place] = before._replace(times=before.times + 1, last_s=one.at_s)
        else:
            place = self._places[key] = len(self.kinds)
            self.kinds.append(Repeated(one, 1, one.at_s))
        if not event:
            self._last = key
        return {place: self.kinds[place]}
