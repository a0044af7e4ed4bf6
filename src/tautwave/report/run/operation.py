"""Tables of what people did with an operated rig: episodes, and the journal."""

from __future__ import annotations

from tautwave.report.run.rundir import Run
from tautwave.report.units import count, plural, quantity
from tautwave.runtime.operate.journal import said_of
from tautwave.summary.model import Operation
from tautwave.summary.repeats import collapsed
from tautwave.tables import Table

MOST = 60
"""Entries of the journal that a page has; summary.json has all."""


def _operation(run: Run) -> Operation:
    return run.result.operation or Operation()


def episode_table(run: Run) -> Table:
    """Return the episodes: name, task, what was said of it, when, how long."""
    rows = tuple(
        (
            str(one.number),
            one.name,
            one.task or "–",
            said_of(one.success, one.discarded),
            quantity(one.begin_s, "s"),
            quantity(one.end_s - one.begin_s, "s"),
        )
        for one in _operation(run).episodes
    )
    return Table("Episodes", ("", "name", "task", "verdict", "began", "took"), rows)


def journal_table(run: Run) -> Table:
    """Return what was asked, what followed, and why not."""
    operation = _operation(run)
    entries = collapsed(operation.journal)
    rows = tuple(
        (
            quantity(one.at_s, "s"),
            one.word,
            one.source,
            "refused" if one.refused else one.state,
            f"{one.text or '–'}{_again(times, last)}",
        )
        for one, times, last in entries[:MOST]
    )
    times = plural(operation.engagements, "time")
    note = f"Engaged {times}, {quantity(operation.engaged_s, 's')} in all."
    if len(entries) > MOST:
        note += (
            f" The first {MOST} of {count(len(entries))} kinds of entries; summary.json has all."
        )
    return Table("Journal", ("at", "", "from", "then", ""), rows, note)


def _again(times: int, last: float) -> str:
    return f" (x {count(times)}, last {quantity(last, 's')})" if times > 1 else ""
