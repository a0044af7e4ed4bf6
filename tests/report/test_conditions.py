"""Conditions of a certificate that a run did not keep, each as its rows tell."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave.laws.limit import AT_LIMIT, CLIPPED, RATE_LIMITED
from tautwave.report.run.conditions import broken_conditions
from tautwave.report.run.rundir import engaged_s
from tautwave.runtime.operate.states import ENGAGED, STATES

ROWS = 10


def run_of(condition: str, **columns: Any) -> Any:
    """Return what is looked at of a run whose certificate depends on a condition."""
    verdict = SimpleNamespace(conditions=[condition])
    certificate = SimpleNamespace(verdicts={"passive": verdict})
    known = {name.replace("__", "."): np.asarray(values, float) for name, values in columns.items()}

    def read(*names: str) -> dict[str, Any]:
        return {name: known[name] for name in names if name in known}

    result = SimpleNamespace(certificate=certificate)
    return SimpleNamespace(
        result=result, read=read, sides=("master", "slave"), rate_hz=500.0, rows=ROWS
    )


@pytest.mark.parametrize(
    ("condition", "bit"),
    [
        ("the effort_rate_limit of slave.lever is not reached in the coupling", RATE_LIMITED),
        ("the coupling of lever asks for no more than 1 N m", CLIPPED),
        ("the motor of slave.lever is not at its effort_limit while it moves", AT_LIMIT),
    ],
)
def test_a_limit_that_was_met_is_counted_in_cycles(condition: str, bit: int) -> None:
    met = [0.0] * 7 + [float(bit)] * 3
    (sentence,) = broken_conditions(run_of(condition, slave__lever__limited=met))
    assert sentence.endswith("it was violated in 3 of 10 cycles.")
    others = sum({AT_LIMIT, CLIPPED, RATE_LIMITED} - {bit})
    assert not list(broken_conditions(run_of(condition, slave__lever__limited=[others] * ROWS)))


def test_what_no_row_can_tell_is_not_judged() -> None:
    assert not list(broken_conditions(run_of("the inertia of slave.lever is at least 2e-4")))


def test_engaged_time_is_of_the_rows_in_that_state() -> None:
    states = [STATES.index(ENGAGED)] * 4 + [0] * 6
    assert engaged_s(run_of("", operation__state=states)) == pytest.approx(4 / 500.0)
    assert engaged_s(run_of("")) is None
