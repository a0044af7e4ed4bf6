"""Reading a run's directory: rig, summary and recording, as far as each of them is there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import yaml

from tautwave.errors import RecordingError
from tautwave.report.rebuild import rebuild_summary
from tautwave.report.rundir import WHOLE_CELLS, Run
from tautwave.report.scratch import spread_columns


def load_run(directory: Path) -> Run:
    """Read what a run left in `directory`, however little that is.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording.
    """
    notes: list[str] = []
    rig_text = _text(directory / "rig.yaml")
    summary = _summary(directory / "summary.json", notes)
    run = Run(directory, _rig(rig_text, notes), rig_text, summary, notes=notes)
    path = directory / "recording.mcap"
    try:
        _attach(run, path)
    except (RecordingError, OSError) as error:
        if not summary:
            raise RecordingError(
                f"{directory}: nothing to report on, no summary.json and no readable "
                f"recording.mcap ({error})"
            ) from error
        notes.append(f"There are no figures, because the recording cannot be read: {error}.")
    if not run.rig_text:
        notes.append("rig.yaml is missing: axes count as linear where the summary says nothing.")
    if run.truncated:
        notes.append(
            "The recording is cut short: its writer was stopped before it closed the file. "
            f"The {run.rows} rows that could be recovered are shown."
        )
    if not summary:
        run.summary = rebuild_summary(run)
        notes.append(
            "summary.json is missing, so the run ended before it could be written (a crash or a "
            "kill). The numbers here are rebuilt from the recording; what only the loop knew, "
            "such as device faults and why it ended, is not recorded."
        )
    return run


def _attach(run: Run, path: Path) -> None:
    from tautwave.report.recording import read_recording  # mcap only where there is a recording

    if not path.is_file():
        raise RecordingError(f"{path.name} is missing")
    found = read_recording(path, rows=slice(0, 1))
    run.columns, run.metadata = found.columns, found.metadata
    if "time_s" not in run.columns:
        raise RecordingError(f"{path.name} has no column time_s")
    clock = read_recording(path, ("time_s",))
    run.rows, run.truncated = len(clock), clock.truncated
    run.time = clock["time_s"].copy()
    if run.rows * len(run.columns) <= WHOLE_CELLS:
        run.whole = read_recording(path)
    else:
        run.scratch = spread_columns(path, run.columns, run.rows)
    if clock.damaged_chunks:
        run.notes.append(
            f"{clock.damaged_chunks} chunks of the recording are damaged and left out."
        )
    if clock.missing_rows > 0:
        run.notes.append(
            f"{clock.missing_rows} cycles between the first and the last row are not in the "
            "recording; figures draw straight lines across them."
        )
    if not run.rig_text and "rig.yaml" in found.attachments:
        run.rig_text = found.attachments["rig.yaml"].decode("utf-8", errors="replace")
        run.rig = _rig(run.rig_text, run.notes)
        run.notes.append("rig.yaml is missing; the copy inside the recording was used.")


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def _rig(text: str, notes: list[str]) -> dict[str, Any]:
    try:
        loaded = yaml.safe_load(text)
    except yaml.YAMLError as error:
        notes.append(f"rig.yaml is not valid YAML: {' '.join(str(error).split())}.")
        return {}
    return loaded if isinstance(loaded, dict) else {}


def _summary(path: Path, notes: list[str]) -> dict[str, Any]:
    try:
        loaded = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        notes.append(f"summary.json cannot be read: {error}.")
        return {}
    return loaded if isinstance(loaded, dict) else {}
