"""Figures over several pairs, and of velocities near their limits, with the cause of a stop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tautwave.canvas import LIMIT, MASTER, SIDE, SLAVE, heading, key, legend, panels, plain
from tautwave.report.figures.canvas import draw, mark_stop
from tautwave.report.figures.envelope import peak, spread
from tautwave.report.run.views import PairView
from tautwave.report.units import quantity, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NEAR = 0.6
"""Share of its velocity limit above which an axis is shown with it."""

_DASHED = (0, (5, 1.5))


def overview_figure(views: Sequence[PairView]) -> Figure | None:
    """One row per pair: positions on the left, the transmitted effort on the right."""
    shown = [view for view in views if not is_flat(view)]
    if not shown:
        return None
    share = [True] * (2 * len(shown))
    figure, axes = panels([0.85] * len(shown), "All pairs", share, columns=2)
    for at, view in enumerate(shown):
        place, effort = axes[2 * at], axes[2 * at + 1]
        for panel, what, unit, word in (
            (place, "position", view.units["master"][0], "position"),
            (effort, "transmitted", view.units["master"][1], "effort"),
        ):
            lines = [view.lines.get(f"{side}.{what}") for side in SIDE]
            factor, label = scale_for(peak(*lines), unit)
            draw(panel, lines[0], factor, "master", color=MASTER, linewidth=1.1)
            draw(panel, lines[1], factor, "slave", color=SLAVE, linewidth=1.1, linestyle=_DASHED)
            mark_stop(panel, view.stop)
            heading(panel, f"{plain(view.name)}: {word} [{label}]")
            panel.locator_params(axis="y", nbins=4)
    for panel in axes[-2:]:
        panel.set_xlabel("time [s]")
    key(figure)
    return figure


def is_flat(view: PairView) -> bool:
    """Whether positions and transmitted efforts of a pair all stay flat."""
    places = [view.lines.get(f"{side}.position") for side in SIDE]
    efforts = [view.lines.get(f"{side}.transmitted") for side in SIDE]
    still = max((view.least.get(f"{side}.position", 0.0) for side in SIDE), default=0.0)
    return spread(*places) <= still and spread(*efforts) <= view.least.get("master.effort", 0.0)


def velocity_figure(view: PairView) -> Figure | None:
    """Velocities and their limits, if one came near its limit or the run was stopped."""
    sides = [side for side in SIDE if _is_fast(view, side)]
    if not sides:
        return None
    stop = view.stop
    near = stop is not None and stop.pair in ("", view.name) and "stop.master" in view.zoom
    figure, axes = panels([1.5] * (len(sides) + near), f"Velocity of {view.name}", False)
    for panel, side in zip(axes, sides, strict=False):
        line = view.lines[f"{side}.velocity"]
        factor, unit = scale_for(peak(line), f"{view.units[side][0]}/s")
        draw(panel, line, factor, side, color=SIDE[side], linewidth=1.1)
        _limits(panel, view, side, factor)
        mark_stop(panel, stop, reason=stop is not None and side == stop.side)
        heading(panel, f"Velocity of the {side} against its limit")
        panel.set_ylabel(f"velocity [{unit}]")
        panel.set_xlabel("time [s]")
        legend(panel)
    if near and stop is not None:
        _enlarged(axes[-1], view)
    return figure


def _is_fast(view: PairView, side: str) -> bool:
    line, limit = view.lines.get(f"{side}.velocity"), view.limits.get(f"{side}.velocity")
    if line is None or spread(line) == 0.0:
        return False
    stopped = view.stop is not None and view.stop.pair == view.name
    return stopped or (limit is not None and peak(line) > NEAR * limit)


def _limits(panel: Axes, view: PairView, side: str, factor: float) -> None:
    limit = view.limits.get(f"{side}.velocity")
    if limit is None or peak(view.lines[f"{side}.velocity"]) < 0.3 * limit:
        return  # far away, it would flatten the line
    caption = f"velocity limit, {quantity(limit, view.units[side][0] + '/s')}"
    for at in (-limit, limit):
        label = caption if at > 0 else "_"
        panel.axhline(factor * at, color=LIMIT, linewidth=1.1, linestyle="-.", label=label)


def _enlarged(panel: Axes, view: PairView) -> None:
    """The stopping axis, or both, around the stop."""
    assert view.stop is not None
    sides = [view.stop.side] if view.stop.side else list(SIDE)
    lines = {side: view.zoom[f"stop.{side}"] for side in sides if f"stop.{side}" in view.zoom}
    unit = f"{view.units[sides[0]][0]}/s"
    factor, label = scale_for(peak(*lines.values()), unit)
    for side, line in lines.items():
        draw(panel, line, factor, side, color=SIDE[side], marker=".", markersize=3)
        _limits(panel, view, side, factor)
    mark_stop(panel, view.stop)
    heading(panel, "The same around the stop")
    panel.set_ylabel(f"velocity [{label}]")
    panel.set_xlabel("time [s]")
    legend(panel)
