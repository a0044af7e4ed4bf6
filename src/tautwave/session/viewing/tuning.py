"""A run whose numbers viewers may change: its knobs, its desk, and what is kept of it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tautwave.config import Rig
from tautwave.rig import Assembly
from tautwave.rig.tuning import knobs_of, tunables
from tautwave.runtime.control import Control
from tautwave.runtime.loop import TIMING_COLUMNS
from tautwave.runtime.operate.journal import Entry
from tautwave.runtime.operate.operated import OperatedControl
from tautwave.runtime.tuning.desk import ParameterPage
from tautwave.runtime.tuning.source import Tuning


@contextmanager
def tuning_of(rig: Rig, assembly: Assembly, allowed: bool) -> Iterator[Tuning | None]:
    """Give a run its knobs and their desk, if tuning is allowed."""
    if not allowed:
        yield None
        return
    control: Control = assembly.control
    knobs = knobs_of(rig, control)
    tuning = Tuning(knobs, ParameterPage(len(knobs)), rig.period_s)
    if isinstance(control, OperatedControl):
        tuning.note = lambda at_s, text: control.journal.note(
            Entry(at_s, "tune", "viewer", control.standing.state, text)
        )
    try:
        yield tuning
    finally:
        tuning.desk.close()


def with_tuning(assembly: Assembly, tuning: Tuning | None) -> Assembly:
    """Return the assembly with the columns of its knobs, which turn after each row."""
    if tuning is None:
        return assembly
    sources = [*assembly.sources, tuning]
    columns = [*TIMING_COLUMNS, *(name for source in sources for name in source.columns)]
    return assembly._replace(sources=sources, columns=columns)


def tuning_facts(rig: Rig, tuning: Tuning | None, hardware: list[str]) -> dict[str, Any] | None:
    """Return what viewers need to know of the knobs, and of keys that have none in this run."""
    if tuning is None:
        return None
    knobs = [
        {key: value for key, value in knob._asdict().items() if key != "turning"}
        for knob in tuning.knobs
    ]
    turned = {knob.path for knob in tuning.knobs}
    fixed = [
        {"path": path, "when": "between runs", "value": value}
        for path, _, value in tunables(rig)
        if path not in turned
    ]
    return {"desk": tuning.desk.address, "knobs": knobs, "fixed": fixed, "hardware": hardware}
