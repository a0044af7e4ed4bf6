"""The still figure of a scene: positions, force on the device, energies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from tautwave.canvas import (
    DAMPER,
    FILTER,
    INK,
    LINE,
    MASTER,
    SLAVE,
    SOFT,
    WALL,
    heading,
    panels,
    plain,
)
from tautwave.canvas import legend as draw_legend
from tautwave.report.figures.envelope import Floats
from tautwave.report.units import scale_for
from tautwave_scenes.report.sound import output_signal
from tautwave_scenes.report.view import SceneView

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tautwave_scenes.report3d.view import View3d

AXES = ((MASTER, "-"), (WALL, "--"), (DAMPER, "-."))
"""Colours of up to three axes of a device."""
HELD = ("-", "--", "-.", ":")
"""Line styles of what the hand holds, where it holds several."""

MAX_POINTS = 3000
_STYLE = {
    "kinetic": (MASTER, "kinetic"),
    "stored": (SLAVE, "stored in links"),
    "lifted": (WALL, "lifted"),
    "lost": (DAMPER, "lost"),
    "made": (LINE, "fed"),
    "port_work": (INK, "from the devices"),
    "pumped": (FILTER, "from external forces"),
    "hold": (SOFT, "hold and limits"),
}


def thin(*series: Floats) -> list[Floats]:
    """Return the extremes of every stretch, so that no peak is lost."""
    count = len(series[0])
    if count <= MAX_POINTS:
        return list(series)
    step = -(-count // (MAX_POINTS // 2))
    rows = np.arange(0, count // step * step).reshape(-1, step)
    lead = series[-1][rows]
    at = np.sort(
        np.stack([rows[:, 0] + lead.argmin(axis=1), rows[:, 0] + lead.argmax(axis=1)], axis=1)
    ).ravel()
    return [values[at] for values in series]


def scene_figure(view: SceneView) -> Figure:
    """Return the figure: positions, effort and sound, energies, and the scene at its liveliest."""
    figure, (place, effort, heard, energy) = panels([2.0, 1.3, 1.1, 1.6], "The scene")
    _positions(place, view)
    draw_efforts(effort, view.time, view.efforts)
    draw_heard(heard, view)
    draw_energies(energy, view)
    return figure


def draw_efforts(
    axes: Axes, time: Floats, efforts: Mapping[str, Floats], what: str = "Force"
) -> None:
    """Draw the force or torque on axes."""
    peak = max((float(np.abs(values).max()) for values in efforts.values()), default=0.0)
    factor, unit = scale_for(peak, "N" if what == "Force" else "N m")
    for at, (name, values) in enumerate(efforts.items()):
        shown_at, shown = thin(time, values)
        colour, style = AXES[at % 3]
        axes.plot(shown_at, factor * shown, style, color=colour, linewidth=1.0, label=plain(name))
    axes.set_ylabel(f"effort [{unit}]")
    heading(axes, f"{what} on the device, resisting")
    draw_legend(axes)


def draw_heard(axes: Axes, view: SceneView | View3d) -> None:
    """Draw the sound: the force on the device, high-passed."""
    signal = output_signal(view)
    factor, unit = scale_for(float(np.abs(signal).max()) if len(signal) else 0.0, "N")
    time, shown = thin(view.time, signal)
    axes.plot(time, factor * shown, color=LINE, linewidth=0.6)
    axes.set_ylabel(f"effort [{unit}]")
    heading(axes, "Sound: the same, high-passed")


def _positions(axes: Axes, view: SceneView) -> None:
    fixed = {name for name, _ in view.network.grounds}
    used = {end for link in view.network.links for end in (link.a, link.b)}
    peak = max(float(np.abs(values).max()) for name, values in view.at.items() if name in used)
    factor, unit = scale_for(peak, "m")
    masses = [name for name in view.at if name not in fixed and name not in view.network.ports]
    for at, name in enumerate(masses):
        time, shown = thin(view.time, view.at[name])
        label = f"{len(masses)} masses" if len(masses) > 1 else name
        axes.plot(
            time,
            factor * shown,
            color=SLAVE,
            linewidth=0.7 if len(masses) > 1 else 1.2,
            label=label if at == 0 else None,
        )
    for at, name in enumerate(view.network.ports):
        time, shown = thin(view.time, view.at[name])
        label = f"{name}, in the hand"
        style = HELD[at % len(HELD)]
        axes.plot(time, factor * shown, style, color=MASTER, linewidth=1.8, label=label)
    for name in sorted(fixed & used):
        axes.axhline(factor * float(view.at[name][0]), color=SOFT, linewidth=1.2, label=name)
    axes.set_ylabel(f"position [{unit}]")
    heading(axes, "Positions")
    draw_legend(axes)


def draw_energies(
    axes: Axes, view: SceneView | View3d, since_start: tuple[str, ...] = ("lifted",)
) -> None:
    """Draw the energy sources; some are relative to their initial value."""
    styled = {name: values for name, values in view.energies.items() if name in _STYLE}
    peak = max((float(np.abs(values - values[0]).max()) for values in styled.values()), default=0.0)
    factor, unit = scale_for(peak, "J")
    for name, values in styled.items():
        if np.abs(values - values[0]).max() <= 1e-6 * peak:
            continue
        colour, label = _STYLE[name]
        start = values[0] if name in since_start else 0.0
        time, shown = thin(view.time, values - start)
        axes.plot(time, factor * shown, color=colour, linewidth=1.2, label=label)
    axes.set_ylabel(f"energy [{unit}]")
    axes.set_xlabel("time [s]")
    heading(axes, "Energy: sources and stores")
    draw_legend(axes)
