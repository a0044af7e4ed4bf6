"""A run's rows in memory, as the report reads them: of a simulation, or of a stepped rig."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tautwave.config import Rig, resolved_yaml
from tautwave.recordings.recording import Recording
from tautwave.report.run.rundir import Run
from tautwave.simulation import Simulation
from tautwave.summary import plain_summary, summary_of


def run_of(rig: Rig, rows: Simulation, summary: dict[str, Any] | None = None) -> Run:
    """Return the run of a rig that left these rows; a summary like the loop's is the caller's."""
    text = resolved_yaml(rig)
    data = np.asfortranarray(rows.data)
    whole = Recording(rows.columns, data, {}, {}, False, 0, 0, {})
    return Run(
        Path(), yaml.safe_load(text), text, summary_of(summary or {})[0], rows.columns, len(data),
        whole=whole, time=data[:, 0],
    )  # fmt: skip


def put(run: Run, changes: dict[str, Any]) -> None:
    """Put values into the summary of a run, by block and key."""
    run.result, wrong = summary_of(_merged(plain_summary(run.result), changes))
    assert not wrong


def _merged(data: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    inner = {
        key: _merged(data.get(key, {}), value) for key, value in changes.items()
        if isinstance(value, dict)
    }  # fmt: skip
    return {**data, **changes, **inner}
