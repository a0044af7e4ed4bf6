"""Numbers out of all proportion are refused where they stand, not where they overflow."""

from __future__ import annotations

import pytest

from tautwave.config import parse_rig
from tautwave.config.keys.common import GREATEST, LEAST
from tautwave.errors import ConfigError
from tests.config.bench import BENCH


@pytest.mark.parametrize("value", ["1e300", "-1e300", "1e-300", "1.1e15", "9e-101"])
@pytest.mark.parametrize(
    ("key", "wrap"),
    [
        ("slave.axes.wrist.effort_limit", "{}"),
        ("coupling.pairs.wrist.position_scale", "{}"),
        ("slave.axes.wrist.inertia.lower", "{}"),
        ("slave.axes.wrist.position_range", "[-3e300, {}]"),
        ("coupling.release_ramp_s", "{}"),
    ],
)
def test_a_number_beyond_any_unit_is_refused_with_its_place(
    key: str, wrap: str, value: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        parse_rig(BENCH, overrides=[f"{key}={wrap.format(value)}"])
    assert all(problem.startswith(f"--set {key}") for problem in caught.value.problems)
    assert "(got " in str(caught.value)


@pytest.mark.parametrize("value", [LEAST, GREATEST])
def test_the_bounds_themselves_are_numbers(value: float) -> None:
    rig = parse_rig(BENCH, overrides=[f"slave.axes.wrist.effort_limit={value!r}"])
    assert rig.slave.axes["wrist"].effort_limit == value
