"""The still figure of a 3D scene: displacements, force on the device, energies."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from tautwave.canvas import MASTER, SLAVE, heading, panels, plain
from tautwave.canvas import legend as draw_legend
from tautwave.report.units import scale_for
from tautwave_scenes.report.figure import AXES, HELD, draw_efforts, draw_energies, draw_heard, thin
from tautwave_scenes.report3d.view import View3d

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def figure3d(view: View3d) -> Figure:
    """Return the figure: heights, the device's path, efforts, sound and energies."""
    kinds = {name: view.rig.axes[f"master.{name}"].kind for name in view.efforts}
    turning = {name: one for name, one in view.efforts.items() if kinds[name] == "rotary"}
    moving = {name: one for name, one in view.efforts.items() if name not in turning}
    felt = [("Force", moving)] * bool(moving) + [("Torque", turning)] * bool(turning)
    figure, axes = panels([1.8, 1.3, *[1.3] * len(felt), 1.0, 1.6], "The scene")
    draw_heights(axes[0], view)
    draw_across(axes[1], view)
    for panel, (what, efforts) in zip(axes[2:], felt, strict=False):
        draw_efforts(panel, view.time, efforts, what)
    draw_heard(axes[-2], view)
    draw_energies(axes[-1], view, ("lifted", "stored"))
    return figure


def draw_heights(axes: Axes, view: View3d) -> None:
    """Draw the heights of the masses, and of what the hand holds."""
    masses = view.moving
    shown = [*masses, *(port.name for port in view.network.ports)]
    peak = max((float(np.nanmax(np.abs(view.at[name][:, 2]))) for name in shown), default=0.0)
    factor, unit = scale_for(peak, "m")
    for at, name in enumerate(masses):
        time, height = thin(view.time, view.at[name][:, 2])
        label = f"{len(masses)} masses" if len(masses) > 1 else plain(name)
        wide = 0.7 if len(masses) > 1 else 1.2
        label = label if at == 0 else "_"
        axes.plot(time, factor * height, color=SLAVE, linewidth=wide, label=label)
    for at, port in enumerate(view.network.ports):
        time, height = thin(view.time, view.at[port.name][:, 2])
        label = f"{plain(port.name)}, in the hand"
        style = HELD[at % len(HELD)]
        axes.plot(time, factor * height, style, color=MASTER, linewidth=1.8, label=label)
    axes.set_ylabel(f"height z [{unit}]")
    heading(axes, "Heights")
    draw_legend(axes)


def draw_across(axes: Axes, view: View3d) -> None:
    """Draw the path in the plane of what the hand holds: x and y by colour, several by style."""
    ports = [port.name for port in view.network.ports]
    peak = max((float(np.nanmax(np.abs(view.at[name][:, :2]))) for name in ports), default=0.0)
    factor, unit = scale_for(peak, "m")
    for which, name in enumerate(ports):
        for at, c in enumerate("xy"):
            time, moved = thin(view.time, view.at[name][:, at])
            colour, style = AXES[at]
            style = HELD[which % len(HELD)] if len(ports) > 1 else style
            label = f"{plain(name)}, {c}"
            axes.plot(time, factor * moved, style, color=colour, linewidth=1.2, label=label)
    axes.set_ylabel(f"position [{unit}]")
    heading(axes, "Path of the device in the plane")
    draw_legend(axes)
