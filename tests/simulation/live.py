"""Rows of the live loop on the fake clock, and how they are held against those of a simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.simulation import Simulation, simulate
from tests.rigs.running import Run, run_rig

SHIPPED = sorted((Path(__file__).parents[2] / "configs").glob("*.yaml"))
# Rigs on a bus have rows of their driver's too; tests/rigs holds them against a loopback's. Scenes
# and arms run in the live loop only.
OTHERS = (
    *(f"driver: {name}" for name in ("canopen", "dynamixel", "feetech", "mit", "modbus")),
    "\nscene:",
    "\n  arm:\n",
)
CONFIGS = [path for path in SHIPPED if not any(word in path.read_text() for word in OTHERS)]
COMPILED_APART = ("network-loopback", "bench-position-coupling")
"""Rigs whose law is compiled for them alone, 20 s of processor time: with `-m slow`."""

Array = npt.NDArray[np.float64]


def live_run(rig: Rig, duration_s: float | None = None) -> Run:
    """Run the loop as it runs live; how it ended is in the result."""
    return run_rig(rig, raises=False, duration_s=duration_s)


def assert_same(live: Run, simulation: Simulation) -> None:
    """Every bit of every row, and the sentence it ended with."""
    assert simulation.columns == tuple(live.columns)
    assert simulation.data.shape == live.table.shape
    bits = simulation.data.view(np.uint64) == live.table.view(np.uint64)
    bits |= np.isnan(simulation.data) & np.isnan(live.table)
    if not bits.all():
        row, column = np.argwhere(~bits)[0]
        one, other = live.table[row, column], simulation.data[row, column]
        raise AssertionError(
            f"row {row}, {live.columns[column]}: {one!r} live, {other!r} simulated"
        )
    ended = live.result.error
    assert type(simulation.error) is type(ended)
    assert str(simulation.error) == str(ended)


def assert_equal(rig: Rig, *engines: str, duration_s: float | None = None) -> Run:
    """Run live and simulate with every engine."""
    live = live_run(rig, duration_s)
    for engine in engines:
        assert_same(live, simulate(rig, engine=engine, duration_s=duration_s))
    return live
