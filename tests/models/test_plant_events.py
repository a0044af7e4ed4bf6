from __future__ import annotations

import math

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tautwave.models.crossing import first_rise, isolation_limit, motion_bounds
from tautwave.models.linear import flow_increment
from tautwave.models.plant import FREE, plant_cache, plant_step
from tests.examples import tried
from tests.models.brute import brute_step
from tests.models.compiled import compiled
from tests.models.plants import STEP, plant

CASES = {
    "wall": plant(0.1, 0.1, 0.0, (538.0, 5.0), wall=(1e4, 6.0, 0.0, 1.0)),
    "soft wall, strong damper": plant(0.1, 0.0, 0.0, (538.0, 0.0), wall=(200.0, 30.0, 0.0, -1.0)),
    "friction": plant(0.1, 0.1, 0.4, (538.0, 5.0)),
    "all": plant(0.1, 0.1, 0.4, (538.0, 5.0), (50.0, 0.01), (1e5, 20.0, 0.0, 1.0)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_motion_is_that_of_tiny_steps(name: str) -> None:
    p = CASES[name]
    brute = compiled(brute_step)
    c = plant_cache(p, STEP)
    x, v, mode, ref = -0.001, 0.0, FREE, -0.001
    events = set()
    for k in range(120):
        effort = 0.8 * math.sin(0.9 * k)
        rate = 0.35 * math.cos(0.13 * k)
        bx, bv = brute(p, x, v, effort, ref, rate, STEP, 100_000)
        x, v, mode, *_ = plant_step(p, c, x, v, mode, effort, ref, rate, STEP)
        assert x == pytest.approx(bx, abs=3e-10)
        assert v == pytest.approx(bv, abs=3e-6)
        ref += rate * STEP
        events.add(mode)
    assert len(events) >= 2


@settings(max_examples=tried(60))
@given(
    name=st.sampled_from(sorted(CASES)),
    x=st.floats(-2e-3, 2e-3),
    v=st.floats(-1.0, 1.0),
    effort=st.floats(-3.0, 3.0),
    rate=st.floats(-1.0, 1.0),
    h=st.sampled_from([3e-4, 1e-3, 5e-3]),
)
@example("wall", 0.0, -2.2e-309, 0.0, 1.0, 3e-4)
@example("wall", 0.0, 0.0, 0.0, 1.0, 3e-4)
@example("all", 0.0, -1e-200, 3.0, 0.0, 1e-3)
def test_one_step_is_many_small_ones(
    name: str, x: float, v: float, effort: float, rate: float, h: float
) -> None:
    p = CASES[name]
    whole = plant_step(p, plant_cache(p, h), x, v, FREE, effort, 0.0, rate, h)
    pieces = 16
    c = plant_cache(p, h / pieces)
    mode = FREE
    flows = [0.0] * 5
    for k in range(pieces):
        ref = rate * (k * h / pieces)
        x, v, mode, *more = plant_step(p, c, x, v, mode, effort, ref, rate, h / pieces)
        flows = [a + b for a, b in zip(flows, more, strict=True)]
    assert whole[0] == pytest.approx(x, abs=1e-11)
    assert whole[1] == pytest.approx(v, abs=1e-8)
    assert whole[3:] == pytest.approx(flows, abs=1e-9)


@settings(max_examples=tried(100))
@given(
    k=st.sampled_from([0.0, 50.0, 1e4]),
    b=st.sampled_from([0.0, 1.0, 200.0]),
    v=st.floats(-1.0, 1.0),
    net=st.floats(-20.0, 20.0),
    slope=st.floats(-1e4, 1e4),
    alpha=st.sampled_from([1.0, -1.0, 0.0]),
    beta=st.sampled_from([0.0, 0.01, -0.01]),
    start=st.floats(-1e-3, 0.0),
)
def test_the_first_rise_is_the_first(
    k: float,
    b: float,
    v: float,
    net: float,
    slope: float,
    alpha: float,
    beta: float,
    start: float,
) -> None:
    m = 0.1
    span = isolation_limit(k, b, m, 5e-3)

    def level(t: float) -> float:
        moved, now, _ = flow_increment(k, b, m, v, net, slope, t)
        return start + alpha * moved + beta * (now - v)

    t = first_rise(k, b, m, v, net, slope, alpha, beta, start, span)
    grid = [level(span * i / 100.0) for i in range(101)]
    tiny = 1e-15 + 1e-12 * max(abs(g) for g in grid)
    if t < 0.0:
        # Never above after having been below, on the whole grid.
        below = start < -tiny
        for g in grid:
            assert not (below and g > tiny)
            below = below or g < -tiny
    else:
        assert 0.0 <= t <= span
        if t > 0.0:
            assert abs(level(t)) <= tiny
        below = start < -tiny
        for i, g in enumerate(grid):
            if span * i / 100.0 < t * (1.0 - 1e-9):
                assert not (below and g > tiny)
                below = below or g < -tiny


@pytest.mark.parametrize("rate", [10.0, 100.0, 1e3, 1e4])
def test_a_short_rise_is_found_at_every_scale_of_time(rate: float) -> None:
    """A swing on a drift: up for a moment, far down, up again; it ends below where it began.

    Its velocity is 0.6 + cos(rate t + phase), least half way through the longest span.
    """
    phase = math.pi - 1.25
    span = isolation_limit(rate**2, 0.0, 1.0, math.inf)
    crest = 0.9 * (1.25 - math.acos(0.6)) / rate

    def moved(t: float) -> float:
        return 0.6 * t + (math.sin(rate * t + phase) - math.sin(phase)) / rate

    rise = 0.5 * crest
    assert moved(span) < 0.0 < moved(rise) < moved(crest)
    v, net, slope = 0.6 + math.cos(phase), -rate * math.sin(phase), 0.6 * rate**2
    t = first_rise(rate**2, 0.0, 1.0, v, net, slope, 1.0, 0.0, -moved(rise), span)
    assert t == pytest.approx(rise, rel=1e-9)


@settings(max_examples=tried(100))
@given(
    k=st.sampled_from([0.0, 50.0, 1e4, 1e7]),
    b=st.sampled_from([0.0, 1.0, 200.0, 1e4]),
    v=st.floats(-1.0, 1.0),
    net=st.floats(-20.0, 20.0),
    slope=st.floats(-1e4, 1e4),
    span=st.sampled_from([1e-4, 1e-3, 1e-2]),
)
def test_bounds_hold_the_motion(
    k: float, b: float, v: float, net: float, slope: float, span: float
) -> None:
    m = 0.1
    low, high, slowest, fastest = motion_bounds(k, b, m, v, net, slope, span)
    room = 1e-12 * (abs(v) + abs(net) + abs(slope) * span) + 1e-150
    for i in range(41):
        moved, now, _ = flow_increment(k, b, m, v, net, slope, span * i / 40.0)
        assert low - room <= moved <= high + room
        assert slowest - room <= now <= fastest + room


def test_entry_is_located_to_rounding() -> None:
    # v0 = 1 towards a damper-only wall: in it v = exp(-b t / m), a clean function of the entry.
    b, m = 300.0, 0.1
    p = plant(m, wall=(0.0, b, 0.0, 1.0))
    c = plant_cache(p, STEP)
    for i in range(1, 50):
        entry = STEP * i / 50.3
        x, v, *_ = plant_step(p, c, -entry, 1.0, FREE, 0.0, 0.0, 0.0, STEP)
        inside = STEP - entry
        assert v == pytest.approx(math.exp(-b * inside / m), rel=1e-13)
        assert x == pytest.approx(-math.expm1(-b * inside / m) * m / b, rel=1e-13)
