"""Energy accounts over several sessions of a coupling: each session's own begin at 0 again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

_SUMMED = ("port_energy", "gross_flow", "uncertainty", "absorbed", "dissipated")


class Books:
    """What sessions that ended have left in the columns that count energy [J]."""

    def __init__(self, columns: Sequence[str]) -> None:
        places = {name: at for at, name in enumerate(columns)}
        self._left = {at: 0.0 for name, at in places.items() if name.rpartition(".")[2] in _SUMMED}
        self._stored = [
            (at, places[f"{name.rpartition('.')[0]}.dissipated"])
            for name, at in places.items()
            if name.endswith(".stored")
        ]

    def bank(self, row: Sequence[float]) -> None:
        """Keep the accounts of a session that ends; what is still stored is dissipated."""
        for at in self._left:
            self._left[at] += row[at]
        for stored, dissipated in self._stored:
            self._left[dissipated] += row[stored]

    def add(self, row: Any, at: int) -> None:
        """Add what earlier sessions left to a row whose columns begin at `at`."""
        for place, left in self._left.items():
            row[at + place] += left
