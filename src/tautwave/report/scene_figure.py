"""The still figure of a scene: where everything is, what the device feels, where energy went."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from tautwave.report.canvas import (
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
)
from tautwave.report.canvas import legend as draw_legend
from tautwave.report.envelope import Floats
from tautwave.report.scene_drawing import draw_frame, still_png
from tautwave.report.scene_sound import output_signal
from tautwave.report.scene_view import SceneView
from tautwave.report.units import scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tautwave.report.space_view import SpaceView

MOST_POINTS = 3000
_STYLE = {
    "kinetic": (MASTER, "kinetic"),
    "stored": (SLAVE, "stored in links"),
    "lifted": (WALL, "lifted"),
    "lost": (DAMPER, "lost"),
    "made": (LINE, "fed"),
    "port_work": (INK, "from the devices"),
    "pumped": (FILTER, "from outside forces"),
    "hold": (SOFT, "hold and limits"),
}


def thin(*series: Floats) -> list[Floats]:
    """Return the extremes of every stretch, so that no peak is lost."""
    count = len(series[0])
    if count <= MOST_POINTS:
        return list(series)
    step = -(-count // (MOST_POINTS // 2))
    rows = np.arange(0, count // step * step).reshape(-1, step)
    lead = series[-1][rows]
    at = np.sort(
        np.stack([rows[:, 0] + lead.argmin(axis=1), rows[:, 0] + lead.argmax(axis=1)], axis=1)
    ).ravel()
    return [values[at] for values in series]


def scene_figure(view: SceneView) -> Figure:
    """Return the figure: positions, effort and sound, energies, and the scene at its liveliest."""
    figure, (place, effort, energy) = panels([2.4, 1.7, 2.0], "The scene")
    _positions(place, view)
    draw_efforts(effort, view)
    draw_energies(energy, view)
    return figure


def draw_efforts(axes: Axes, view: SceneView | SpaceView) -> None:
    """Draw what every axis feels, and what is heard."""
    for at, (name, values) in enumerate(view.efforts.items()):
        time, shown = thin(view.time, values)
        style = ("-", "--", ":")[at % 3]
        axes.plot(time, shown, style, color=MASTER, linewidth=0.9, label=f"{name}, resisting")
    time, shown = thin(view.time, output_signal(view))
    axes.plot(time, shown, color=SLAVE, linewidth=0.6, alpha=0.8, label="heard, high-passed")
    axes.set_ylabel("effort [N]")
    heading(axes, "What the device feels")
    draw_legend(axes)


def _positions(axes: Axes, view: SceneView) -> None:
    fixed = {name for name, _ in view.network.grounds}
    used = {end for link in view.network.links for end in (link.a, link.b)}
    peak = max(float(np.abs(values).max()) for name, values in view.at.items() if name in used)
    factor, unit = scale_for(peak, "m")
    masses = [name for name in view.at if name not in fixed and name not in view.network.ports]
    for at, name in enumerate(masses):
        time, shown = thin(view.time, view.at[name])
        shade = 0.35 + 0.5 * at / max(len(masses), 1)
        label = f"{len(masses)} masses" if len(masses) > 1 else name
        axes.plot(
            time,
            factor * shown,
            color=SLAVE,
            alpha=shade if len(masses) > 1 else 1.0,
            linewidth=0.8,
            label=label if at == 0 else None,
        )
    for name in view.network.ports:
        time, shown = thin(view.time, view.at[name])
        axes.plot(time, factor * shown, color=MASTER, linewidth=1.6, label=f"{name}, in the hand")
    for name in sorted(fixed & used):
        axes.axhline(factor * float(view.at[name][0]), color=SOFT, linewidth=1.2, label=name)
    axes.set_ylabel(f"position [{unit}]")
    heading(axes, "Where everything is")
    draw_legend(axes)


def draw_energies(
    axes: Axes, view: SceneView | SpaceView, since_start: tuple[str, ...] = ("lifted",)
) -> None:
    """Draw where the energy came from; some of it less what was there at the start."""
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
    heading(axes, "Where the energy came from, and where it is")
    draw_legend(axes)


def still(view: SceneView) -> bytes:
    """Return the scene at its liveliest row as PNG: a frame of the animation."""
    return still_png(view, partial(draw_frame, view))
