"""The host's cost of one exchange on each bus: every installed driver measures its own."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

from tautwave import registry
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.contracts import CycleCost

WHAT = (
    "wall time of one exchange of two axes on the host, devices excluded unless named; "
    "floor: a bare exchange of the same bytes, in turn with it in the same run; all of it on one "
    "processor"
)


@contextmanager
def one_processor() -> Iterator[None]:
    """Pin this process and its children to one processor, if possible.

    Otherwise the scheduler decides whether both ends of an exchange share a processor for a whole
    run, and waking another processor takes as long as the exchange itself.
    """
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def buses(*, cycles: int = 2000, tell: Callable[[str], None] = lambda _: None) -> Suite:
    """Measure the exchange of every installed driver that can.

    Parameters
    ----------
    cycles : int
        Exchanges per figure.
    tell : callable
        Called with the name of each measurement as it starts.
    """
    tables: list[Table] = []
    goals: list[Goal] = []
    for name in registry.driver_names():
        plugin = registry.load_driver(name)
        missing = registry.missing_modules(plugin.needs)
        if missing:
            why = f"{', '.join(missing)} is not installed"
            costs: Sequence[CycleCost] = [CycleCost(f"{name} exchange", why_not=why)]
        else:
            tell(f"{name}, {cycles} exchanges")
            with one_processor():
                costs = plugin.measure(cycles)
        if not costs:
            continue
        tables.append(_table(name, costs))
        goals.extend(goal for cost in costs if (goal := _goal(name, cost)) is not None)
    return Suite("buses", tables, goals)


def _table(name: str, costs: Sequence[CycleCost]) -> Table:
    columns = ("exchange", "min_us", "p50_us", "p99_us", "floor_p50_us", "ratio")
    return Table(f"Bus {name}", WHAT, columns, [_row(cost) for cost in costs])


def _row(cost: CycleCost) -> Sequence[Value]:
    if not cost.spent_us:
        return (f"{cost.what}: {cost.why_not}", None, None, None, None, None)
    floor = _share(cost.floor_us, 0.5) if cost.floor_us else None
    median = _share(cost.spent_us, 0.5)
    return (
        cost.what,
        min(cost.spent_us),
        median,
        _share(cost.spent_us, 0.99),
        floor,
        None if floor is None else median / floor,
    )


def _goal(name: str, cost: CycleCost) -> Goal | None:
    median = _share(cost.spent_us, 0.5) if cost.spent_us else None
    what = f"{name}: {cost.what}"
    if cost.goal_us is not None:
        return Goal(f"{what}, p50", cost.goal_us, "us", median, why_not=cost.why_not)
    if cost.goal_ratio is not None:
        ratio = None
        if median is not None and cost.floor_us:
            ratio = median / _share(cost.floor_us, 0.5)
        return Goal(f"{what}, p50 over its floor", cost.goal_ratio, "", ratio, why_not=cost.why_not)
    return None


def _share(values: Sequence[float], share: float) -> float:
    return sorted(values)[int(share * len(values))]  # a share below 1
