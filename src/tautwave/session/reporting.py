"""The end of a run: its summary and report, whether they are complete, and the exit code."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Literal

from tautwave.controller.stops import StopPlace
from tautwave.errors import (
    ConfigError,
    DeviceFault,
    NotCertifiedError,
    RecordingError,
    TautwaveError,
    WritingError,
)
from tautwave.rig import Assembly
from tautwave.runtime.interrupts import interrupts
from tautwave.runtime.loop import LoopResult
from tautwave.runtime.recorder import RecorderStats
from tautwave.runtime.unwatched import may_be_enabled
from tautwave.summary import (
    Summary,
    read_summary,
    with_unwritten_report,
    write_summary,
)
from tautwave.summary.model import Outcome, Recording

REPORT_TIMEOUT_S = 600.0
SAFELY = "; all axes stopped safely"


def recording_of(stats: RecorderStats) -> Recording:
    """Return the summary's entry on its recording."""
    return Recording(
        rows_offered=stats.rows_offered,
        rows_written=stats.rows_written,
        rows_dropped=stats.rows_dropped,
        bytes=stats.bytes,
        error=stats.error,
    )


def report_run(
    directory: Path, summary: Summary, exit_code: int, draw_later: bool = False
) -> tuple[Summary, int]:
    """Write the summary, then have another process complete it and draw the report.

    NumPy arrays of an hour and matplotlib stay out of the process that moved the motors. Nothing is
    raised: the run is over, and `incomplete` in the summary says what could not be saved. With
    `draw_later` the run is judged when this returns, and a process that goes on draws.

    Returns
    -------
    tuple
        The summary, and the exit code of the whole run.
    """
    lost, reason, no_room = "", "", False
    try:
        write_summary(directory, summary)
        reason, no_room = _complete(directory, *(["--judge"] if draw_later else []))
        if not reason:
            summary, _ = read_summary(directory)
    except (WritingError, RecordingError, ConfigError) as err:
        lost = str(err)
        if not directory.is_dir():
            lost = f"{directory} was removed during the run, and its recording is gone with it"
    incomplete = "; ".join(filter(None, (lost_rows(summary.recording), lost))) or None
    summary = summary.model_copy(update={"incomplete": incomplete})
    if reason:
        summary = with_unwritten_report(summary, reason, no_room)
    with suppress(WritingError):
        write_summary(directory, summary)
    if draw_later and not reason:
        _draw_alone(directory)
    invalidated = summary.certificate.after_run.invalidated
    return summary, final_code(exit_code, invalidated, bool(incomplete))


def outcome_of(result: LoopResult, assembly: Assembly) -> tuple[Outcome, int]:
    """Return how the run ended, and the exit code.

    `kind` and `sentence`; of one that was stopped also when (`at_s`), on which axis (None: on
    none) and the `reason` in a word, as `controller.stops` has them. A device that may still be
    enabled ends the sentence, and its exit code goes before all others.
    """
    seconds = (result.cycles + result.missed_cycles) * assembly.control.run.period_ns * 1e-9
    enabled = may_be_enabled(bus.driver for bus in assembly.buses)
    outcome, exit_code = _ended(result, assembly, seconds, "" if enabled else SAFELY)
    if not enabled:
        return outcome, exit_code
    axis = next(name for bus in assembly.buses for name in bus.driver.unconfirmed)
    stop = StopPlace(seconds, axis, "fault")._asdict()
    sentence = f"{outcome.sentence}; {enabled}"
    stated = outcome.model_dump(exclude_unset=True)
    update = {**stop, **stated, "kind": "fault", "sentence": sentence}
    return Outcome.model_validate(update), DeviceFault.exit_code


def _ended(
    result: LoopResult, assembly: Assembly, seconds: float, safely: str
) -> tuple[Outcome, int]:
    """Return how the loop ended, and its exit code; `safely` if all devices are known to be off."""
    error = result.error
    interrupted = Outcome(kind="interrupted", sentence=f"stopped by the user at {seconds:g} s")
    if error is None:
        ended = getattr(assembly.control, "ended", "") or f"completed, {seconds:g} s"
        return interrupted if result.interrupted else Outcome(kind="finished", sentence=ended), 0
    if isinstance(error, KeyboardInterrupt):
        return interrupted, 0
    if isinstance(error, TautwaveError):
        return _stopped(
            "safety_stop" if error.exit_code == 6 else "fault",
            str(error),
            result.stop or StopPlace(seconds, "", "fault"),
        ), error.exit_code
    where = error.__traceback__
    while where is not None and where.tb_next is not None:
        where = where.tb_next
    place = ""
    if where is not None:
        place = f" ({Path(where.tb_frame.f_code.co_filename).name}:{where.tb_lineno})"
    sentence = f"{type(error).__name__}: {error}{place}{safely}"
    return _stopped("fault", sentence, StopPlace(seconds, "", "error")), 5


def _stopped(kind: Literal["safety_stop", "fault"], sentence: str, stop: StopPlace) -> Outcome:
    return Outcome(
        kind=kind, sentence=sentence, at_s=stop.at_s, axis=stop.axis or None, reason=stop.reason
    )


def final_code(exit_code: int, invalidated: bool, incomplete: bool) -> int:
    """Return the exit code of a run: a safety stop, a fault and a broken certificate outrank 7."""
    if exit_code == 0 and invalidated:
        return NotCertifiedError.exit_code
    if exit_code == 0 and incomplete:
        return WritingError.exit_code
    return exit_code


def lost_rows(recording: Recording) -> str:
    """Return what is missing from a run's recording; '' if nothing is."""
    written, read = recording.rows_written, recording.rows_read
    reason = ""
    if recording.error:
        reason = recording.error
    elif recording.rows_dropped:
        reason = (
            f"{recording.rows_dropped} of {recording.rows_offered} rows were dropped "
            "because the writer fell behind"
        )
    elif read is not None and read != written:
        reason = f"{read} of the {written} rows that were written can be read back"
    elif recording.truncated:
        reason = "its end is missing"
    return f"the recording is incomplete: {reason}" if reason else ""


def _draw_alone(directory: Path) -> None:
    """Start a process that draws the report and outlives this one and its terminal."""
    command = [sys.executable, "-m", "tautwave.report", "--draw", str(directory)]
    silent = [(os.POSIX_SPAWN_OPEN, at, os.devnull, os.O_RDWR, 0) for at in (0, 1, 2)]
    os.posix_spawn(command[0], command, os.environ, file_actions=silent, setsid=True)


def _complete(directory: Path, *options: str) -> tuple[str, bool]:
    """Write the run's report; return why it failed, and whether for lack of space.

    '' means that the report was written.
    """
    command = [sys.executable, "-m", "tautwave.report", *options, str(directory)]
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
