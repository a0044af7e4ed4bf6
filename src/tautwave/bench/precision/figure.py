"""Work-precision diagrams: CPU time per simulated second over error, one panel a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tautwave import canvas
from tautwave.bench.precision.points import Point, Scene, pareto

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES: dict[str, tuple[str, str]] = {
    "exact": (canvas.INK, "D"),
    "discrete_gradient": (canvas.MASTER, "o"),
    "linearly_implicit": (canvas.LINE, "h"),
    "symplectic_euler": (canvas.SLAVE, "s"),
    "implicit_midpoint": (canvas.WALL, "^"),
    "rk4": (canvas.LINE, "v"),
    "dormand_prince": (canvas.FILTER, "P"),
    "scipy DOP853": (canvas.SOFT, ">"),
    "scipy Radau": (canvas.SOFT, "D"),
    "python-control": (canvas.SOFT, "*"),
    "MuJoCo Euler": (canvas.DAMPER, "s"),
    "MuJoCo RK4": (canvas.DAMPER, "v"),
    "MuJoCo implicit": (canvas.DAMPER, "^"),
}
SMALLEST, GREATEST = 1e-17, 3.0
"""Errors beyond these are drawn at the panel's edge, or not at all where the method exploded."""


def error_figure(scenes: Sequence[Scene], max_error: float) -> Figure:
    """Return CPU time over error, with Pareto front, chosen point and real-time limit."""
    figure, panels = _grid(scenes, "CPU time per simulated second over error, by scheme and step")
    for axes, scene in zip(panels, scenes, strict=False):
        _draw(axes, scene, "error")
        front = pareto(point for point in scene.points if not point.peer)
        _stairs(axes, front)
        style: Any = {"color": canvas.SOFT, "linewidth": 1.2, "linestyle": ":"}
        axes.axvline(max_error, label=f"error wanted, {max_error:g}", **style)
        axes.axhline(1.0, color=canvas.LIMIT, linewidth=1.2, label="real time on one core")
        at = scene.chosen
        if at is not None:
            star: Any = {"markersize": 13, "markeredgecolor": canvas.INK, "zorder": 6}
            place = max(at.error, SMALLEST), at.cpu_s
            colour = canvas.DAMPER
            axes.plot(*place, "*", color=colour, linestyle="", label="chosen point", **star)
        _finish(axes, scene, "error", "CPU s per s")
    return figure


def energy_figure(scenes: Sequence[Scene]) -> Figure:
    """Return the energy that each scheme created or lost, over its step or tolerance."""
    scenes = [scene for scene in scenes if any(_place(p, "energy") for p in scene.points)]
    figure, panels = _grid(scenes, "Energy created or lost by the scheme, by step or tolerance")
    for axes, scene in zip(panels, scenes, strict=False):
        _draw(axes, scene, "energy")
        _finish(axes, scene, "step [s] or tolerance", "share of energy")
    return figure


def _grid(scenes: Sequence[Scene], title: str) -> tuple[Figure, list[Axes]]:
    """Return panels beside and below each other, with one legend for all of them."""
    columns = 1 if len(scenes) == 1 else 2 if len(scenes) <= 4 else 3
    rows = max(1, -(-len(scenes) // columns))
    height = {1: 3.6, 2: 2.2, 3: 1.7}[columns]
    figure, panels = canvas.panels([height] * rows, title, False, columns=columns)
    for axes in panels[len(scenes) :]:
        axes.set_axis_off()
    canvas.key(figure)
    return figure, panels


def _draw(axes: Axes, scene: Scene, what: str) -> None:
    axes.set_xscale("log")
    axes.set_yscale("log")
    for method in dict.fromkeys(point.method for point in scene.points):
        points = [point for point in scene.points if point.method == method]
        pairs = [_place(point, what) for point in points]
        shown = [pair for pair in pairs if pair is not None]
        if not shown:
            continue
        colour, mark = STYLES.get(method, (canvas.SOFT, "."))
        peer = points[0].peer
        axes.plot(
            [pair[0] for pair in shown],
            [pair[1] for pair in shown],
            color=colour,
            marker=mark,
            linestyle=":" if peer else "-",
            linewidth=1.0 if peer else 1.3,
            markersize=4,
            markerfacecolor=canvas.PAPER if peer else colour,
            label=method,
        )


def _place(point: Point, what: str) -> tuple[float, float] | None:
    if what == "error":
        if not point.error < GREATEST:
            return None
        return max(point.error, SMALLEST), point.cpu_s
    if not point.energy_error < GREATEST or math.isnan(point.energy_error):
        return None
    return point.step_s, max(point.energy_error, SMALLEST)


def _stairs(axes: Axes, front: Sequence[Point]) -> None:
    """Draw the Pareto front: what an error costs at least; below and to the left is nothing."""
    shown = [point for point in front if point.error < GREATEST]
    if shown:
        axes.step(
            [GREATEST, *(max(point.error, SMALLEST) for point in shown)],
            [shown[0].cpu_s, *(point.cpu_s for point in shown)],
            where="pre",
            color=canvas.BAND,
            linewidth=5.0,
            alpha=0.5,
            zorder=1,
            label="Pareto front of tautwave",
        )


def _finish(axes: Axes, scene: Scene, across: str, up: str) -> None:
    from matplotlib.ticker import LogLocator, NullLocator

    for axis, ticks in ((axes.xaxis, 4), (axes.yaxis, 5)):
        axis.set_major_locator(LogLocator(numticks=ticks))
        axis.set_minor_locator(NullLocator())
    axes.margins(x=0.06, y=0.08)
    axes.set_xlabel(across)
    axes.set_ylabel(up)
    at = scene.chosen
    title = scene.name if at is None else f"{scene.name}; {scene.label}: {at.method}"
    canvas.heading(axes, canvas.plain(title.replace("_", " ")))
