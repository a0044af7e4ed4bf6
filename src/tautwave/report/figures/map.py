"""The figure of a map: stiffness over another quantity; shading simulated, lines predicted."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.canvas import (
    EDGE,
    INK,
    MASTER,
    PAPER,
    PASSIVE,
    SLAVE,
    SOFT,
    STABLE,
    WALL,
    heading,
    legend,
    panels,
    plain,
    save_figure,
    text_panel,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

    from tautwave.analysis.maps.stability import Column, StabilityPlane
    from tautwave.sweep.map import MapPlan, MapResult, Plane

FILE = "map.png"
UNSTABLE = PAPER
SHOWN = 26
"""Number of markers of the simulated boundary along a panel; few enough to leave the line
visible."""


def write_map_figure(plan: MapPlan, result: MapResult, out: Path) -> Path:
    """Draw all planes into `out`/map.png, .svg and .pdf."""
    return save_figure(map_drawing(plan, result), out / FILE)


def map_drawing(plan: MapPlan, result: MapResult) -> Drawing:
    """Return the figure: a panel per plane, and the findings and assumptions as text."""
    from tautwave.sweep.map import QUANTISED, agreement_sentence

    rotary = plan.rig.axes[plan.file.axis].kind == "rotary"
    lines: list[tuple[str, str]] = []
    for name, plane in result.planes.items():
        text = f"{name}: {agreement_sentence(plane)}."
        lines.append((INK, text))
    lines += [(SOFT, note) for note in plan.file.notes]
    count = len(result.planes)
    title = plan.file.title or plan.file.name
    drawing, axes = panels([2.5] * count + [0.1], title, False)
    for panel, (name, plane) in zip(axes, result.planes.items(), strict=False):
        _draw(panel, plan.file.planes[name], plane, plan.starts[name], rotary=rotary)
    kinds = [plane.x in QUANTISED for plane in plan.file.planes.values()]
    for kind in set(kinds):
        legend(axes[kinds.index(kind)])
    text_panel(axes[-1], lines)
    return drawing


def _draw(axes: Axes, keys: Plane, plane: StabilityPlane, start: Column, *, rotary: bool) -> None:
    from matplotlib.colors import ListedColormap

    from tautwave.analysis.maps.stability import GROWING
    from tautwave.sweep.map import QUANTISED, operating_value

    quantised = keys.x in QUANTISED
    x = keys.factor * plane.x
    low, high = float(plane.stiffness[0]), float(plane.stiffness[-1])
    axes.set_xscale(keys.values.scale)
    axes.set_yscale(keys.stiffness.scale)
    stable = plane.growth <= GROWING
    ground = np.where(stable, np.where(plane.stiffness[:, None] <= plane.passive, 0, 1), 2)
    if quantised:
        ground = np.where(stable, 0, 2)
    colours = ListedColormap([PASSIVE, STABLE, UNSTABLE])
    axes.pcolormesh(
        x, plane.stiffness, ground, cmap=colours, vmin=0, vmax=2, shading="nearest", zorder=0.4
    )

    def inside(values: Any) -> Any:
        return np.where((values > 0.0) & np.isfinite(values), values, np.nan)

    proved = "greatest passive K,\npredicted" if quantised else "greatest passive K,\nproved"
    axes.plot(x, inside(plane.passive), color=WALL, linewidth=1.8, label=proved)
    _end_line(axes, x, plane.passive, low, WALL)
    if not quantised:
        _end_line(axes, x, plane.stable, low, MASTER)
        caption = "greatest stable K,\npredicted"
        axes.plot(x, inside(plane.stable), color=MASTER, linewidth=1.8, label=caption)
    edges = np.array([(a, b) for a, b, _ in plane.edges]).reshape(-1, 2)
    step = max(1, len(edges) // SHOWN)
    axes.plot(
        keys.factor * edges[::step, 0],
        edges[::step, 1],
        "o",
        color=SLAVE,
        markerfacecolor=PAPER,
        markeredgewidth=1.2,
        markersize=4.5,
        label="simulated motion\nbegins to gain" if quantised else "simulation begins\nto grow",
        zorder=3,
    )
    operating = start.wall.stiffness
    if low <= operating <= high:
        axes.plot(
            [keys.factor * operating_value(start, keys)],
            [operating],
            "*",
            color=INK,
            markersize=11,
            markeredgecolor=PAPER,
            label="the rig's wall",
            zorder=4,
            clip_on=False,
        )
    grounds = [
        (PASSIVE, "passive, any user"),
        (STABLE, "stable with this\nhand, not passive"),
        (UNSTABLE, "unstable"),
    ]
    if quantised:
        grounds = [
            (PASSIVE, "no motion gains energy"),
            (UNSTABLE, "a motion gains\nenergy each cycle"),
        ]
    for colour, label in grounds:
        axes.plot([], [], "s", color=colour, markeredgecolor=EDGE, markersize=9, label=label)
    axes.set_xlim(float(x[0]), float(x[-1]))
    axes.set_ylim(low, high)
    if keys.values.scale == "log":
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    heading(axes, plain(keys.title))
    axes.set_xlabel(plain(keys.label))
    axes.set_ylabel("stiffness K [N m/rad]" if rotary else "stiffness K [N/m]")


def _end_line(axes: Axes, x: Any, limit: Any, low: float, colour: str) -> None:
    """Let a limit drop out of the panel where it ends: on a log scale 0 is far below."""
    inside = np.flatnonzero(limit > 0.0)
    if not len(inside):
        return
    for at, step in ((int(inside[-1]), 1), (int(inside[0]), -1)):
        after = at + step
        if 0 <= after < len(limit):
            ends = [limit[at], 0.1 * low]
            axes.plot([x[at], x[after]], ends, color=colour, linewidth=1.8, zorder=1.9)
