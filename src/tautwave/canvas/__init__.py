"""One style for all figures: colours, panels, and how they become bytes.

Reports, certificates, sweeps and benchmarks draw on these panels, so that all have the same look.
This package knows nothing of what is drawn; matplotlib is imported for the first figure.
"""

from __future__ import annotations

from tautwave.canvas.paint import alone, paper, png, save_figure, svg
from tautwave.canvas.palette import (
    BAND,
    CONTACTS,
    DAMPER,
    DARK,
    EDGE,
    FILTER,
    GRID,
    INK,
    LIMIT,
    LINE,
    MASTER,
    PAPER,
    PASSIVE,
    SHADE,
    SIDE,
    SLAVE,
    SOFT,
    STABLE,
    WALL,
    WALL_SHADE,
    dark_rules,
    element_style,
)
from tautwave.canvas.sheet import heading, key, legend, note, panels, plain, text_panel
from tautwave.canvas.style import PAGE, Style, find_font, styled

__all__ = [
    "BAND",
    "CONTACTS",
    "DAMPER",
    "DARK",
    "EDGE",
    "FILTER",
    "GRID",
    "INK",
    "LIMIT",
    "LINE",
    "MASTER",
    "PAGE",
    "PAPER",
    "PASSIVE",
    "SHADE",
    "SIDE",
    "SLAVE",
    "SOFT",
    "STABLE",
    "WALL",
    "WALL_SHADE",
    "Style",
    "alone",
    "dark_rules",
    "element_style", "find_font",
    "heading",
    "key",
    "legend",
    "note",
    "panels",
    "paper",
    "plain",
    "png",
    "save_figure",
    "styled",
    "svg",
    "text_panel",
]  # fmt: skip
