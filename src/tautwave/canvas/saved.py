"""A figure as files: PNG to look at, and beside it SVG for pages and PDF for papers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tautwave.canvas.paint import alone, paper, png, svg
from tautwave.files import write_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: Path, title: str = "") -> Path:
    """Write a figure as PNG, and as SVG (light and dark) and PDF of the same name; return `path`.

    `title`: description of the SVG for screen readers; default: the name of the file.

    Raises
    ------
    WritingError
        A file cannot be written.
    """
    write_bytes(path, png(figure))
    drawn = alone(svg(figure, path.stem, title or path.stem.replace("-", " ")))
    write_bytes(path.with_suffix(".svg"), drawn.encode())
    write_bytes(path.with_suffix(".pdf"), paper(figure, "pdf"))
    return path
