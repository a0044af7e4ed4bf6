"""`simulate`, compiled, against the same algorithm in plain C."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.bench.result import Goal, Table
from tautwave.bench.rigs import BenchRig


def simulate_costs(rigs: Sequence[BenchRig], rounds: int) -> tuple[Table, list[Goal]]:
    """Return the table of both engines and the goals on their ratio."""
    goals = [
        Goal(f"simulate, {rig.name}: compiled / plain C", 1.3, "times", None, why_not="no engine")
        for rig in rigs
    ]
    return Table("simulate", "not measured", ("rig",), []), goals
