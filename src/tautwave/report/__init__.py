"""From a run's directory to tables, figures and one HTML page.

Figures and the page are imported on demand, so that reading a recording does not load matplotlib.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tautwave.canvas import Style

__all__ = ["compare_reports", "write_figures", "write_report"]


def write_report(directory: Path) -> Path:
    """Write `report.html` and its figures into a run's directory; return the page's path.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording.
    """
    from tautwave.report.run.loading import load_run
    from tautwave.report.run.page import write_page

    return write_page(load_run(Path(directory)))


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
