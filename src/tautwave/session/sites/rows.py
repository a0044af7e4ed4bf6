"""The columns of one of two sites: its own half of a pair's, sums that go on over sessions."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import Row

SIDES = ("master", "slave")
SUMMED = (".port_energy", ".gross_flow", ".uncertainty", ".absorbed", ".dissipated")
"""Columns that go on over sessions; what was stored at the end of one counts as dissipated."""


BETWEEN = ("network", "credits")
"""Elements of a pair that both sites have a part of: what left less what came."""


class SiteRows:
    """What a site records of the rows of whole pairs.

    Attributes
    ----------
    names : list of str
        Its columns.
    whole : list of float
        A row of whole pairs, filled before `fill`.
    """

    def __init__(self, columns: Sequence[str], side: str) -> None:
        self._kept = kept_columns(columns, side)
        self.names = names = [columns[at] for at in self._kept]
        self.whole = [0.0] * len(columns)
        self._sums = [at for at, name in enumerate(names) if name.endswith(SUMMED)]
        # A stored column stands before its dissipated one.
        self._stores = [at for at, name in enumerate(names) if name.endswith(".stored")]
        self._delays = [at for at, name in enumerate(names) if name.endswith(".link_delay")]
        self._base = [0.0] * len(names)

    def fill(self, row: Row, at: int, shift: float) -> int:
        """Write the columns from index `at` on and return the next index.

        Delays are counted by both sites' slots, which differ by `shift` [s].
        """
        whole, base, kept = self.whole, self._base, self._kept
        for place, column in enumerate(kept):
            row[at + place] = whole[column] + base[place]
        for place in self._delays:
            row[at + place] = whole[kept[place]] - shift
        return at + len(base)

    def end_session(self) -> None:
        """Carry the accounts of a session that is over; what it stored is lost."""
        whole, base, kept = self.whole, self._base, self._kept
        for at in self._sums:
            base[at] += whole[kept[at]]
        for at in self._stores:
            base[at + 1] += whole[kept[at]]


def kept_columns(columns: Sequence[str], side: str) -> list[int]:
    """Return the places of the columns that are this side's, and of the pairs' networks."""
    places = []
    for at, name in enumerate(columns):
        parts = name.split(".")
        own_axis = parts[0] == side
        element = parts[1] if len(parts) == 3 else ""
        other = parts[0] in SIDES
        if own_axis or (not other and (element.endswith(f"_{side}") or element in BETWEEN)):
            places.append(at)
    return places
