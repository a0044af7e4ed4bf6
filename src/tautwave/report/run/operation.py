"""Tables of what people did with an operated rig: episodes, and the journal."""

from __future__ import annotations

from tautwave.report.run.rundir import Run, block
from tautwave.report.run.tables import Table
from tautwave.report.units import count, plural, quantity
from tautwave.runtime.operate.journal import said_of

MOST = 60
"""Entries of the journal that a page has; summary.json has all."""


def episode_table(run: Run) -> Table:
    """Return the episodes: name, task, what was said of it, when, how long."""
    rows = tuple(
        (
            str(one["number"]),
            str(one["name"]),
            str(one["task"] or "–"),
            said_of(one["success"]),
            quantity(one["begin_s"], "s"),
            quantity(one["end_s"] - one["begin_s"], "s"),
        )
        for one in block(run.summary, "operation").get("episodes", ())
    )
    return Table("Episodes", ("", "name", "task", "verdict", "began", "took"), rows)


def journal_table(run: Run) -> Table:
    """Return what was asked, what followed, and why not."""
    operation = block(run.summary, "operation")
    entries = operation.get("journal", [])
    rows = tuple(
        (
            quantity(one["at_s"], "s"),
            str(one["word"]),
            str(one["source"]),
            "refused" if one["refused"] else str(one["state"]),
            str(one["text"] or "–"),
        )
        for one in entries[:MOST]
    )
    times = plural(int(operation.get("engagements", 0)), "time")
    note = f"Engaged {times}, {quantity(operation.get('engaged_s'), 's')} in all."
    if len(entries) > MOST:
        note += f" The first {MOST} of {count(len(entries))} entries; summary.json has all."
    return Table("Journal", ("at", "", "from", "then", ""), rows, note)
