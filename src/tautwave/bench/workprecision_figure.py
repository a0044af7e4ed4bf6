"""Work-precision diagrams: CPU time per simulated second over error, one panel a scene."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tautwave.bench.workprecision_points import Point, Scene, pareto
from tautwave.report import canvas

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLES: dict[str, tuple[str, str]] = {
    "exact": (canvas.INK, "D"),
    "discrete_gradient": (canvas.MASTER, "o"),
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
    figure, panels = canvas.panels(
        [3.5] * len(scenes), "Error against run time, by scheme and step", False
    )
    for axes, scene in zip(panels, scenes, strict=True):
        _draw(axes, scene, "error")
        front = pareto(point for point in scene.points if not point.peer)
        _stairs(axes, front)
        axes.axvline(max_error, color=canvas.SOFT, linewidth=1.0, linestyle=":")
        axes.text(
            max_error,
            0.03,
            "wanted",
            rotation=90,
            ha="right",
            va="bottom",
            transform=axes.get_xaxis_transform(),
            color=canvas.SOFT,
            fontsize=8.5,
        )
        at = scene.chosen
        if at is not None:
            star: Any = {"markersize": 17, "markeredgecolor": canvas.INK, "zorder": 6}
            label = f"{scene.label}:\n{at.method}"
            axes.plot(max(at.error, SMALLEST), at.cpu_s, "*", color="#F0E442", label=label, **star)
        axes.set_ylabel("CPU s per simulated s")
        axes.set_xlabel("error (see the table of the scene)")
        _finish(axes, scene)
    return figure


def energy_figure(scenes: Sequence[Scene]) -> Figure:
    """Return the energy that each scheme made or took, over its step or tolerance."""
    scenes = [scene for scene in scenes if any(_place(p, "energy") for p in scene.points)]
    figure, panels = canvas.panels(
        [3.1] * len(scenes), "Energy made or taken by the scheme, by step", False
    )
    for axes, scene in zip(panels, scenes, strict=True):
        _draw(axes, scene, "energy")
        axes.set_xlabel("step [s], or the tolerance of a method that takes its own steps")
        axes.set_ylabel("share of the energy")
        axes.set_ylim(SMALLEST / 3.0, GREATEST)
        _finish(axes, scene)
    return figure


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
            markersize=5,
            markerfacecolor="white" if peer else colour,
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
            color="#9AA5AD",
            linewidth=5.0,
            alpha=0.5,
            zorder=1,
            label="Pareto front\nof tautwave",
        )


def _finish(axes: Axes, scene: Scene) -> None:
    lowest, highest = axes.get_ylim()
    if axes.get_ylabel().startswith("CPU"):
        axes.axhline(1.0, color="#B00020", linewidth=1.4)
        axes.set_ylim(0.6 * lowest, max(highest, 3.0))
        axes.text(
            0.995,
            1.0,
            "real time on one core ",
            color="#B00020",
            fontsize=8.5,
            va="bottom",
            ha="right",
            transform=axes.get_yaxis_transform(),
        )
        axes.set_xlim(SMALLEST / 3.0, GREATEST)
    what = scene.what
    for end in ("; error", ", all rows", " (scene"):
        what = what.split(end)[0]
    canvas.heading(axes, f"{scene.name}: {what}")
    canvas.legend(axes)
