"""The figure of a sweep: measures over one key, a colour per case, predictions as lines.

Units are those the sweep file gives in its labels; values are SI times its factor.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tautwave.canvas import (
    DAMPER,
    EDGE,
    FILTER,
    INK,
    LINE,
    MASTER,
    PAPER,
    SLAVE,
    SOFT,
    WALL,
    heading,
    key,
    legend,
    panels,
    plain,
    save_figure,
    text_panel,
)
from tautwave.config.guard import parse_json
from tautwave.report.units import significant

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

    from tautwave.sweep.file import Figure, Panel, Sweep

COLOURS = (MASTER, SLAVE, WALL, LINE, DAMPER, FILTER, INK)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
FILE = "sweep.png"
GROWING = 1e-6
"""Growth [1/s] above which a prediction counts as unstable, far above rounding."""

Row = Mapping[str, str]


class Curve(NamedTuple):
    """One case: its name, label and look, and its rows in the order of the horizontal axis."""

    case: str
    label: str
    colour: str
    marker: str
    dashed: bool
    x: list[float]
    rows: list[Row]

    def of(self, figure: Figure, panel: Panel) -> Curve:
        """Return the points of it that a panel shows."""
        where = {**figure.where, **panel.where}
        shown = [all(_is(row[one], value) for one, value in where.items()) for row in self.rows]
        return self._replace(
            x=[x for x, show in zip(self.x, shown, strict=True) if show],
            rows=[row for row, show in zip(self.rows, shown, strict=True) if show],
        )


class Change(NamedTuple):
    """The first value at which a verdict has changed."""

    x: float
    stable: bool


def write_sweep_figure(sweep: Sweep, rows: Sequence[Row], out: Path) -> Path | None:
    """Draw `rows` into `out`/sweep.png, .svg and .pdf; None without a figure or points."""
    if sweep.figure is None:
        return None
    curves = curves_of(sweep, sweep.figure, rows)
    if not curves:
        return None
    return save_figure(sweep_drawing(sweep.figure, curves), out / FILE)


def curves_of(sweep: Sweep, figure: Figure, rows: Sequence[Row]) -> list[Curve]:
    """Return one curve per case that has points; one beside another has its colour, and dashes."""
    names = list(sweep.cases) or [""]
    own = [name for name in names if name not in sweep.cases or sweep.cases[name].beside is None]
    curves = []
    for name in names:
        case = sweep.cases.get(name)
        label = sweep.name if case is None else case.label or name
        beside = None if case is None else case.beside
        at = own.index(beside or name) if (beside or name) in own else 0
        mine = [row for row in rows if row["case"] == name and _value(row, figure.x) is not None]
        mine.sort(key=lambda row: float(row[figure.x]))
        if mine:
            x = [figure.factor * float(row[figure.x]) for row in mine]
            colour, marker = COLOURS[at % len(COLOURS)], MARKERS[at % len(MARKERS)]
            curves.append(Curve(name, label, colour, marker, beside is not None, x, mine))
    return curves


def sweep_drawing(figure: Figure, curves: Sequence[Curve]) -> Drawing:
    """Return the figure: its panels, with the findings and assumptions as text below."""
    lines = [line for curve in curves for line in stability_sentences(curve, figure)]
    lines += [(SOFT, note) for note in figure.notes]
    count, columns = len(figure.panels), figure.columns
    rows = -(-count // columns)
    heights = [2.2 if columns == 1 else 1.7] * rows + [0.1]
    share = [True] * (rows * columns) + [False] * columns
    drawing, axes = panels(heights, figure.title, share, columns=columns)
    for panel, keys in zip(axes, figure.panels, strict=False):
        _draw_panel(panel, keys, figure, curves)
        if columns == 1:
            legend(panel)
    if columns > 1:
        key(drawing)
    for lowest in axes[count - columns : count]:
        lowest.tick_params(labelbottom=True)
        lowest.set_xlabel(plain(figure.label))
    for empty in axes[count:]:
        empty.set_axis_off()
    text_panel(axes[rows * columns], lines)
    return drawing


def _draw_panel(axes: Axes, keys: Panel, figure: Figure, curves: Sequence[Curve]) -> None:
    low, high = min(min(c.x) for c in curves), max(max(c.x) for c in curves)
    curves = [one.of(figure, keys) for one in curves if not keys.cases or one.case in keys.cases]
    axes.set_xscale(figure.scale)
    if keys.scale == "symlog":
        axes.set_yscale("symlog", linthresh=keys.linear_to)
    else:
        axes.set_yscale(keys.scale)
    if figure.scale == "log":
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlim(low / 1.06, high * 1.06)
    elif high > low:
        axes.set_xlim(low - 0.02 * (high - low), high + 0.02 * (high - low))
    if keys.scale != "log":
        axes.axhline(0.0, color=EDGE, linewidth=0.8, zorder=1.5)
    predicted = [name for name in keys.measures if name.startswith("predicted_")]
    simulated = [name for name in keys.measures if name not in predicted]
    above = 0.0 if keys.scale == "log" else -math.inf
    for curve in curves:
        for measure in predicted:
            axes.plot(*_known(curve, measure, above), **_line(curve))
        for measure in simulated:
            axes.plot(*_known(curve, measure, above), **_markers(curve, joined=not predicted))
        style = _markers(curve, joined=not predicted) if simulated else {}
        both = {**style, **(_line(curve) if predicted else {})}
        axes.plot([], [], **both, label=plain(curve.label))
    if predicted and simulated:
        axes.plot([], [], color=SOFT, linewidth=1.6, label="line: predicted")
        hollow: dict[str, Any] = {
            "markerfacecolor": PAPER,
            "markersize": 4.5,
            "linestyle": "none",
        }
        axes.plot([], [], "o", color=SOFT, label="marker: simulated", **hollow)
    if keys.range is not None:
        axes.set_ylim(*keys.range)
    if keys.mark_stability:
        _mark_stability(axes, curves, figure)
    heading(axes, plain(keys.title))
    axes.set_ylabel(plain(keys.label))


def _mark_stability(axes: Axes, curves: Sequence[Curve], figure: Figure) -> None:
    """Mark verdict changes: predicted by a line across the panel, simulated by a marker."""
    dashed: dict[str, Any] = {"linewidth": 1.1, "linestyle": (0, (4, 2))}
    filled: dict[str, Any] = {"markersize": 9, "markeredgecolor": PAPER, "linestyle": "none"}
    for curve in curves:
        for change in predicted_changes(curve):
            axes.axvline(change.x, color=curve.colour, **dashed)
            axes.annotate(
                f" {significant(change.x)} {_unit(figure)}".rstrip(),
                (change.x, 0.02),
                xycoords=("data", "axes fraction"),
                fontsize=8.8,
                color=curve.colour,
            )
        for change in simulated_changes(curve):
            axes.plot(
                [change.x],
                [0.0],
                curve.marker,
                color=curve.colour,
                zorder=4,
                clip_on=False,
                **filled,
            )
    axes.plot([], [], color=SOFT, label="stability changes,\npredicted", **dashed)
    axes.plot([], [], "o", color=SOFT, label="… simulated", **filled)


def _line(curve: Curve) -> dict[str, Any]:
    return {
        "color": curve.colour,
        "linewidth": 1.6,
        "linestyle": (0, (3, 2)) if curve.dashed else "-",
    }


def _markers(curve: Curve, *, joined: bool) -> dict[str, Any]:
    return {
        "color": curve.colour,
        "marker": "" if curve.dashed and joined else curve.marker,
        "markerfacecolor": PAPER,
        "markeredgewidth": 1.2,
        "markersize": 4.5,
        "linestyle": ((0, (3, 2)) if curve.dashed else "-") if joined else "none",
        "linewidth": 1.2 if curve.dashed else 0.8,
        "zorder": 3,
    }


def _known(curve: Curve, measure: str, above: float) -> tuple[list[float], list[float]]:
    """Return the points of a curve where a measure has a value that its axis can show."""
    pairs = [(x, _value(row, measure)) for x, row in zip(curve.x, curve.rows, strict=True)]
    known = [(x, value) for x, value in pairs if value is not None and value > above]
    return [x for x, _ in known], [value for _, value in known]


# -- verdicts ------------------------------------------------------------------------------------


def predicted_changes(curve: Curve) -> list[Change]:
    """Return where the predicted verdict changes along a curve."""
    growth = [_value(row, "predicted_growth") for row in curve.rows]
    return _changes(curve.x, [None if value is None else value <= GROWING for value in growth])


def simulated_changes(curve: Curve) -> list[Change]:
    """Return where the simulated verdict changes along a curve."""
    stable = [_value(row, "stable") for row in curve.rows]
    return _changes(curve.x, [None if value is None else value > 0.5 for value in stable])


def _changes(x: Iterable[float], verdicts: Iterable[bool | None]) -> list[Change]:
    """Return every change; a curve that is unstable at first starts with one."""
    changes: list[Change] = []
    before = True
    for at, verdict in zip(x, verdicts, strict=True):
        if verdict is not None and verdict != before:
            changes.append(Change(at, verdict))
            before = verdict
    return changes


def stability_sentences(curve: Curve, figure: Figure) -> list[tuple[str, str]]:
    """Return a sentence on where a case is stable, with its colour; nothing if not measured."""
    ranges = []
    first, last = curve.rows[0], curve.rows[-1]
    unit = _unit(figure)
    for word, measure, changes in (
        ("predicted", "predicted_growth", predicted_changes(curve)),
        ("simulated", "stable", simulated_changes(curve)),
    ):
        if _value(first, measure) is not None and _value(last, measure) is not None:
            ranges.append(f"{word} {_ranges(changes, unit)}")
    if unjudged := sum(row.get("stable") == "nan" for row in curve.rows):
        ranges.append(f"{unjudged} of {len(curve.rows)} not judged: the hand does not come to rest")
    return [(curve.colour, f"{curve.label}: {'; '.join(ranges)}.")] if ranges else []


def _unit(figure: Figure) -> str:
    """Return the unit in brackets in the label of the horizontal axis."""
    return figure.label.partition("[")[2].partition("]")[0]


def _ranges(changes: Sequence[Change], unit: str) -> str:
    if not changes:
        return "stable throughout"
    parts = []
    for change in changes:
        word = "stable again" if change.stable else "unstable"
        parts.append(f"{word} from {significant(change.x)} {unit}".rstrip())
    return ", ".join(parts)


def _is(text: str, wanted: Any) -> bool:
    """Return whether a row's text stands for a value; 0 and 0.0 are the same one."""
    try:
        return bool(wanted in (text, parse_json(text)))
    except ValueError:
        return bool(wanted == text)


def _value(row: Row, name: str) -> float | None:
    """Return a number of a row, None if it is missing."""
    text: Any = row.get(name, "")
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
