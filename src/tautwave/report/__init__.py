"""From a run's directory to tables, figures and one HTML page.

Figures and the page are imported when they are asked for, so that reading a recording or a number
costs no matplotlib.
"""

from __future__ import annotations

from pathlib import Path

__all__ = ["compare_reports", "write_report"]


def write_report(directory: Path) -> Path:
    """Write `report.html` and its figures into a run's directory; return the page's path.

    Raises
    ------
    RecordingError
        There is neither a summary nor a readable recording.
    """
    from tautwave.report import page

    return page.write_report(directory)


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
