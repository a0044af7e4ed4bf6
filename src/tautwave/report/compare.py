"""Two runs on one page: verdicts side by side, differences, and their curves overlaid."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from tautwave.columns import ACCOUNT
from tautwave.files import make_directory, write_text
from tautwave.report.html import (
    badge,
    banner,
    file_stem,
    judged_banners,
    kept_picture,
    page,
    table,
    verdict_rows,
)
from tautwave.report.joined import joined_page, joined_summary, sites_of
from tautwave.report.run.loading import load_run
from tautwave.report.run.rundir import Run
from tautwave.report.run.verdicts import outcome, units_of, verdicts
from tautwave.report.units import count, microseconds, number, plural, quantity, significant
from tautwave.summary import Summary, plain_summary
from tautwave.summary.markup import Markup
from tautwave.tables import Table, of_numbers

Show = Callable[[Any], str]
Line = tuple[str, Show, tuple[str, ...]]
_NOT_COMPARED = ("started_utc", "command", "left_out", "realtime")


def compare_reports(a: Path, b: Path, out: Path) -> Path:
    """Write a page that compares the runs in `a` and `b`, or joins two sites of one session.

    Parameters
    ----------
    out : the page itself if its name ends in .html, else a directory to hold `compare.html`

    Raises
    ------
    RecordingError
        One of them holds neither a summary nor a readable recording.
    """
    runs = (load_run(Path(a)), load_run(Path(b)))
    target = Path(out)
    if target.suffix != ".html":
        target = target / "compare.html"
    make_directory(target.parent)
    both = sites_of(runs)
    if both is not None:
        joined = joined_summary(*both)
        write_text(target.with_suffix(".json"), json.dumps(joined, indent=2) + "\n")
        write_text(target, joined_page(*both, joined, target.parent))
        return target
    labels = _labels(runs)
    title = f"{labels[0]} against {labels[1]} – tautwave"
    write_text(target, page(title, _body(runs, labels, target.parent)))
    return target


def _labels(runs: tuple[Run, Run]) -> tuple[str, str]:
    names = [run.directory.resolve().name for run in runs]
    if names[0] == names[1]:
        return f"A: {names[0]}", f"B: {names[1]}"
    return names[0], names[1]


def _body(runs: tuple[Run, Run], labels: tuple[str, str], folder: Path) -> Iterator[Markup]:
    yield Markup("<h1>{} against {}</h1>").format(labels[0], labels[1])
    yield Markup('<div class="sides">')
    for run, label in zip(runs, labels, strict=True):
        ended = outcome(run)
        yield Markup('<div><h3>{}</h3><div class="top"><b>{}</b>').format(label, run.name)
        yield Markup("{}</div>").format(badge(ended))
        yield Markup("<p>{}</p>").each(ended.sentences)
        if run.notes:
            yield banner("This run is incomplete", run.notes, "note")
        yield from judged_banners(run)
        yield verdict_rows(verdicts(run)) + Markup("</div>")
    yield Markup("</div>")
    yield Markup("<h2>Differences between the rigs</h2>")
    yield _differences(_changes(runs[0].rig, runs[1].rig), labels)
    noise = _noise(runs)
    shared = [pair for pair in runs[0].pairs if pair in runs[1].pairs]
    for pair in shared:
        yield Markup("<h2>Pair {}</h2>").format(pair)
        yield table(_table(runs, labels, "Tracking", _tracking(runs[0], pair), RESOLVED))
        yield table(_feel(runs, labels, pair))
        yield from _pictures(runs, labels, pair, folder)
        yield table(_table(runs, labels, "Energy of each element", _energies(runs, pair), noise))
    for run, label in zip(runs, labels, strict=True):
        alone = [pair for pair in run.pairs if pair not in shared]
        if alone:
            yield Markup('<p class="note">Only in {}: {}.</p>').format(label, ", ".join(alone))
    yield Markup("<h2>Books and timing</h2>")
    yield table(_table(runs, labels, "Books", _books(), noise))
    yield table(_table(runs, labels, "Timing", _times()))
    from tautwave.report.figures.compare import timing_overlay

    figure = timing_overlay(runs, labels)
    if figure is not None:
        yield kept_picture(folder, "compare-timing", figure, "histograms of both runs")
    yield Markup("<h2>All differences between the summaries</h2>")
    yield _differences(_changes(_plain(runs[0].result), _plain(runs[1].result)), labels)


def _differences(rows: list[tuple[str, str, str]], labels: tuple[str, str]) -> Markup:
    if not rows:
        return Markup("<p>Nothing.</p>")
    made = table(Table("", ("key", *labels), tuple(rows)))
    if len(rows) <= 15:
        return made
    return Markup("<details><summary>{}</summary>{}</details>").format(
        plural(len(rows), "difference"), made
    )


def _pictures(
    runs: tuple[Run, Run], labels: tuple[str, str], pair: str, folder: Path
) -> Iterator[Markup]:
    from tautwave.report.figures.compare import Overlay, column_of, energy_of, overlay_figure

    position, effort = units_of(runs[0], pair)

    def both(column: str) -> Any:
        return column_of(runs[0], column), column_of(runs[1], column)

    def energies(which: int) -> Any:
        return energy_of(runs[0], pair, which), energy_of(runs[1], pair, which)

    shown = [
        Overlay("Position of the master", position, both(f"master.{pair}.position")),
        Overlay("Position error, master − slave", position, both(f"{pair}.position_error")),
        Overlay("Effort error: sum of both port efforts", effort, both(f"{pair}.effort_error")),
    ]
    stem = file_stem(pair)
    figure = overlay_figure(f"Tracking of {pair}", shown, labels)
    if figure is not None:
        yield kept_picture(folder, f"compare-{stem}-tracking", figure, f"tracking of {pair}")
    shown = [
        Overlay("Stored in all elements", "J", energies(1)),
        Overlay("Dissipated in all elements since the start", "J", energies(2)),
    ]
    figure = overlay_figure(f"Energy of {pair}", shown, labels)
    if figure is not None:
        yield kept_picture(folder, f"compare-{stem}-energy", figure, f"energy of {pair}")


def _tracking(run: Run, pair: str) -> list[Line]:
    position, effort = units_of(run, pair)

    def in_position(value: Any) -> str:
        return quantity(value, position)

    def in_effort(value: Any) -> str:
        return quantity(value, effort)

    return [
        ("position error, rms", in_position, ("pairs", pair, "position_error", "rms")),
        ("position error, max", in_position, ("pairs", pair, "position_error", "max")),
        ("standing offset", in_position, ("pairs", pair, "expected_offset")),
        ("effort error, rms", in_effort, ("pairs", pair, "effort_error", "rms")),
        ("effort error, max", in_effort, ("pairs", pair, "effort_error", "max")),
    ]


def _joule(value: Any) -> str:
    return quantity(value, "J")


ROUNDING = 1e-12
"""Share of the gross flow below which an energy is rounding, and counts as zero."""

RESOLVED = 1e-12
"""[rad, m, N m or N]: Below the resolution of any device; a smaller error counts as zero."""


def _noise(runs: tuple[Run, Run]) -> float:
    """Return the energy [J] below which those of both runs are rounding."""
    return ROUNDING * max(run.result.energy_j.gross_flow or 0.0 for run in runs)


def _energies(runs: tuple[Run, Run], pair: str) -> list[Line]:
    elements = dict.fromkeys([*runs[0].elements(pair), *runs[1].elements(pair)])
    kinds = (*ACCOUNT, "generated")
    return [
        (f"{element.replace('_', ' ')}, {kind}", _joule, ("pairs", pair, "elements", element, kind))
        for element in elements
        for kind in kinds
    ]


def _books() -> list[Line]:
    keys = ("gross_flow", "residual", "generated", "sensing_gap", "plant_residual")
    return [(key.replace("_", " "), _joule, ("energy_j", key)) for key in keys]


def _times() -> list[Line]:
    lines: list[Line] = [
        (key.replace("_", " "), count, (key,)) for key in ("cycles", "missed_cycles")
    ]
    for what in ("period_us", "lateness_us", "compute_us"):
        for at, label in (("p50", "p50"), ("p99", "p99"), ("p999", "p99.9"), ("max", "max")):
            lines.append((f"{what.removesuffix('_us')} {label}", microseconds, (what, at)))
    return lines


def _table(
    runs: tuple[Run, Run],
    labels: tuple[str, str],
    title: str,
    lines: list[Line],
    noise: float = 0.0,
) -> Table:
    """Table of two summaries; values within `noise` (in SI) in both get no ratio."""
    numbers = [
        (name, show, values)
        for name, show, keys in lines
        if any(values := tuple(value_of(run.result, keys) for run in runs))
        or keys[-1] not in ACCOUNT
    ]
    return _side_by_side(labels, title, numbers, noise)


def value_of(summary: Summary, keys: Sequence[str]) -> Any:
    """Return what stands in a summary under keys, None where one of them is missing."""
    value: Any = summary
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else getattr(value, key, None)
    return value


def _feel(runs: tuple[Run, Run], labels: tuple[str, str], pair: str) -> Table:
    """Table of what the operator feels of both rigs."""
    from tautwave.report.feel import feel_of, feel_values  # simulates

    both = [feel_values(feel_of(run), pair) for run in runs]
    numbers = []
    for what in dict.fromkeys([*both[0], *both[1]]):
        values = tuple(one.get(what, (None, ""))[0] for one in both)
        unit = next(one[what][1] for one in both if what in one)
        numbers.append((what, partial(quantity, unit=unit), values))
    return _side_by_side(labels, "What the operator feels of the rig", numbers)


def _side_by_side(
    labels: tuple[str, str],
    title: str,
    given: Sequence[tuple[str, Show, tuple[Any, ...]]],
    noise: float = 0.0,
) -> Table:
    """Table of two values a line; those within `noise` (in SI) in both get no ratio."""
    rows = []
    for name, show, values in given:
        first, second = number(values[0]), number(values[1])
        if first is None and second is None:
            continue
        if first is None or second is None:
            difference = times = "–"
        else:
            difference = show(second - first)
            times = "–" if abs(first) <= noise else significant(second / first, 3)
            if max(abs(first), abs(second)) <= noise:
                times = "both zero"
        rows.append((name, show(values[0]), show(values[1]), difference, times))
    head = of_numbers("", *labels, "second − first", "second / first")
    return Table(title, head, tuple(rows))


def _plain(summary: Summary) -> dict[str, Any]:
    return {key: value for key, value in plain_summary(summary).items() if key not in _NOT_COMPARED}


def _changes(a: dict[str, Any], b: dict[str, Any], stem: str = "") -> list[tuple[str, str, str]]:
    """Keys whose values differ, with both values; a block missing on one side is one row."""
    rows: list[tuple[str, str, str]] = []
    for key in dict.fromkeys([*a, *b]):
        first, second = a.get(key), b.get(key)
        if isinstance(first, dict) and isinstance(second, dict):
            rows += _changes(first, second, f"{stem}{key}.")
        elif key not in a or key not in b or first != second:
            rows.append((f"{stem}{key}", _text(a, key), _text(b, key)))
    return rows


def _text(values: dict[str, Any], key: str) -> str:
    value = values.get(key)
    if key not in values:
        return "–"
    if isinstance(value, dict):
        return "given" if value else "empty"
    return significant(value, 6) if isinstance(value, float) else str(value)
