"""Two runs overlaid: errors, energies, timing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from tautwave.canvas import DAMPER, EDGE, INK, heading, legend, panels, plain
from tautwave.report.figures.canvas import draw
from tautwave.report.figures.envelope import Floats, Trace, peak, trace
from tautwave.report.run.rebuild import element_books
from tautwave.report.run.rundir import Run
from tautwave.report.units import scale_for

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = (INK, DAMPER)


class Overlay(NamedTuple):
    """One panel: a trace of each run (None where it has none), and their unit."""

    title: str
    unit: str
    lines: tuple[Trace | None, Trace | None]


def column_of(run: Run, column: str) -> Trace | None:
    """One recorded column as a trace."""
    read = run.read(column)
    if column not in read or run.time is None:
        return None
    return trace(run.time, read[column])


def energy_of(run: Run, pair: str, which: int) -> Trace | None:
    """Sum over the elements of `pair`: 0 absorbed, 1 stored, 2 dissipated [J]."""
    total: Floats | None = None
    for element in run.elements(pair):
        books = element_books(run, pair, element) if run.rows else None
        if books is not None:
            total = books[which].copy() if total is None else total + books[which]
    return None if total is None or run.time is None else trace(run.time, total)


def overlay_figure(title: str, shown: Sequence[Overlay], labels: tuple[str, str]) -> Figure | None:
    """The non-empty panels, with both runs in each."""
    shown = [overlay for overlay in shown if peak(*overlay.lines) > 0.0]
    if not shown:
        return None
    figure, axes = panels([1.6] * len(shown), title)
    for panel, overlay in zip(axes, shown, strict=True):
        factor, unit = scale_for(peak(*overlay.lines), overlay.unit)
        for line, label, colour in zip(overlay.lines, labels, COLOURS, strict=True):
            draw(panel, line, factor, plain(label), color=colour, linewidth=1.2)
        heading(panel, overlay.title)
        panel.set_ylabel(f"[{unit}]")
        panel.axhline(0.0, color=EDGE, linewidth=0.8)
    legend(axes[0])
    axes[-1].set_xlabel("time [s]")
    return figure


def timing_overlay(runs: tuple[Run, Run], labels: tuple[str, str]) -> Figure | None:
    """Lateness and compute histograms of both runs, with each run's budget."""
    titles = {"lateness_us": "Lateness", "compute_us": "Compute time"}
    data = {name: [run.read(name).get(name) for run in runs] for name in titles}
    if not any(values is not None for both in data.values() for values in both):
        return None
    figure, axes = panels([1.6, 1.6], "Timing")
    budgets = [1e6 / run.rate_hz for run in runs]
    tops = [float(np.nanmax(v)) for both in data.values() for v in both if v is not None]
    edges = np.geomspace(0.1, 2.0 * np.nanmax([1.0, *tops, *budgets]), 121)
    for panel, (name, title) in zip(axes, titles.items(), strict=True):
        for values, label, colour in zip(data[name], labels, COLOURS, strict=True):
            if values is not None:
                tally, _ = np.histogram(np.maximum(values[np.isfinite(values)], 0.1), edges)
                panel.stairs(tally, edges, color=colour, linewidth=1.5, label=plain(label))
        for budget, label, colour in zip(budgets, labels, COLOURS, strict=True):
            if np.isfinite(budget):
                text = plain(f"budget of {label}")
                panel.axvline(budget, color=colour, linestyle="-.", linewidth=1.1, label=text)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.set_ylim(bottom=0.7)
        heading(panel, f"{title} (at 0.1 µs: that or less)")
        panel.set_ylabel("cycles")
    legend(axes[0])
    axes[-1].set_xlabel("duration [µs]")
    return figure
