"""From a run's directory to tables, figures and one HTML page.

Figures and the page are imported on demand, so that reading a recording does not load matplotlib.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tautwave.errors import RecordingError, WritingError

if TYPE_CHECKING:
    from tautwave.canvas import Style

__all__ = ["compare_reports", "write_figures", "write_report"]


def write_report(directory: Path, *, replace: bool = True) -> Path:
    """Write `report.html` and its figures into a run's directory; return the page's path.

    Parameters
    ----------
    directory : Path
        Of the run.
    replace : bool
        False: a page is not replaced by one without figures, and a new one without is an error.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording, or the page that is there is kept.
    WritingError
        The page is written, but has only what the summary says.
    """
    from tautwave.report.run.loading import load_run
    from tautwave.report.run.page import PAGE, write_page

    run, path = load_run(Path(directory)), Path(directory) / PAGE
    lost = run.began and not run.rows and not replace
    if lost and path.is_file():
        raise RecordingError(f"{path}: not rebuilt. {' '.join(run.notes)}")
    write_page(run)
    if lost:
        raise WritingError(f"{path}: is incomplete. {' '.join(run.notes)}")
    return path


def write_figures(directory: Path, out: Path, kind: str, style: Style) -> list[Path]:
    """Write every figure of a run's report into `out` for a paper; return the paths.

    Parameters
    ----------
    kind : `pdf` or `svg`
    style : width, font size and family

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording, or `out` cannot be written.
    """
    from tautwave.report.run import page
    from tautwave.report.run.loading import load_run

    return page.write_figures(load_run(Path(directory)), out, kind, style)


def compare_reports(a: Path, b: Path, out: Path) -> Path:
    """Write a page that compares the runs in `a` and `b`; return its path.

    `out` is the page itself if its name ends in .html, else a directory to hold `compare.html`.

    Raises
    ------
    RecordingError
        One of them holds neither a summary nor a readable recording.
    """
    from tautwave.report import compare

    return compare.compare_reports(a, b, out)
