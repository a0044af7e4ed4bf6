"""Reading a run's directory: rig, summary and recording, as far as they exist."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tautwave import formats
from tautwave.config.guard import read_guarded
from tautwave.config.text.document import open_document
from tautwave.errors import ConfigError, RecordingError
from tautwave.report.run.rebuild import rebuild_summary
from tautwave.report.run.rundir import WHOLE_CELLS, Run
from tautwave.report.run.scratch import spread_columns
from tautwave.report.units import number
from tautwave.summary import Summary, checked, read_summary

LARGEST = 16 * 1024 * 1024
"""Bytes of rig.yaml: one of many pairs has some 100 kB."""

MAX_WRONG = 5
"""Values of a summary that are wrong and said to be."""

MISSING = (
    "summary.json is missing, so the run ended before it could be written (a crash or a kill)."
)


def load_run(directory: Path) -> Run:
    """Read the files of a run in `directory`, however few there are.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording, or the run is of a newer tautwave.
    """
    notes: list[str] = []
    directory = Path(directory)
    rig_text = _text(directory / "rig.yaml", notes)
    summary, broken = _summary(directory, notes)
    rig = _rig(rig_text, notes)
    newer = formats.too_new("rig", rig.get("format"), formats.RIG)
    if newer is not None:
        raise RecordingError(f"{directory / 'rig.yaml'}: format {newer}")
    run = Run(directory, rig, rig_text, summary or Summary(), notes=notes)
    path = directory / "recording.mcap"
    try:
        _attach(run, path)
    except (RecordingError, OSError) as error:
        if summary is None:
            lacks = f"{broken} and" if broken else "no summary.json and"
            raise RecordingError(
                f"{directory}: nothing to report: {lacks} no readable recording.mcap ({error})"
            ) from error
        if run.began:
            notes.append(f"There are no figures, because the recording cannot be read: {error}.")
        else:
            notes.append("The run ended before its first cycle, so nothing was recorded.")
    if not run.rig_text:
        notes.append(
            "rig.yaml is missing: axes are assumed linear unless the summary states otherwise."
        )
    if run.truncated:
        notes.append(
            "The recording is cut short: its writer stopped before closing the file. "
            f"The {run.rows} rows that could be recovered are shown."
        )
    if summary is None:
        run.result = checked(Summary, rebuild_summary(run))
        notes.append(
            f"{f'{broken}.' if broken else MISSING} The numbers here are rebuilt from the "
            "recording; what only the loop knew, such as device faults and the reason of the end, "
            "is lost."
        )
    return run


def _attach(run: Run, path: Path) -> None:
    from tautwave.recordings.recording import read_recording  # mcap only where there is a recording

    if not path.is_file():
        raise RecordingError(f"{path.name} is missing")
    recording = read_recording(path, rows=slice(0, 1))
    run.columns, run.metadata = recording.columns, recording.metadata
    if "time_s" not in run.columns:
        raise RecordingError(f"{path.name} has no column time_s")
    # A whole file says at its end how long it is, and is then read in one go.
    written = number(recording.ending.get("rows_written"))
    most = WHOLE_CELLS / len(run.columns)
    if written is not None and written <= most:
        clock = run.whole = read_recording(path)
    else:
        clock = read_recording(path, ("time_s",))
        if len(clock) <= most:
            run.whole = read_recording(path)
        else:
            run.scratch = spread_columns(path, run.columns, len(clock))
    run.rows, run.truncated = len(clock), clock.truncated
    run.time = clock["time_s"].copy()
    if clock.damaged_chunks:
        run.notes.append(
            f"{clock.damaged_chunks} chunks of the recording are damaged and were skipped."
        )
    if clock.missing_rows > 0:
        run.notes.append(
            f"{clock.missing_rows} cycles between the first and the last row are not in the "
            "recording; figures bridge them with straight lines."
        )
    if not run.rig_text and "rig.yaml" in recording.attachments:
        run.rig_text = recording.attachments["rig.yaml"].decode("utf-8", errors="replace")
        run.rig = _rig(run.rig_text, run.notes)
        run.notes.append("rig.yaml is missing; the copy inside the recording was used.")


def _text(path: Path, notes: list[str]) -> str:
    try:
        return read_guarded(path, "rig file", LARGEST)
    except ConfigError as error:
        if path.exists():
            notes.append(f"{_said(error, path)}.")
        return ""


def _rig(text: str, notes: list[str]) -> dict[str, Any]:
    """Return the rig file's content as far as it is readable; the run has checked it."""
    if not text:
        return {}
    try:
        document = open_document(text, "rig.yaml", Path())
    except ConfigError as error:
        notes.append(f"{error.problems[0]}.")
        return {}
    notes += [f"{problem}." for problem in document.sentences()[:1]]
    return document.value


def _summary(directory: Path, notes: list[str]) -> tuple[Summary | None, str]:
    """Return a run's summary, None where there is none that can be read; and why it cannot."""
    try:
        summary, wrong = read_summary(directory)
    except ConfigError as error:
        return None, str(error) if (directory / "summary.json").exists() else ""
    notes += [f"{one}." for one in wrong[:MAX_WRONG]]
    return summary, ""


def _said(error: ConfigError, path: Path) -> str:
    """Return an error without the path of the reported directory."""
    return str(error).replace(str(path), path.name, 1)
