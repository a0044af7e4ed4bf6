"""The figure of a sweep with a column of panels for each value of a key, for a page or a paper."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from tautwave import canvas
from tautwave.config.guard import parse_json

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

    from tautwave.sweep.file import Figure, Panel, Sweep

COLOURS = (
    *(canvas.MASTER, canvas.SLAVE, canvas.WALL, canvas.LINE, canvas.DAMPER, canvas.FILTER),
    canvas.INK,
)
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
HEIGHT = 1.15
"""Of a row [inch], at the page's width."""

Row = Mapping[str, str]


class Look(NamedTuple):
    """How a case is drawn; `beside` another it shares the colour, and its line is dashed."""

    label: str
    colour: str
    marker: str
    dashed: bool


def write_across_figure(sweep: Sweep, figure: Figure, rows: Sequence[Row], out: Path) -> Path:
    """Draw `rows` into `out`/sweep.png, and sweep.svg and sweep.pdf beside it."""
    drawn = across_drawing(sweep, figure, rows)
    return canvas.save_figure(drawn, out / "sweep.png", figure.title)


def looks_of(sweep: Sweep) -> dict[str, Look]:
    """Return how each case is drawn, by name."""
    own = [name for name, case in sweep.cases.items() if case.beside is None]
    looks = {}
    for name, case in sweep.cases.items():
        at = own.index(case.beside or name) if (case.beside or name) in own else 0
        colour, marker = COLOURS[at % len(COLOURS)], MARKERS[at % len(MARKERS)]
        looks[name] = Look(case.label or name, colour, marker, case.beside is not None)
    return looks or {"": Look(sweep.name, COLOURS[0], MARKERS[0], dashed=False)}


def across_drawing(sweep: Sweep, figure: Figure, rows: Sequence[Row]) -> Drawing:
    """Return the figure: a row of panels per panel of the file, a column per value."""
    assert figure.across is not None
    values = list(dict.fromkeys(row[figure.across] for row in rows))
    heads = list(figure.labels) + values[len(figure.labels) :]
    count = len(figure.panels)
    drawing, axes = canvas.panels([HEIGHT] * count, figure.title, True, columns=len(values))
    looks = looks_of(sweep)
    for at, keys in enumerate(figure.panels):
        line = axes[at * len(values) : (at + 1) * len(values)]
        for axis, value in zip(line, values, strict=True):
            own = [row for row in rows if row[figure.across] == value]
            _draw(axis, keys, figure, looks, own)
        _level(line, keys)
        line[0].set_ylabel(canvas.plain(keys.label))
        if at == 0:
            for axis, head in zip(line, heads, strict=True):
                canvas.heading(axis, canvas.plain(head))
    for axis in axes[-len(values) :]:
        axis.set_xlabel(canvas.plain(figure.label))
    if figure.marked:
        marked = ", ".join(f"{key} {value}" for key, value in figure.marked.items())
        axes[0].plot([], [], "o", color=canvas.SOFT, markerfacecolor="none", markersize=3.5,
                     linestyle="none", label=canvas.plain(f"markers: {marked}"))  # fmt: skip
    canvas.key(drawing)
    return drawing


def _draw(
    axis: Axes, keys: Panel, figure: Figure, looks: Mapping[str, Look], rows: Sequence[Row]
) -> None:
    axis.set_xscale(figure.scale)
    for name, look in looks.items():
        mine = sorted(
            (row for row in rows if row["case"] == name), key=lambda row: float(row[figure.x])
        )
        line = [row for row in mine if _has(row, figure.where)]
        for measure in keys.measures:
            axis.plot(
                *_points(line, figure, measure),
                color=look.colour,
                linewidth=1.0 if look.dashed else 1.5,
                linestyle=(0, (3, 2)) if look.dashed else "-",
                label=canvas.plain(look.label),
            )
            if figure.marked:
                axis.plot(
                    *_points([row for row in mine if _has(row, figure.marked)], figure, measure),
                    look.marker,
                    color=look.colour,
                    markerfacecolor=canvas.PAPER if look.dashed else look.colour,
                    markersize=2.8,
                    linestyle="none",
                )
    if figure.scale == "log":
        axis.locator_params(axis="x", numticks=9)
        axis.xaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _level(line: Sequence[Axes], keys: Panel) -> None:
    """Give the panels of a row one vertical axis."""
    for axis in line:
        if keys.scale == "symlog":
            axis.set_yscale("symlog", linthresh=keys.linear_to)
        else:
            axis.set_yscale(keys.scale)
    low, high = keys.range or (
        min(axis.get_ylim()[0] for axis in line),
        max(axis.get_ylim()[1] for axis in line),
    )
    for axis in line:
        axis.set_ylim(low, high)
    for axis in line[1:]:
        axis.tick_params(labelleft=False)


def _has(row: Row, wanted: Mapping[str, Any]) -> bool:
    """Return whether a row has these values; 0 and 0.0 are the same one."""
    return all(value in (row[key], _value(row[key])) for key, value in wanted.items())


def _value(text: str) -> Any:
    try:
        return parse_json(text)
    except ValueError:
        return text


def _points(rows: Sequence[Row], figure: Figure, measure: str) -> tuple[list[float], list[float]]:
    points = [(figure.factor * float(row[figure.x]), _number(row.get(measure, ""))) for row in rows]
    known = [(x, y) for x, y in points if math.isfinite(y)]
    return [x for x, _ in known], [y for _, y in known]


def _number(text: str) -> float:
    return float(text) if text else math.nan
