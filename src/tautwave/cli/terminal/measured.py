"""Tables and goals of `tautwave bench`, for people or as JSON."""

from __future__ import annotations

from typing import Any

import click

from tautwave.cli.options import echo_json
from tautwave.cli.terminal.show import show
from tautwave.tables import BAD, GOOD, NOTE, Cell, Table


def print_suites(suites: list[Any], as_json: bool) -> None:
    """Print the tables and goals of suites, or all numbers as JSON."""
    results = [suite.as_dict() for suite in suites]
    if as_json:
        echo_json(results[0] if len(results) == 1 else {"suites": results})
        return
    for number, result in enumerate(results):
        if number == 0:
            click.echo(", ".join(f"{key} {value}" for key, value in result["machine"].items()))
        for table in result["tables"]:
            click.echo()
            _print_table(table)
    goals = [goal for result in results for goal in result["goals"]]
    if goals:
        click.echo()
        show([_goal_section(goals)])


def _print_table(table: dict[str, Any]) -> None:
    rows = table["rows"]
    columns = list(rows[0]) if rows else []
    words = {name for name in columns if all(isinstance(row[name], str) for row in rows)}
    heads = [heading(name) if name in words else f">{heading(name)}" for name in columns]
    cells = [[figure(row[name]) for name in columns] for row in rows]
    show([Table(table["title"], heads, cells, table["what"])])


def _goal_section(goals: list[dict[str, Any]]) -> Table:
    rows: list[list[str | Cell]] = []
    for goal in goals:
        relation = ">=" if goal["at_least"] else "<="
        verdict = {True: Cell("met", GOOD), False: Cell("not met", BAD)}.get(
            goal["met"], Cell(goal["why_not"] or "not measured", NOTE)
        )
        measured = "measured " + figure(goal["measured"])
        rows.append(
            [f"{goal['name']} {relation} {goal['limit']:g} {goal['unit']}:", measured, verdict]
        )
    return Table("Goals", ("", "", ""), rows)


def heading(column: str) -> str:
    """Return a column's name with its unit in brackets: `p50_us` is `p50 [us]`."""
    name, _, unit = column.rpartition("_")
    per = {"mb_per_h": "MB/h"}
    for suffix, text in per.items():
        if column.endswith("_" + suffix):
            return f"{column.removesuffix('_' + suffix).replace('_', ' ')} [{text}]"
    if name and unit in ("ns", "us", "s", "mb"):
        return f"{name.replace('_', ' ')} [{unit.replace('mb', 'MB')}]"
    return column.replace("_", " ")


def figure(value: Any) -> str:
    """Return a measured number with its significant digits: three, or all before the point."""
    if value is None:
        return "-"
    if not isinstance(value, float):
        return str(value)
    if 100.0 <= abs(value) < 1e7:
        return f"{value:.0f}"
    return f"{value:.3g}"
