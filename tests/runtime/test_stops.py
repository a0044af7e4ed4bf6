"""What a stop says: the axis, the limit it passed and what it measured, with their units."""

from __future__ import annotations

import math

import pytest

from tautwave.controller.stops import guard_sentence, overrun_sentence, unarmed_sentence
from tautwave.laws.limit import RUNAWAY, LimitParams

LIMIT = LimitParams(2.0, 0.1, 0.0, 0.5, -math.inf, 0.25, 1.0)


@pytest.mark.parametrize(
    ("code", "passed"),
    [
        (1, "left its position range of -inf to 0.25 m at 1.500 s"),
        (2, "exceeded its velocity limit of 0.5 m/s at 1.500 s"),
        (3, "is not finite at 1.500 s"),
        (RUNAWAY, "over a million times its limit of 2 N at 1.500 s"),
    ],
)
def test_a_guard_names_its_limit_with_units(code: int, passed: str) -> None:
    reported = guard_sentence("slave.a", code, "m", LIMIT, 0.3, -0.75, 1.5)
    assert reported.startswith("slave.a ")
    assert reported.endswith(f"{passed}: position 0.3 m, velocity -0.75 m/s")


def test_what_keeps_pairs_from_engaging_is_measured_against_named_limits() -> None:
    reported = unarmed_sentence([("master.a", "rad", LIMIT), ("slave.a", "m", LIMIT)])
    assert "10% of its effort limit (master.a 2 N m, slave.a 2 N) while standing" in reported


def test_an_overrun_says_what_was_allowed() -> None:
    reported = overrun_sentence(60, 50, 1e-3, 2.25)
    assert reported.startswith("60 slots of 1 ms were missed in a row at 2.250 s")
    assert "(loop.overrun_limit: 50)" in reported
