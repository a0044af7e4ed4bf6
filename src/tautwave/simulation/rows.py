"""Rows of a simulation, by the names of a recording's columns."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches

import numpy as np
import numpy.typing as npt

from tautwave.errors import TautwaveError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Simulation:
    """Rows of a simulation.

    Attributes
    ----------
    columns : tuple of str
        Names of the columns, those of a recording.
    data : ndarray
        One row per executed cycle, one column per name; SI.
    error : TautwaveError or None
        What ended it early: an exceeded limit, missing samples or slots.
    """

    columns: tuple[str, ...]
    data: Array
    error: TautwaveError | None

    def __getitem__(self, name: str) -> Array:
        """Return one column by name."""
        try:
            return self.data[:, self.columns.index(name)]
        except ValueError as err:
            near = get_close_matches(name, self.columns, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise KeyError(f"there is no column {name!r}{hint}") from err

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.data)
