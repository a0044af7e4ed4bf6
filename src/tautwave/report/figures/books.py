"""The figures of the books and of the clock: energy per element, timing of the loop."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.canvas import BAND, EDGE, FILTER, INK, LIMIT, element_style, heading, legend, panels
from tautwave.report.books import CLOSED
from tautwave.report.figures.canvas import draw, label_of
from tautwave.report.figures.envelope import Floats, Trace, peak, spread, trace
from tautwave.report.run.rebuild import periods_us
from tautwave.report.run.rundir import Run
from tautwave.report.run.views import EnergyView
from tautwave.report.units import count, quantity, scale_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def energy_figure(view: EnergyView, pair: str) -> Figure | None:
    """Stored, absorbed and dissipated energy of every element, and the imbalance."""
    if not view.elements:
        return None
    titles = {
        "stored": "Stored now",
        "absorbed": "Absorbed since the start",
        "dissipated": "Dissipated since the start (a falling line generates)",
    }
    flat = {k for k in titles if spread(*view.account[k].values()) <= view.least}
    view.flat += [f"energy {kind}" for kind in titles if kind in flat]
    if len(flat) == len(titles):
        return None
    kinds = [kind for kind in titles if kind not in flat]
    figure, axes = panels((1.6,) * len(kinds) + (1.3,), f"Energy of {pair}, by element")
    for panel, kind in zip(axes, kinds, strict=False):
        _account(panel, view, kind)
        heading(panel, titles[kind])
        legend(panel)
    _balance(axes[-1], view)
    axes[-1].set_xlabel("time [s]")
    return figure


def _account(panel: Axes, view: EnergyView, kind: str) -> None:
    lines = {e: t for e, t in view.account[kind].items() if peak(t) > 0.0}
    factor, unit = scale_for(peak(*lines.values()), "J")
    quiet = [label_of(e) for e in view.elements if e not in lines]
    for element, line in lines.items():
        style = element_style(element)
        draw(panel, line, factor, label_of(element), **style)
        # Areas only if they hardly overlap; with mixed signs they would hide each other.
        if kind == "stored" and len(lines) <= 4 and float(np.nanmin(line.value)) >= 0.0:
            panel.fill_between(
                line.time, factor * line.value, color=style["color"], alpha=0.18, linewidth=0
            )
    if quiet:
        panel.plot([], [], " ", label=f"always zero: {', '.join(quiet)}")
    panel.axhline(0.0, color=EDGE, linewidth=0.8)
    panel.set_ylabel(f"energy [{unit}]")


def _balance(panel: Axes, view: EnergyView) -> None:
    limit = CLOSED * view.gross_flow
    bottom = 1e-9 * limit if limit > 0.0 else 1e-20
    panel.set_yscale("log")
    if view.balance is not None:
        # An exact zero has no place on a log axis; it is drawn at the bottom.
        visible = Trace(view.balance.time, np.maximum(view.balance.value, 1.5 * bottom))
        draw(panel, visible, 1.0, "imbalance (bottom: exactly 0)", color=INK, linewidth=1.0)
    if limit > 0.0:
        label = "10⁻⁹ of gross flow"
        panel.axhline(limit, color=LIMIT, linewidth=1.2, linestyle="-.", label=label)
    panel.set_ylim(bottom=bottom)
    heading(panel, "Balance: absorbed − change of stored − dissipated, all elements")
    panel.set_ylabel("residual [J]")
    legend(panel, f"gross flow\n{quantity(view.gross_flow, 'J')}")


def timing_figure(run: Run) -> Figure | None:
    """Histograms of period, lateness and compute time, and the times of slow cycles.

    Columns are read one by one, so that an hour of recording stays small in memory.
    """
    time = run.time
    if time is None or len(time) < 2:
        return None
    budget = 1e6 / run.rate_hz if np.isfinite(run.rate_hz) else float("nan")
    figure, axes = panels((1.6, 1.7, 1.5), "Timing of the loop", share=False)
    _period(axes[0], periods_us(time, run.read("lateness_us"), run.rate_hz), budget)
    edges = _edges(run, budget)
    for name, label, colour in (
        ("lateness_us", "start later than its slot", FILTER),
        ("compute_us", "compute per cycle", INK),
    ):
        for values in run.read(name).values():
            # Zero lateness has no place on a log axis: it is counted in the first bin.
            shown = np.maximum(values, edges[0])
            tally, _ = np.histogram(shown[np.isfinite(shown)], edges)
            axes[1].stairs(tally, edges, color=colour, linewidth=1.5, label=label)
            axes[1].stairs(tally, edges, fill=True, color=colour, alpha=0.18)
            line = trace(time, shown)
            short = name.removesuffix("_us")
            axes[2].plot(line.time, line.value, color=colour, linewidth=0.8, label=short)
    _finish_durations(axes[1], budget)
    for skipped in run.read("skipped_slots").values():
        _mark_skipped(axes[2], time, skipped)
    _finish_when(axes[2], budget)
    return figure


def _edges(run: Run, budget: float) -> Floats:
    tops = [1.0, budget]
    for name in ("lateness_us", "compute_us"):
        tops += [float(np.nanmax(v, initial=0.0)) for v in run.read(name).values()]
    return np.geomspace(0.1, 2.0 * max(top for top in tops if np.isfinite(top)), 121)


def _period(panel: Axes, periods: Floats, budget: float) -> None:
    known = periods[np.isfinite(periods)]
    low, high = float(known.min()), float(known.max())
    centre = budget if np.isfinite(budget) else float(np.median(known))
    least, most = period_axis(known, centre)
    edges = np.linspace(least, most + 1e-6 * (most - least), 162)
    tally, _ = np.histogram(known, edges)
    panel.stairs(tally, edges, fill=True, color=BAND, label="cycles")
    panel.set_yscale("log")
    panel.set_ylim(bottom=0.7)
    panel.set_xlim(least, most)
    if np.isfinite(budget):
        label = "required period"
        panel.axvline(budget, color=LIMIT, linewidth=1.3, linestyle="-.", label=label)
    # Stacked: side by side they fit only in a wide figure.
    for beyond, text, at, side in (
        (int((known < least).sum()), f"down to {quantity(low * 1e-6, 's', 3)}", 0.96, "left"),
        (int((known > most).sum()), f"up to {quantity(high * 1e-6, 's', 3)}", 0.82, "right"),
    ):
        if beyond:
            caption = f"{count(beyond)} beyond the axis, {text}"
            caption = f"◂ {caption}" if side == "left" else f"{caption} ▸"
            place: Any = {"ha": side, "va": "top", "transform": panel.transAxes}
            edge = 0.01 if side == "left" else 0.99
            panel.text(edge, at, caption, color=LIMIT, **place)
    heading(panel, "Period, start to start")
    panel.set_xlabel("period [µs]")
    panel.set_ylabel("cycles")
    ends = f"least {quantity(low * 1e-6, 's', 5)}, greatest {quantity(high * 1e-6, 's', 5)}"
    legend(panel, ends)


def period_axis(periods: Floats, centre: float) -> tuple[float, float]:
    """Return the ends of an axis for periods that covers nearly all of them, ignoring outliers.

    The middle 99.8 % with half their width on both sides, and `centre`; the figure states how many
    lie beyond.
    """
    low, high = np.quantile(periods, (0.001, 0.999)).tolist()
    room = 0.5 * max(high - low, 0.01 * centre)
    least, most = max(float(periods.min()), low - room), min(float(periods.max()), high + room)
    return min(least, 0.99 * centre), max(most, 1.01 * centre)


def _finish_durations(panel: Axes, budget: float) -> None:
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.set_ylim(bottom=0.7)
    if np.isfinite(budget):
        label = f"budget 1/rate, {quantity(budget * 1e-6, 's')}"
        panel.axvline(budget, color=LIMIT, linewidth=1.3, linestyle="-.", label=label)
    heading(panel, "Lateness and compute time (bars at 0.1 µs: that or less)")
    panel.set_xlabel("duration [µs]")
    panel.set_ylabel("cycles")
    legend(panel)


def _mark_skipped(panel: Axes, time: Floats, skipped: Floats) -> None:
    where = np.flatnonzero(skipped > 0)
    if len(where) == 0:
        return
    # Thousands of marks show no more than a few hundred, and take seconds.
    some = where[:: max(1, len(where) // 400)]
    panel.plot(
        time[some],
        np.full(len(some), 0.97),
        "v",
        color=LIMIT,
        markersize=5,
        transform=panel.get_xaxis_transform(),
        label=f"slots skipped ({len(where)})",
    )


def _finish_when(panel: Axes, budget: float) -> None:
    if np.isfinite(budget):
        panel.axhline(budget, color=LIMIT, linewidth=1.0, linestyle="-.", label="budget")
    panel.set_yscale("log")
    heading(panel, "When it happened")
    panel.set_xlabel("time [s]")
    panel.set_ylabel("duration [µs]")
    legend(panel)
