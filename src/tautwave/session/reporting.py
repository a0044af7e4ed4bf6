"""The end of a run: its summary and report, whether they are complete, and the exit code."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from tautwave.controller.stops import StopPlace
from tautwave.errors import DeviceFault, NotCertifiedError, TautwaveError, WritingError
from tautwave.files import json_ready, write_text
from tautwave.rig import Assembly
from tautwave.runtime.interrupts import interrupts
from tautwave.runtime.loop import LoopResult
from tautwave.runtime.recorder import RecorderStats
from tautwave.runtime.unwatched import may_be_enabled

REPORT_TIMEOUT_S = 600.0
SAFELY = "; all axes stopped safely"


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


def outcome_of(result: LoopResult, assembly: Assembly) -> tuple[dict[str, Any], int]:
    """Return how the run ended, and the exit code.

    `kind` and `sentence`; of one that was stopped also when (`at_s`), on which axis (None: on
    none) and the `reason` in a word, as `controller.stops` has them. A device that may still be
    enabled comes first in the sentence, and its exit code before all others.
    """
    seconds = (result.cycles + result.missed_cycles) * assembly.control.run.period_ns * 1e-9
    enabled = may_be_enabled(assembly.buses)
    outcome, exit_code = _ended(result, assembly, seconds, "" if enabled else SAFELY)
    if not enabled:
        return outcome, exit_code
    axis = next(name for bus in assembly.buses for name in bus.driver.unconfirmed)
    stop = StopPlace(seconds, axis, "fault")._asdict()
    sentence = f"{enabled}; before that: {outcome['sentence']}"
    return {**stop, **outcome, "kind": "fault", "sentence": sentence}, DeviceFault.exit_code


def _ended(
    result: LoopResult, assembly: Assembly, seconds: float, safely: str
) -> tuple[dict[str, Any], int]:
    """Return how the loop ended, and its exit code; `safely` if all devices are known to be off."""
    error = result.error
    if error is None:
        if result.interrupted:
            return {"kind": "interrupted", "sentence": f"stopped by the user at {seconds:g} s"}, 0
        ended = getattr(assembly.control, "ended", "")
        return {"kind": "finished", "sentence": ended or f"completed, {seconds:g} s"}, 0
    if isinstance(error, KeyboardInterrupt):
        return {"kind": "interrupted", "sentence": f"stopped by the user at {seconds:g} s"}, 0
    if isinstance(error, TautwaveError):
        kind = "safety_stop" if error.exit_code == 6 else "fault"
        stop = result.stop or StopPlace(seconds, "", "fault")
        stopped = {**stop._asdict(), "axis": stop.axis or None}
        return {"kind": kind, "sentence": str(error), **stopped}, error.exit_code
    where = error.__traceback__
    while where is not None and where.tb_next is not None:
        where = where.tb_next
    place = ""
    if where is not None:
        place = f" ({Path(where.tb_frame.f_code.co_filename).name}:{where.tb_lineno})"
    sentence = f"{type(error).__name__}: {error}{place}{safely}"
    stop = StopPlace(seconds, "", "error")
    return {"kind": "fault", "sentence": sentence, **stop._asdict(), "axis": None}, 5


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
