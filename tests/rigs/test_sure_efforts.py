"""Efforts up to which the bound for stalls is not even computed: it would bind at no velocity."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.ramp import stall_ceiling
from tautwave.rig import axis_params, command_delays
from tests.certificate.rigs import rig

LATE = ("buses.bench.options={command_delay_s: 0.0015}", "loop.overrun_limit=20")


@pytest.fixture(scope="module", params=[(), LATE], ids=["prompt", "late"])
def axis(request):
    loaded = rig(*request.param, name="bench-1dof-2khz")
    return axis_params(loaded, "master.lever", command_delays(loaded)["master.lever"], 0)


@given(st.floats(-15.0, 15.0), st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=8),
       st.integers(1, 31), st.sampled_from([-1.0, 1.0]))  # fmt: skip
@example(-15.0, [1.0] * 8, 20, 1.0)
@example(15.0, [-1.0] * 8, 20, -1.0)
def test_below_it_the_bound_does_not_bind(
    axis, velocity: float, shares: list[float], slots: int, side: float
) -> None:
    """Whatever acted since the sample before the last one, and whatever is under way."""
    site, limit = axis.site, axis.site.limit.effort
    impulse = slots * limit * shares[0]
    pending = limit * sum(shares[: axis.delay])
    free_velocity = velocity - site.half_mobility * (impulse + 2.0 * pending)
    assert (
        stall_ceiling(site.stall, velocity, free_velocity, side * site.sure, math.inf) >= site.sure
    )


def test_it_is_a_good_part_of_the_effort_and_all_of_it_without_a_bound(axis) -> None:
    assert 0.2 * axis.site.limit.effort < axis.site.sure < axis.site.limit.effort
    free = rig("loop.overrun_limit=200", name="bench-1dof-2khz")
    bare = axis_params(free, "master.lever", command_delays(free)["master.lever"], 0)
    assert bare.site.sure == math.inf
