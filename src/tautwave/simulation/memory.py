"""The live loop on the fake clock with its rows kept in memory: nothing is written to disk."""

from __future__ import annotations

from array import array
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from tautwave.rig import Assembly
from tautwave.runtime.loop import Loop, LoopResult


class KeptRows:
    """A sink that keeps every row in memory, packed."""

    def __init__(self, width: int) -> None:
        self.row = array("d", [0.0] * width)
        self.kept = array("d")

    @property
    def commit(self) -> Callable[[], object]:
        """Take the row."""
        return self._take

    def _take(self) -> None:
        self.kept.extend(self.row)


def run_in_memory(built: Assembly) -> tuple[LoopResult, npt.NDArray[np.float64]]:
    """Run a rig's loop without writing files; return its result and its rows."""
    sink = KeptRows(len(built.columns))
    loop = Loop(built.clock, built.buses, built.control, built.sources, sink)
    result = loop.run()
    for simulator in built.simulators:
        simulator.close()
    return result, np.array(sink.kept, dtype=np.float64).reshape(-1, len(built.columns))
