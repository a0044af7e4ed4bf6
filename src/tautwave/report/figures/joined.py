"""Both sites of a session in one figure: their positions, and the error between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tautwave.canvas import EDGE, INK, MASTER, SLAVE, heading, legend, panels
from tautwave.report.figures.canvas import draw
from tautwave.report.figures.envelope import Floats, peak, trace
from tautwave.report.units import scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def joined_figure(
    pair: str, unit: str, times: Sequence[Floats], lines: Sequence[tuple[Floats, Floats]]
) -> Figure | None:
    """Draw positions of master and slave over the sessions that both recorded.

    Parameters
    ----------
    unit : of the positions, both in those of the master
    times : of the master's run, a session each [s]
    lines : the positions of master and slave at these
    """
    curves = [(time, *both) for time, both in zip(times, lines, strict=True) if both[0].size]
    if not curves:
        return None
    time, one, two = (
        np.concatenate([_ended(part) for part in parts]) for parts in zip(*curves, strict=True)
    )
    figure, (above, below) = panels((2.0, 1.4), f"Tracking of {pair}")
    master, slave, error = trace(time, one), trace(time, two), trace(time, one - two)
    factor, label = scale_for(peak(master, slave), unit)
    draw(above, master, factor, "master", color=MASTER)
    draw(above, slave, factor, "slave", color=SLAVE, linestyle=(0, (5, 1.5)))
    heading(above, "Position at both sites, slave in master units")
    above.set_ylabel(f"position [{label}]")
    legend(above)
    factor, label = scale_for(peak(error), unit)
    draw(below, error, factor, "master − slave", color=INK, linewidth=1.2)
    heading(below, "Position error, slot by slot")
    below.set_ylabel(f"error [{label}]")
    below.axhline(0.0, color=EDGE, linewidth=0.8)
    below.set_xlabel("time of the master's run [s]")
    return figure


def _ended(part: Floats) -> Floats:
    """Return the line of a session with a gap behind it."""
    return np.append(part, np.nan)
