"""The end of a run: its summary and report, whether they are complete, and the exit code."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from tautwave.errors import NotCertifiedError, WritingError
from tautwave.files import json_ready, write_text
from tautwave.runtime.interrupts import interrupts
from tautwave.runtime.recorder import RecorderStats

REPORT_TIMEOUT_S = 600.0


def recording_block(stats: RecorderStats) -> dict[str, Any]:
    """Return the summary's entry on its recording."""
    return {
        "rows_offered": stats.rows_offered,
        "rows_written": stats.rows_written,
        "rows_dropped": stats.rows_dropped,
        "bytes": stats.bytes,
        "error": stats.error,
    }


def report_run(
    directory: Path, summary: dict[str, Any], exit_code: int
) -> tuple[dict[str, Any], int]:
    """Write the summary, then have another process complete it and draw the report.

    NumPy arrays of an hour and matplotlib stay out of the process that moved the motors. Nothing is
    raised: the run is over, and `incomplete` in the summary says what could not be saved.

    Returns
    -------
    tuple
        The summary, and the exit code of the whole run.
    """
    path = directory / "summary.json"
    summary = json_ready(summary)
    lost = ""
    try:
        write_text(path, _text(summary))
        reason, no_room = _complete(directory)
        if reason:
            summary["report_error"] = f"the report could not be written: {reason}"
            lost = summary["report_error"] if no_room else ""
        else:
            summary = json.loads(path.read_text(encoding="utf-8"))
    except WritingError as err:
        lost = str(err)
    summary["incomplete"] = "; ".join(filter(None, (lost_rows(summary), lost))) or None
    with suppress(WritingError):
        write_text(path, _text(summary))
    after = summary["certificate"].get("after_run", {})
    invalidated = bool(after.get("invalidated"))
    return summary, final_code(exit_code, invalidated, bool(summary["incomplete"]))


def final_code(exit_code: int, invalidated: bool, incomplete: bool) -> int:
    """Return the exit code of a run: a safety stop, a fault and a broken certificate outrank 7."""
    if exit_code == 0 and invalidated:
        return NotCertifiedError.exit_code
    if exit_code == 0 and incomplete:
        return WritingError.exit_code
    return exit_code


def lost_rows(summary: Mapping[str, Any]) -> str:
    """Return what is missing from a run's recording; '' if nothing is."""
    recording = summary["recording"]
    written, read = recording["rows_written"], recording.get("rows_read")
    reason = ""
    if recording["error"]:
        reason = recording["error"]
    elif recording["rows_dropped"]:
        reason = (
            f"{recording['rows_dropped']} of {recording['rows_offered']} rows were dropped "
            "because the writer fell behind"
        )
    elif read is not None and read != written:
        reason = f"{read} of the {written} rows that were written can be read back"
    elif recording.get("truncated"):
        reason = "its end is missing"
    return f"the recording is incomplete: {reason}" if reason else ""


def _complete(directory: Path) -> tuple[str, bool]:
    """Have the run's report written; return why it failed, and whether for lack of space.

    '' means that the report was written.
    """
    command = [sys.executable, "-m", "tautwave.report", str(directory)]
    again = f"run `tautwave report {directory}` to write it"
    try:
        with interrupts() as heard, heard.raised():
            # A separate session: this process decides when to end the report, not the terminal.
            child = subprocess.run(
                command,
                capture_output=True,
                text=True,
                timeout=REPORT_TIMEOUT_S,
                check=False,
                start_new_session=True,
            )
    except KeyboardInterrupt as err:
        return f"interrupted by {str(err) or 'Ctrl-C'}; {again}", False
    except subprocess.TimeoutExpired:
        return f"it took over {REPORT_TIMEOUT_S:g} s; {again}", False
    if child.returncode == 0:
        return "", False
    reason = (child.stderr.strip().splitlines()[-1:] or ["no reason given"])[0]
    return reason, child.returncode == WritingError.exit_code


def _text(summary: Mapping[str, Any]) -> str:
    return json.dumps(summary, indent=2, allow_nan=False) + "\n"
