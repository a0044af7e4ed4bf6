"""`python -m tautwave.report DIR`: complete a run's summary from its recording, draw the report.

`--judge` stops before the drawing and the replay for the run's precision. `--draw` does these of a
run that was judged, in the background: an error is put into the summary.
"""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from tautwave.errors import TautwaveError, WritingError

if TYPE_CHECKING:
    from tautwave.report.run.rundir import Run

LEAST = 19
"""Niceness of drawing in the background: the next run may move motors already."""


def main() -> int:
    """Judge the run in the directory that is named last, draw its report, or both."""
    from tautwave.report.run.complete import write_summary
    from tautwave.report.run.loading import load_run

    *options, directory = sys.argv[1:]
    if "--draw" in options:
        os.nice(LEAST)
        return draw_alone(Path(directory))
    try:
        run = load_run(Path(directory))
        judge(run)
        if "--judge" in options:
            write_summary(run)
        else:
            draw(run)
    except TautwaveError as err:
        sys.stderr.write(f"{err}\n")
        return err.exit_code
    return 0


def judge(run: Run) -> None:
    """Complete the summary: tracking, books, and whether the run kept its certificate."""
    from tautwave.report.run.after_run import recheck_run
    from tautwave.report.run.complete import complete_summary
    from tautwave.report.run.warnings import with_warnings

    for step in (complete_summary, recheck_run, with_warnings):
        run.result = step(run)


def draw(run: Run) -> None:
    """Replay a run that was judged, for its precision; write summary, page and files beside it."""
    from tautwave.report.arms.files import write_arms
    from tautwave.report.hooks import report_hooks
    from tautwave.report.precision.oracle import measure_precision
    from tautwave.report.run.complete import write_summary
    from tautwave.report.run.page import write_page

    run.result = measure_precision(run)
    write_summary(run)
    if run.ports:
        report_hooks().write_files(run)
    write_arms(run)
    write_page(run)


def draw_alone(directory: Path) -> int:
    """Draw; say in the summary why that failed."""
    from tautwave.report.run.loading import load_run
    from tautwave.summary import read_summary, with_unwritten_report, write_summary

    try:
        draw(load_run(directory))
    except Exception as err:  # noqa: BLE001  a traceback of this process is not seen
        reason = str(err) if isinstance(err, TautwaveError) else f"{type(err).__name__}: {err}"
        with suppress(TautwaveError):  # the directory was removed, or is full
            summary, _ = read_summary(directory)
            full = isinstance(err, WritingError)
            write_summary(directory, with_unwritten_report(summary, reason, full))
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
