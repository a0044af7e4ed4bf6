"""One end of the coupling, thought through: order of wall, port and limits; any float comes in."""

from __future__ import annotations

import math

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.coupler import coupler_effort, coupler_stored
from tautwave.laws.site import SiteParams, wall_ahead
from tautwave.laws.wall import WallParams, wall_depth
from tests.runtime.parts import WIDE, Axis, site

anything = st.floats(allow_nan=True, allow_infinity=True)
usual = st.floats(-1e3, 1e3)
WALL = WallParams(0.0, 1.0, 1000.0, 2.0, controlled=False)


def moving(
    axis: Axis,
    energy: float,
    position: float,
    velocity: float,
    wall_velocity: float,
    impulse: float,
    pending: float,
    last: float,
) -> Axis:
    """Return an axis, of one period of command delay, in the midst of a motion."""
    s = axis.state
    s.wall_contact_energy, s.position, s.velocity = energy, position, velocity
    s.wall_velocity, s.impulse, s.total = wall_velocity, impulse, last
    s.depth = wall_depth(axis.params.site.wall, position)
    axis.table[0] = pending
    return axis


def think_wave(
    axis: Axis, account: float, *motion: float, arriving: float, ceiling: float
) -> tuple[float, float, float, float]:
    """Return effort sent, its parts by port and wall, effort asked for."""
    moving(axis, *motion)
    e = axis.state.end
    e.account, e.wave_in = account, arriving
    s = axis.state
    e.velocity = s.velocity - axis.params.site.half_mobility * s.impulse
    axis.think(ceiling)
    return s.total, s.port_effort, s.wall_effort, s.asked


def think_position(
    axis: Axis, *motion: float, far: tuple[float, float], ceiling: float
) -> tuple[float, float, float, float]:
    """Return effort sent, its parts by coupler and wall, effort asked for."""
    moving(axis, *motion)
    axis.state.end.far_position, axis.state.end.far_velocity = far
    axis.think(ceiling)
    s = axis.state
    return s.total, s.port_effort, s.wall_effort, s.asked


@given(st.lists(anything, min_size=8, max_size=8), st.floats(0.0, 5.0), st.booleans())
@example([math.nan] * 8, 1.0, True)
@example([math.inf] * 8, 1.0, False)
@example([-math.inf] * 8, 1.0, True)
@example([-0.0] * 8, 0.0, True)
def test_no_float_gets_past_the_limits(values: list[float], last: float, controlled: bool) -> None:
    """None gets past the effort limit, and past the engage ramp only what the device ran into."""
    limit = WIDE._replace(effort=5.0, effort_quantum=0.25)
    wall = WALL._replace(controlled=controlled)
    account, *motion, arriving = values
    axis = site(limit=limit, wall=wall, delay=1)
    reported = think_wave(axis, account, *motion, last, arriving=arriving, ceiling=4.0)
    total, port, share, _ = reported
    assert abs(total) <= 5.0
    assert abs(total) <= 4.0 or total * axis.state.position > 0.0
    assert math.isfinite(port)
    assert math.isfinite(share)
    assert port + share == pytest.approx(total, abs=1e-9)
    axis = site(limit=limit, wall=wall, delay=1, spring=(100.0, 2.0))
    far = (account, arriving)
    total, port, share, _ = think_position(axis, *motion, last, far=far, ceiling=4.0)
    assert abs(total) <= 5.0
    assert abs(total) <= 4.0 or total * axis.state.position > 0.0
    assert math.isfinite(port + share)


@given(anything, anything, anything, anything)
def test_no_float_gets_past_the_velocity_limit(
    position: float, effort: float, pending: float, arriving: float
) -> None:
    for quantum in (0.0, 0.35, 0.3):
        for ceiling in (1.0, 0.2, 5.0):
            axis = site(
                admittance=True, wall=WALL, limit=WIDE._replace(velocity=1.0), delay=1,
                velocity_quantum=quantum,
            )  # fmt: skip
            s = axis.state
            s.position, s.outside, s.end.wave_in = position, effort, arriving
            axis.table[0] = pending
            axis.think(ceiling)
            assert abs(s.command) <= min(1.0, ceiling)
            if quantum:
                assert s.command / quantum == pytest.approx(round(s.command / quantum))
            assert math.isfinite(s.wall_effort)


@given(usual, st.floats(-10, 10), st.floats(-1, 1), usual)
def test_free_motion_is_the_port_alone(
    position: float, velocity: float, arriving: float, last: float
) -> None:
    motion = (0.0, position, velocity, velocity, 0.3, 0.1, last)
    near, far = site(wall=WALL._replace(position=2e3), delay=1), site(delay=1)
    reported = [
        think_wave(it, 1.0, *motion, arriving=arriving, ceiling=math.inf) for it in (near, far)
    ]
    assert reported[0] == reported[1]


def test_the_port_knows_what_the_wall_will_do() -> None:
    """Known efforts go into the prediction: with the wall at 2 N the device will be slower."""
    axis = site(b=10.0, mass=0.5, wall=WALL._replace(damping=0.0), delay=1)
    p = axis.params.end
    mobility = axis.params.site.half_mobility
    total, port, wall, asked = think_wave(
        axis, 1e9, 0.0, 0.002, 0.3, 0.3, 0.5, 0.7, 0.0, arriving=0.1, ceiling=math.inf
    )
    free_velocity = 0.3 - mobility * (0.5 + 2 * 0.7) - mobility * 2.0
    assert wall == pytest.approx(2.0)
    assert port == pytest.approx((10.0 * free_velocity - p.port.root * 0.1) / p.port.divisor)
    assert total == asked == wall + port


def test_coupler_is_a_spring_and_a_damper() -> None:
    assert coupler_effort(100.0, 2.0, 0.03, 0.5, 0.01, 0.1) == pytest.approx(2.0 + 0.8)
    assert coupler_stored(100.0, 0.03, 0.01) == pytest.approx(0.02)
    motion = (0.0, 0.03, 0.5, 0.5, 0.0, 0.0, 0.0)
    axis = site(spring=(100.0, 2.0), delay=1)
    total, port, wall, asked = think_position(axis, *motion, far=(0.01, 0.1), ceiling=math.inf)
    assert (total, port, asked) == pytest.approx((2.8, 2.8, 2.8))
    assert wall == 0.0


def test_what_a_clip_cuts_off_still_counts_as_asked_for() -> None:
    """So a limit does not rise while a coupling is clipped."""
    motion = (0.0, 0.03, 0.5, 0.5, 0.0, 0.0, 0.0)
    axis = site(spring=(100.0, 2.0), delay=1, limit=WIDE._replace(effort=50.0))
    axis.params = axis.params._replace(site=axis.params.site._replace(clip=1.0))
    total, port, _, asked = think_position(axis, *motion, far=(0.01, 0.1), ceiling=25.0)
    assert (total, port, asked) == pytest.approx((0.5, 0.5, 2.8))


def test_under_a_limit_wall_and_coupler_share_what_is_sent() -> None:
    """Their shares add up to it; a coupler that pushes with the wall gives way first."""
    stiff = WALL._replace(damping=0.0)
    for limit, want in ((5.0, (5.0, 3.0, 2.0)), (1.5, (1.5, 0.0, 1.5))):
        # 2 mm deep: the wall pushes with 2 N, the coupler, 4 mm from its other end, with 8 N.
        deep = (0.0, 0.002, 0.0, 0.0, 0.0, 0.0, 0.0)
        made = {"wall": stiff, "limit": WIDE._replace(effort=limit), "spring": (2000.0, 0.0)}
        total, port, wall, asked = think_position(
            site(delay=1, **made), *deep, far=(-0.002, 0.0), ceiling=math.inf
        )
        assert asked == pytest.approx(min(2.0, limit) + 8.0)
        assert (total, port, wall) == pytest.approx(want)
        # A coupler that pulls against the wall keeps what it planned; the wall gives way.
        total, port, wall, _ = think_position(
            site(delay=1, **made), *deep, far=(0.0025, 0.0), ceiling=math.inf
        )
        assert port == pytest.approx(-1.0)
        assert wall == pytest.approx(total + 1.0)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_wall_ahead_pushes_from_where_a_velocity_will_act(side: float) -> None:
    wall = WALL._replace(position=side * 0.01, side=side)
    p = SiteParams(1e-3, 0.0, wall, WIDE, 1.0, 0.0, has_wall=True)
    assert wall_ahead(p, side * 0.009, 0.0) == (0.0, 0.0, 0.0)
    push, stiffness, damping = wall_ahead(p, side * 0.009, side * 3.0)  # 3 mm further: 2 mm deep
    assert push == pytest.approx(side * 1000.0 * 0.002)
    assert (stiffness, damping) == (1000.0, 2.0)
