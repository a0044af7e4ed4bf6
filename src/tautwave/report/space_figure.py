"""The still figure of a scene of points: how far all moved, what the device feels, the energies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tautwave.report.canvas import MASTER, SLAVE, heading, panels
from tautwave.report.canvas import legend as draw_legend
from tautwave.report.scene_figure import draw_efforts, draw_energies, thin
from tautwave.report.space_view import SpaceView
from tautwave.report.units import scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def space_figure(view: SpaceView) -> Figure:
    """Return the figure: heights of all points, efforts and sound, energies."""
    figure, (place, effort, energy) = panels([2.4, 1.7, 2.0], "The scene")
    _heights(place, view)
    draw_efforts(effort, view)
    draw_energies(energy, view, ("lifted", "stored"))
    return figure


def _heights(axes: Axes, view: SpaceView) -> None:
    masses = view.moving
    shown = [*masses, *(port.name for port in view.network.ports)]
    peak = max((float(np.nanmax(np.abs(view.at[name][:, 2]))) for name in shown), default=0.0)
    factor, unit = scale_for(peak, "m")
    for at, name in enumerate(masses):
        time, height = thin(view.time, view.at[name][:, 2])
        label = f"{len(masses)} masses" if len(masses) > 1 else name
        shade = 0.35 + 0.5 * at / max(len(masses), 1)
        axes.plot(
            time,
            factor * height,
            color=SLAVE,
            alpha=shade if len(masses) > 1 else 1.0,
            linewidth=0.7,
            label=label if at == 0 else None,
        )
    for port in view.network.ports:
        for c, style in zip("zxy", ("-", "--", ":"), strict=True):
            time, moved = thin(view.time, view.at[port.name][:, "xyz".index(c)])
            if c == "z" or np.ptp(moved) > 0.0:
                label = f"{port.name}.{c}, in the hand"
                axes.plot(time, factor * moved, style, color=MASTER, linewidth=1.4, label=label)
    axes.set_ylabel(f"height, position [{unit}]")
    heading(axes, "How high everything is (masses: z)")
    draw_legend(axes)
