"""The result of a check on one screen: the verdict, what to decide, what would help most."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from tautwave.cli.terminal.screen import (
    COLUMNS,
    LINES,
    axes_named,
    folded,
    folded_rows,
    line_count,
    spanned,
)
from tautwave.cli.terminal.show import plain_lines, verdict
from tautwave.tables import BAD, FAINT, GOOD, NOTE, Cell, Table

AXIS_HEADS = ("axis", ">takes", ">velocity", ">prompt", ">stall", ">dead host", "claim")
"""Of an axis: what it may supply while its host is prompt, in one stall, and by a dead host."""

Fact = tuple[str, str]


class Room(NamedTuple):
    """How much is said: rows of axes, kinds of things to decide and lines of each."""

    rows: int
    kinds: int
    lines: int


ROOMS = (Room(8, 3, 2), Room(6, 2, 2), Room(4, 2, 1), Room(2, 1, 1))
"""The first that fits on a screen is taken, else the last."""


def short_sections(name: str, result: Any, last: Sequence[Table], command: str) -> list[Table]:
    """Return what a screen has room for of a `session.CheckResult`.

    Parameters
    ----------
    name : str
        Of the rig.
    result : CheckResult
        The result.
    last : sequence of Table
        What stands at the end in any case, the verdict last.
    command : str
        `tautwave check RIG`, to which what would help is appended.
    """
    for room in ROOMS:
        sections = [
            Table(name, ("", ""), folded_rows(list(_facts(result)))),
            Table("", AXIS_HEADS, list(_axes(result, room.rows))),
            Table("", ("", ""), list(_verdicts(result.certificate))),
            Table("", ("", ""), list(_advice(result, room, command))),
            *last,
        ]
        if line_count(sections) <= LINES:
            break
    return [sections[0], _narrow(sections[1]), *sections[2:]]


def _narrow(axes: Table) -> Table:
    """Return the table of axes without columns of dashes; if too wide, without velocities too.

    If that is not enough, the names of many joints are their number.
    """
    kept = [at for at in range(len(AXIS_HEADS)) if any(row[at] != "-" for row in axes.rows)]
    table = _columns(axes, kept)
    if _too_wide(table):
        table = _columns(axes, [at for at in kept if AXIS_HEADS[at] != ">velocity"])
    if _too_wide(table):
        rows = [[_MANY.sub(r"\1: \2 axes", str(row[0])), *row[1:]] for row in table.rows]
        table = table._replace(rows=rows)
    return table


def _too_wide(table: Table) -> bool:
    return max(map(len, plain_lines(table)), default=0) > COLUMNS


_MANY = re.compile(r"(\w+)\.\S+ to \S+ \((\d+)\)")


def _columns(table: Table, kept: Sequence[int]) -> Table:
    rows = [[row[at] for at in kept] for row in table.rows]
    return Table(table.title, [table.columns[at] for at in kept], rows)


def _facts(result: Any) -> Iterator[Fact]:
    """Yield rate, coupling, buses and pairs, alike ones once."""
    facts = dict(result.facts)
    for label in ("rate", "coupling", "scales", "scene limit"):
        if label in facts:
            yield label, facts[label]
    yield from (one for one in result.facts if one[0].startswith("tissue "))
    if "claims" in facts:  # of an operated rig
        yield "claims", facts["claims"].partition(";")[0]
    ways: dict[str, list[str]] = {}
    for bus, way in result.ways.items():
        share = _share(result.budget.get(bus))
        ways.setdefault(f"{way.describe()}{share}", []).append(bus)
    for text, buses in list(ways.items())[:MAX_BUSES]:
        yield f"bus {spanned(buses)}", text
    if len(ways) > MAX_BUSES:
        more = [bus for buses in list(ways.values())[MAX_BUSES:] for bus in buses]
        yield f"bus {spanned(more)}", "see --verbose"
    yield from _pairs(result.pairs)


MAX_BUSES = 3
"""Kinds of buses that are shown."""


def _share(cost: Any) -> str:
    """Return how fast a bus could be, if that is known."""
    from tautwave.report.units import quantity

    if cost is None or not cost.time_s > 0.0:
        return ""
    rate = quantity(cost.greatest_rate_hz, "Hz", 3)
    return f"; {quantity(cost.time_s, 's', 3)} a cycle, up to {rate}"


def _pairs(rows: Sequence[tuple[str, ...]]) -> Iterator[Fact]:
    """Yield delay and standing offset of the pairs: alike ones once, or those of one unit."""
    groups: dict[tuple[str, ...], list[str]] = {}
    for name, *numbers in rows:
        groups.setdefault(tuple(numbers), []).append(name)
    if len(groups) > 2:
        by_unit: dict[str, list[tuple[str, ...]]] = {}
        for row in rows:
            by_unit.setdefault(row[2].rpartition(" ")[2], []).append(row)
        groups = {
            tuple(_range(column) for column in list(zip(*facts, strict=True))[1:]): [
                row[0] for row in facts
            ]
            for facts in by_unit.values()
        }
    for (delay, offset, share), names in groups.items():
        text = f"{delay} one way; held still, {offset} apart"
        yield f"pair {spanned(names)}", text if share == "100.0%" else f"{text}, {share} passed on"


def _range(texts: Sequence[str]) -> str:
    """Return texts that differ in their first number as one, from the least to the greatest."""
    least, most = min(texts, key=_leading), max(texts, key=_leading)
    if _leading(least) == _leading(most):
        return least
    return f"{least.partition(' ')[0]} to {most}"


def _leading(text: str) -> float:
    """Return the number with which a text begins; a word counts as none."""
    leading = re.match(r"-?[\d.]+(e[+-]?\d+)?", text)
    return float(leading[0]) if leading else -math.inf


class _Axis(NamedTuple):
    """A row of the table of axes; energies [J], inf without a bound, None where there is none."""

    takes: str
    limit: str
    prompt: float | None
    stall: float | None
    dead: float | None
    judged: str


def _axes(result: Any, most: int) -> Iterator[Sequence[str | Cell]]:
    """Yield a row for axes that are alike; if these are too many, for those that take the same."""
    claims = {claim.axis: claim for claim in result.claims}
    alike: dict[_Axis, list[str]] = {}
    for name, _, takes, up_to, _, limit in result.axes:
        one = claims.get(name)
        stated = None if one is None else one.stated
        energies: list[float | None] = [getattr(stated, key, None) for key in ENERGIES]
        if takes != "effort":
            up_to = takes
        judged = one.judged if one is not None and one.kinetic_j else ""
        axis = _Axis(up_to, limit, energies[0], energies[1], energies[2], judged)
        alike.setdefault(axis, []).append(name)
    groups = [([axis], names) for axis, names in alike.items()]
    if len(groups) > most:
        by_side: dict[tuple[str, str], tuple[list[_Axis], list[str]]] = {}
        for axis, names in alike.items():
            for name in names:
                key = (name.partition(".")[0], axis.takes.partition(" ")[2])
                alike_axes = by_side.setdefault(key, ([], []))
                alike_axes[0].append(axis)
                alike_axes[1].append(name)
        groups = list(by_side.values())
    for axes, names in groups:
        yield (
            axes_named(names),
            _range([axis.takes for axis in axes]),
            _range([axis.limit for axis in axes]),
            _energy([axis.prompt for axis in axes]),
            _energy([axis.stall for axis in axes]),
            _energy([axis.dead for axis in axes]),
            _judged([axis.judged for axis in axes]),
        )


ENERGIES = ("prompt_j", "let_go_j", "dead_j")
"""Of `Stated`: to a prompt host, what a device let go gains in a stall, by a dead host."""


def _energy(values: Sequence[float | None]) -> str:
    """Return the greatest of energies, and that it is the greatest."""
    from tautwave.report.units import quantity

    known = [value for value in values if value is not None]
    if not known:
        return "-"
    if math.inf in known:
        return "no bound"
    least = "<= " if len(set(known)) > 1 else ""
    return f"{least}{quantity(max(known), 'J', 3)}"


def _judged(states: Sequence[str]) -> str | Cell:
    """Return the worst of verdicts on claims."""
    if "refused" in states:
        return Cell("refused", BAD)
    if "conditional" in states:
        return Cell("depends", NOTE)
    return Cell("passed", GOOD) if "passed" in states else "-"


def _verdicts(certificate: Mapping[str, Any]) -> Iterator[tuple[str | Cell, ...]]:
    """Yield a line for each verdict."""
    verdicts = certificate.get("verdicts")
    if not isinstance(verdicts, Mapping) or not verdicts:
        yield "passive", verdict(certificate.get("passed"))
        return
    for name, judged in verdicts.items():
        required = " (required)" if name == certificate.get("require") else ""
        says = verdict(judged["passed"], judged["state"])
        if judged["passed"] and judged["conditions"]:
            count = len(judged["conditions"])
            says = Cell(f"{says.text}: depends on {count} condition{'s'[: count > 1]}", says.level)
        yield f"{str(name).replace('_', ' ')}{required}", says


def _advice(result: Any, room: Room, command: str) -> Iterator[tuple[str | Cell, ...]]:
    """Yield what a person has to decide or see to, and what would make the rig better most."""
    decide = list(_open(result))
    for text in decide[: room.kinds]:
        yield "decide", Cell(folded("decide", text, ADVICE, room.lines), NOTE)
    if len(decide) > room.kinds:
        yield "", Cell(f"and {len(decide) - room.kinds} more: --verbose", FAINT)
    best = result.improvement
    if best is None:
        return
    on, text = best
    if on != "hint on claims":
        text = f"{on.removeprefix('hint on ')}: {text}"
    shown = folded("improve", text, ADVICE, room.lines)
    remedy = ""
    if shown.endswith("...") and not best.change:  # what to do may not be cut off
        text, _, remedy = text.rpartition("; ")
        shown = folded("improve", text, ADVICE, room.lines)
    yield "improve", shown
    if remedy:
        yield "", remedy
    if best.change:
        typed = (f"{one} --set {best.change}" for one in (command, "tautwave check RIG"))
        fit = (one for one in typed if len(one) <= COLUMNS - ADVICE - 4)
        yield "", next(fit, f"--set {best.change}")


ADVICE = len("improve")
_SPECIFIC = re.compile(
    r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?|\b(?:master|slave)\.[\w-]+|\bbus [\w-]+"
)
"""Numbers, axes and buses, in which texts of one kind differ."""

_FOLDER = re.compile(r"(?<!\S)/\S*/")
"""Before a file's name: a screen has no room for it."""


def _refused(claims: Sequence[Any]) -> Iterator[str]:
    """Yield the claims that are refused, one sentence for each."""
    said = {claim.refusal: claim.axis for claim in reversed(claims) if claim.refusal}
    for refusal, axis in reversed(said.items()):
        about = "" if axis in refusal else f"{axis}: "
        yield f"claim refused: {about}{refusal}"


def _open(result: Any) -> Iterator[str]:
    """Yield what devices' files foresee and conditions of the required verdict, of a kind once."""
    notes = [
        _FOLDER.sub("", text)
        for label, text in result.facts
        if re.fullmatch(r"bus .*, note \d+", label)
    ]
    certificate = result.certificate
    required = (certificate.get("verdicts") or {}).get(certificate.get("require"))
    conditions = required["conditions"] if required and required["passed"] else []
    if required and required["passed"]:
        # What is required does not ask for what the axes may supply: it may run all the same.
        conditions = [*_refused(result.claims), *conditions]
    kinds: dict[str, list[str]] = {}
    for text in [*notes, *conditions]:
        kinds.setdefault(_SPECIFIC.sub("#", text), []).append(text)
    for same in kinds.values():
        yield same[0] if len(same) == 1 else f"{same[0]} ({len(same)} alike)"
