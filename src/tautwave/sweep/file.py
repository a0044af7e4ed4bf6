"""Sweep files: a rig, what is varied, what is measured. Read and checked like rig files.

A sweep lists its values; there are no expressions. A key that depends on another one is a column
beside it (`columns`: zipped, one point per row), or a separate case.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, get_args

from pydantic import Field

from tautwave.config import Rig
from tautwave.config.keys.common import Block, Name, Positive
from tautwave.config.messages import validate
from tautwave.config.shipped import offer_example
from tautwave.config.text.document import Document, nearest, open_document, read_text, show_path
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError
from tautwave.sweep.grid import Choice, Recipe
from tautwave.sweep.points import Points

Measure = Literal[
    "peak_amplitude",
    "late_amplitude",
    "growth_rate",
    "stable",
    "predicted_radius",
    "predicted_growth",
    "predicted_frequency",
    "position_error_rms",
    "position_error_max",
    "effort_error_rms",
    "effort_error_max",
    "gross_flow",
    "residual",
    "generated",
    "hand_effort_rms",
    "force_error_rms",
    "rendered_stiffness",
    "energy_made",
    "fast_share",
]
MEASURES: tuple[str, ...] = get_args(Measure)

GREATEST = 10_000_000
"""Most points of a sweep."""

CHECKED = 2000
"""Rigs checked before the first one runs; the others are checked when they run."""

Values = Annotated[list[Any], Field(min_length=1)]


class Panel(Block):
    """One panel of the figure."""

    measures: Annotated[tuple[Measure, ...], Field(min_length=1)] = Field(
        description="Panels of the figure: predictions as lines, simulations as markers."
    )
    title: str = Field(default="", description="Heading of the panel.")
    label: str = Field(description="Label of its vertical axis, with the unit in brackets.")
    scale: Literal["linear", "log", "symlog"] = Field(default="linear", description="Its scale.")
    linear_to: Positive = Field(
        default=1.0, description="symlog: linear between plus and minus this value."
    )
    range: tuple[float, float] | None = Field(default=None, description="Its limits.")
    cases: tuple[Name, ...] = Field(default=(), description="Cases that it shows; default: all.")
    where: dict[str, Any] = Field(
        default_factory=dict, description="As that of the figure, whose values it replaces."
    )
    mark_stability: bool = Field(
        default=False, description="Mark where each case changes between stable and unstable."
    )


class Figure(Block):
    """How the result is drawn: measures over one key, one colour per case."""

    title: str = Field(description="Heading of the figure.")
    x: str = Field(description="Key on the horizontal axis; every case varies it.")
    label: str = Field(description="Axis label, with the unit in brackets.")
    factor: Positive = Field(default=1.0, description="Display factor of the key.")
    scale: Literal["linear", "log"] = Field(default="linear", description="Its scale.")
    panels: Annotated[tuple[Panel, ...], Field(min_length=1)] = Field(
        description="In reading order."
    )
    notes: tuple[str, ...] = Field(default=(), description="Lines of text below: assumptions.")
    columns: Annotated[int, Field(ge=1, le=4)] = Field(
        default=1, description="Panels side by side; above 1 they have one legend."
    )
    where: dict[str, Any] = Field(
        default_factory=dict, description="Only points with these values are drawn."
    )


class Varied(Block):
    """Fixed and varied keys."""

    set: dict[str, Any] = Field(default_factory=dict, description="Keys of the rig and values.")
    grid: dict[str, Values] = Field(
        default_factory=dict, description="Keys and values: every combination is a point."
    )
    columns: dict[str, Values] = Field(
        default_factory=dict, description="Keys and values of equal number: every row is a point."
    )


class Case(Varied):
    """One curve: the keys it sets and varies itself, after the common part."""

    label: str | None = Field(default=None, description="Label; default: its name.")
    beside: Name | None = Field(
        default=None, description="Case whose colour it shares; its own line is dashed."
    )


class Sweep(Varied):
    """A sweep file. Its own `set`, `grid` and `columns` hold for every case."""

    name: Annotated[str, Field(min_length=1)] = Field(description="Name of the sweep.")
    rig: str = Field(description="Rig file; a relative path starts at this file's folder.")
    pair: Name | None = Field(default=None, description="Measured pair; default: first.")
    duration_s: Positive | None = Field(default=None, description="[s] Default: the rig's own.")
    cases: dict[Name, Case] = Field(default_factory=dict, description="Curves by name.")
    measures: Annotated[tuple[Measure, ...], Field(min_length=1)] = Field(
        description="Measures of each simulation."
    )
    figure: Figure | None = Field(default=None, description="Default: no figure.")


class SweepPlan(NamedTuple):
    """A valid sweep file, and all its points."""

    sweep: Sweep
    keys: tuple[str, ...]
    points: Points


def read_sweep_file(path: Path) -> Document:
    """Read the keys of a sweep file, or of a map file.

    Raises
    ------
    ConfigError
        It is not YAML, or is a file for something else.
    """
    offer_example(path)
    return open_document(read_text(path, "sweep file"), str(path), path.parent, "sweep file")


def load_sweep(path: str | Path) -> SweepPlan:
    """Read and check a sweep file and all of its rigs.

    Raises
    ------
    ConfigError
        Anything is wrong; `problems` holds every mistake with its line.
    """
    path = Path(path)
    document = read_sweep_file(path)
    sweep: Sweep | None = validate(document, Sweep)
    if document.problems or sweep is None:
        raise ConfigError(document.sentences())
    _check(document, sweep)
    if document.problems:
        raise ConfigError(document.sentences())
    points = Points(path.parent / sweep.rig, list(_recipes(sweep)), sweep.pair, sweep.duration_s)
    _check_points(document, sweep, points)
    return SweepPlan(sweep, points.keys(), points)


def _scopes(sweep: Sweep) -> Iterator[tuple[str, KeyPath, Varied]]:
    """Yield every case, the sweep itself if there are none."""
    if not sweep.cases:
        yield "", (), Varied()
    for name, case in sweep.cases.items():
        yield name, ("cases", name), case


def _blocks(sweep: Sweep, path: KeyPath, case: Varied) -> list[tuple[KeyPath, Varied]]:
    """Return the common block and the case's own, if it has one, with their places."""
    return [((), sweep), (path, case)] if path else [((), sweep)]


def _check(document: Document, sweep: Sweep) -> None:
    """Note keys that are valid on their own but do not fit together."""
    blocks: list[tuple[KeyPath, Varied]] = [((), sweep)]
    blocks += [(path, case) for _, path, case in _scopes(sweep) if path]
    total = 0
    for path, case in blocks:
        lengths = {key: len(values) for key, values in case.columns.items()}
        first = next(iter(lengths), "")
        for key, length in lengths.items():
            if length != lengths[first]:
                document.report(
                    (*path, "columns", key),
                    f"Input should have as many values as {first}, {lengths[first]} (got {length})",
                )
    for name, case in sweep.cases.items():
        if case.beside is not None and case.beside not in sweep.cases:
            hint = nearest(case.beside, list(sweep.cases))
            document.report(("cases", name, "beside"), f"there is no such case{hint}")
    for name, path, case in _scopes(sweep):
        places: dict[str, str] = {}
        count = 1
        for base, block in _blocks(sweep, path, case):
            rows = {len(values) for values in block.columns.values()}
            count *= max(rows, default=1)
            for word in ("grid", "columns"):
                for key, values in getattr(block, word).items():
                    here = (*base, word, key)
                    if key in places:
                        document.report(here, f"is already varied by {places[key]}")
                    places[key] = show_path((*base, word))
                    count *= len(values) if word == "grid" else 1
        total += count
        for where, key in _figure_keys(sweep):
            if key not in places:
                whom = f"case {name}" if name else "the sweep"
                text = f"{whom} does not vary {key!r}{nearest(key, list(places))}"
                document.report(("figure", *where), text)
    if total > GREATEST:
        document.report((), f"{total} points are more than {GREATEST}")
    for at, panel in enumerate(sweep.figure.panels if sweep.figure else ()):
        for index, name in enumerate(panel.cases):
            if name not in sweep.cases:
                here = ("figure", "panels", at, "cases", index)
                hint = nearest(name, list(sweep.cases))
                document.report(here, f"there is no such case{hint}")
        for index, measure in enumerate(panel.measures):
            if measure not in sweep.measures:
                document.report(
                    ("figure", "panels", at, "measures", index),
                    f"{measure!r} is not measured; add it to measures",
                )


def _figure_keys(sweep: Sweep) -> Iterator[tuple[KeyPath, str]]:
    """Yield the keys by which a figure tells points apart, with their places in it."""
    figure = sweep.figure
    if figure is None:
        return
    yield ("x",), figure.x
    for key in figure.where:
        yield ("where", key), key
    for at, panel in enumerate(figure.panels):
        for key in panel.where:
            yield ("panels", at, "where", key), key


def _check_points(document: Document, sweep: Sweep, points: Points) -> None:
    """Load the rigs of points; raise one error with the mistakes of all."""
    problems: dict[str, None] = {}
    for number in points.sample(CHECKED):
        try:
            rig = points.rig(number)
        except ConfigError as err:
            problems.update(dict.fromkeys(_placed(document, points.overrides(number), err)))
            continue
        sentence = _unfit(document, sweep, rig)
        if sentence:
            problems[sentence] = None
    if problems:
        raise ConfigError(list(problems))


def _recipes(sweep: Sweep) -> Iterator[Recipe]:
    """Yield the keys every case sets and varies: common first, then the case's own."""
    for name, path, case in _scopes(sweep):
        blocks = _blocks(sweep, path, case)
        fixed = tuple(
            Choice(key, value, (*base, "set", key))
            for base, block in blocks
            for key, value in block.set.items()
        )
        axes: list[tuple[tuple[Choice, ...], ...]] = []
        for base, block in blocks:
            for key, values in block.grid.items():
                places = ((*base, "grid", key, i) for i in range(len(values)))
                axes.append(
                    tuple((Choice(key, v, at),) for v, at in zip(values, places, strict=True))
                )
            if block.columns:
                rows = zip(*block.columns.values(), strict=True)
                axes.append(
                    tuple(
                        tuple(
                            Choice(key, v, (*base, "columns", key, i))
                            for key, v in zip(block.columns, row, strict=True)
                        )
                        for i, row in enumerate(rows)
                    )
                )
        yield Recipe(name, fixed, tuple(axes))


def _placed(document: Document, choices: list[Choice], err: ConfigError) -> Iterator[str]:
    """Replace the place of a refused override by that in the sweep file."""
    for problem in err.problems:
        for choice in choices:
            start = f"--set {choice.argument}: "
            if problem.startswith(start):
                where = f"{document.where(choice.path)}: {show_path(choice.path)}"
                yield f"{where}: {problem.removeprefix(start)}"
                break
        else:
            yield problem


def _unfit(document: Document, sweep: Sweep, rig: Rig) -> str:
    """Return why a valid rig cannot be used in this sweep, or ''."""
    if rig.simulation is None:
        return (
            f"{document.where(('rig',))}: rig: a sweep requires a simulation, and this rig has none"
        )
    if rig.scene is not None:
        return (
            f"{document.where(('rig',))}: rig: a sweep varies rigs with a coupling, and this one "
            "has a scene; use `tautwave run RIG --clock fake --set scene.KEY=VALUE` once a "
            "point, or tautwave.simulate(rig) in Python"
        )
    pairs = list(rig.coupling.pairs)
    if sweep.pair is not None and sweep.pair not in pairs:
        hint = nearest(sweep.pair, pairs) or "."
        return (
            f"{document.where(('pair',))}: pair: unknown pair {sweep.pair!r}{hint} "
            f"Pairs: {', '.join(pairs)}"
        )
    name = sweep.pair or pairs[0]
    for at, measure in enumerate(sweep.measures):
        if measure.startswith("predicted_"):
            for axis in (f"master.{name}", f"slave.{name}"):
                if rig.axes[axis].causality != "impedance":
                    return (
                        f"{document.where(('measures', at))}: measures: {measure} is for impedance "
                        f"axes, and {axis} takes velocities"
                    )
    return ""
