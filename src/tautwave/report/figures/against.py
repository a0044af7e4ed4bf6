"""A run over the recording that it is compared with, and what is between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tautwave.canvas import DAMPER, EDGE, INK, heading, legend, panels
from tautwave.report.against import Compared
from tautwave.report.figures.canvas import draw
from tautwave.report.figures.envelope import peak, trace
from tautwave.report.units import scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def against_figure(title: str, compared: Sequence[Compared]) -> Figure:
    """Return a panel for each quantity: as recorded, and as in the run."""
    figure, axes = panels([1.5] * len(compared), title)
    for panel, one in zip(axes, compared, strict=True):
        lines = trace(one.time_s, one.recorded), trace(one.time_s, one.ours)
        factor, unit = scale_for(peak(*lines), one.unit)
        for line, label, colour, width in zip(
            lines, ("recorded", "this run"), (INK, DAMPER), (2.0, 1.0), strict=True
        ):
            draw(panel, line, factor, label, color=colour, linewidth=width)
        heading(panel, one.name)
        panel.set_ylabel(f"[{unit}]" if unit else "")
        panel.axhline(0.0, color=EDGE, linewidth=0.8)
    legend(axes[0])
    axes[-1].set_xlabel("time [s]")
    return figure
