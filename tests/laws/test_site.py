"""One end of the coupling, thought through: order of wall, port and limits; any float comes in."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.coupler import coupler_effort, coupler_stored
from tautwave.laws.site import SiteParams, think_admittance, think_position, think_wave
from tautwave.laws.wall import WallParams
from tests.runtime.parts import WIDE, site

anything = st.floats(allow_nan=True, allow_infinity=True)
usual = st.floats(-1e3, 1e3)
WALL = WallParams(0.0, 1.0, 1000.0, 2.0, controlled=False)


def params(**changes: object) -> SiteParams:
    return site(**changes).params.site  # type: ignore[arg-type]


@given(st.lists(anything, min_size=8, max_size=8), st.floats(0.0, 5.0), st.booleans())
@example([math.nan] * 8, 1.0, True)
@example([math.inf] * 8, 1.0, False)
@example([-math.inf] * 8, 1.0, True)
@example([-0.0] * 8, 0.0, True)
def test_no_float_gets_past_the_limits(values: list[float], last: float, controlled: bool) -> None:
    limit = WIDE._replace(effort=5.0, effort_quantum=0.25)
    p = params(limit=limit, wall=WALL._replace(controlled=controlled))
    total, port, wall, _, _ = think_wave(p, *values, last, 4.0)
    assert abs(total) <= 4.0
    assert math.isfinite(port)
    assert math.isfinite(wall)
    assert port + wall == pytest.approx(total, abs=1e-9)
    total, port, wall, _ = think_position(p, *values, last, 4.0)
    assert abs(total) <= 4.0
    assert math.isfinite(port + wall)


@given(anything, anything, anything, anything)
def test_no_float_gets_past_the_velocity_limit(
    position: float, effort: float, pending: float, arriving: float
) -> None:
    for quantum in (0.0, 0.35, 0.3):
        p = params(
            admittance=True, wall=WALL, limit=WIDE._replace(velocity=1.0), velocity_quantum=quantum
        )
        for ceiling in (1.0, 0.2, 5.0):
            velocity, wall, _ = think_admittance(p, position, effort, pending, arriving, ceiling)
            assert abs(velocity) <= min(1.0, ceiling)
            if quantum:
                assert velocity / quantum == pytest.approx(round(velocity / quantum))
            if math.isfinite(position + pending):
                assert math.isfinite(wall)


@given(usual, st.floats(-10, 10), st.floats(-1, 1), usual)
def test_free_motion_is_the_port_alone(
    position: float, velocity: float, arriving: float, last: float
) -> None:
    p = params(wall=WALL._replace(position=2e3))
    q = params()
    args = (1.0, 0.0, position, velocity, velocity, 0.3, 0.1, arriving, last, math.inf)
    assert think_wave(p, *args) == think_wave(q, *args)


def test_the_port_knows_what_the_wall_will_do() -> None:
    """Known efforts go into the prediction: with the wall at 2 N the device will be slower."""
    p = params(b=10.0, mass=0.5, wall=WALL._replace(damping=0.0))
    mobility = p.port.half_mobility
    total, port, wall, asked, ahead = think_wave(
        p, 1e9, 0.0, 0.002, 0.3, 0.3, 0.5, 0.7, 0.1, 0.0, math.inf
    )
    coast = 0.3 - mobility * (0.5 + 2 * 0.7) - mobility * 2.0
    assert wall == pytest.approx(2.0)
    assert port == pytest.approx((10.0 * coast - p.port.root * 0.1) / p.port.divisor)
    assert ahead == pytest.approx(coast - mobility * port)
    assert total == asked == wall + port


def test_coupler_is_a_spring_and_a_damper() -> None:
    assert coupler_effort(100.0, 2.0, 0.03, 0.5, 0.01, 0.1) == pytest.approx(2.0 + 0.8)
    assert coupler_stored(100.0, 0.03, 0.01) == pytest.approx(0.02)
    p = params()._replace(stiffness=100.0, damping=2.0)
    total, port, wall, asked = think_position(
        p, 0.0, 0.03, 0.5, 0.5, 0.0, 0.0, 0.01, 0.1, 0.0, math.inf
    )
    assert (total, port, asked) == pytest.approx((2.8, 2.8, 2.8))
    assert wall == 0.0


def test_under_a_limit_wall_and_coupler_share_what_is_sent() -> None:
    """Their shares add up to it; a coupler that pushes with the wall gives way first."""
    stiff = WALL._replace(damping=0.0)
    for limit, want in ((5.0, (5.0, 3.0, 2.0)), (1.5, (1.5, 0.0, 1.5))):
        p = params(wall=stiff, limit=WIDE._replace(effort=limit))._replace(stiffness=2000.0)
        # 2 mm deep: the wall pushes with 2 N, the coupler, 4 mm from its other end, with 8 N.
        args = (0.0, 0.002, 0.0, 0.0, 0.0, 0.0, -0.002, 0.0, 0.0, math.inf)
        total, port, wall, asked = think_position(p, *args)
        assert asked == pytest.approx(min(2.0, limit) + 8.0)
        assert (total, port, wall) == pytest.approx(want)
        # A coupler that pulls against the wall keeps what it planned; the wall gives way.
        pulls = (0.0, 0.002, 0.0, 0.0, 0.0, 0.0, 0.0025, 0.0, 0.0, math.inf)
        total, port, wall, _ = think_position(p, *pulls)
        assert port == pytest.approx(-1.0)
        assert wall == pytest.approx(total + 1.0)
