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


def run_of(rig: Rig, rows: Simulation, summary: dict[str, Any] | None = None) -> Run:
    """Return the run of a rig that left these rows; a summary like the loop's is the caller's."""
    text = resolved_yaml(rig)
    data = np.asfortranarray(rows.data)
    whole = Recording(rows.columns, data, {}, {}, False, 0, 0, {})
    return Run(
        Path(), yaml.safe_load(text), text, summary or {}, rows.columns, len(data),
        whole=whole, time=data[:, 0],
    )  # fmt: skip
