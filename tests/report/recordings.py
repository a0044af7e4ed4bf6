"""A recording whose rows are known, written without a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tautwave.runtime.mcap_file import McapFile

# Interleaved on purpose: the message groups what belongs together, the row does not.
COLUMNS = (
    "time_s",
    "master.wrist.position",
    "slave.wrist.position",
    "master.wrist.wave_in",
    "wrist.position_error",
    "slave.wrist.wave_in",
    "wrist.line.absorbed",
    "true.master.wrist.position",
)
EPOCH_NS = 1_700_000_000_000_000_000


def slots(count: int, columns: int = len(COLUMNS), seed: int = 0) -> NDArray[np.float64]:
    """Rows as the ring holds them: time first, the cycle's number last."""
    rows = np.random.default_rng(seed).standard_normal((count, columns + 1))
    rows[:, 0] = np.arange(count) * 1e-3
    rows[:, -1] = np.arange(count)
    return rows


def write(path: Path, rows: NDArray[np.float64], columns: tuple[str, ...] = COLUMNS) -> McapFile:
    file = McapFile(
        str(path),
        columns,
        {"version": "1.2", "rate_hz": "1000.0"},
        {"rig.yaml": b"name: x\n"},
        EPOCH_NS,
    )
    for at in range(0, len(rows), file.rows_per_chunk):
        file.append(rows[at : at + file.rows_per_chunk])
    file.finish({"rows_written": str(len(rows))})
    file.close()
    return file


Sample = tuple[Path, NDArray[np.float64], int]
