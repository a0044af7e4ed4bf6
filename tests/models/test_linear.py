from __future__ import annotations

import math
from decimal import Decimal, localcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.models.linear import flow_coefficients, flow_increment, linear_flow

FREE = (0.0, 0.0, 0.1)
UNDER = (538.0, 5.0, 0.143)
CRITICAL = (1000.0, 20.0, 0.1)
OVER = (100.0, 50.0, 0.1)
STIFF = (1e7, 10.0, 0.1)
HEAVY = (1000.0, 1e4, 0.1)
DAMPED = (0.0, 3.0, 0.1)
SYSTEMS = (FREE, UNDER, CRITICAL, OVER, STIFF, HEAVY, DAMPED)


def precise(
    stiffness: float, damping: float, mass: float, state: tuple[float, ...], t: float
) -> tuple[float, float, float, float]:
    """x, v, integral of x and integral of v**2, by a Taylor series of 60 digits in small steps."""
    force, slope, x0, v0 = state
    with localcontext() as context:
        context.prec = 60
        k, b, m, f, s, x, v = (Decimal(q) for q in (stiffness, damping, mass, force, slope, x0, v0))
        rate = max(damping / mass, math.sqrt(stiffness / mass))
        steps = max(1, math.ceil(rate * t))
        dt = Decimal(t) / steps
        area = Decimal(0)
        square = Decimal(0)
        for _ in range(steps):
            c = [x, v]
            for j in range(60):
                push = f if j == 0 else s if j == 1 else Decimal(0)
                c.append((push - b * (j + 1) * c[j + 1] - k * c[j]) / (m * (j + 1) * (j + 2)))
            powers = [dt**j for j in range(2 * len(c))]
            d = [(j + 1) * c[j + 1] for j in range(len(c) - 1)]
            area += sum(cj * powers[j + 1] / (j + 1) for j, cj in enumerate(c))
            square += sum(
                di * dj * powers[i + j + 1] / (i + j + 1)
                for i, di in enumerate(d[:45])
                for j, dj in enumerate(d[:45])
            )
            x = sum((cj * powers[j] for j, cj in enumerate(c)), Decimal(0))
            v = sum((dj * powers[j] for j, dj in enumerate(d)), Decimal(0))
            f += s * dt
        return float(x), float(v), float(area), float(square)


@pytest.mark.sparse(3)
@pytest.mark.parametrize("system", SYSTEMS)
@pytest.mark.parametrize("state", [(1.0, 0.0, 0.0, 0.0), (0.3, -40.0, 0.01, 0.7), (0, 0, 0, 1.0)])
def test_the_flow_is_exact_to_rounding(
    system: tuple[float, float, float], state: tuple[float, float, float, float]
) -> None:
    t = 1e-3
    x, v, area, square = precise(*system, state, t)
    force, slope, x0, v0 = state
    got = linear_flow(*system, force, slope, x0, v0, t)
    # Scales of the terms that are added up, so that a zero crossing is not asked for digits.
    speed = abs(v) + abs(v0)
    assert got[0] == pytest.approx(x, rel=2e-14, abs=1e-14 * speed * t)
    assert got[1] == pytest.approx(v, rel=2e-14, abs=1e-14 * speed)
    assert got[2] == pytest.approx(area, rel=2e-14, abs=1e-14 * speed * t * t)
    c = flow_coefficients(*system, t)
    n = force - system[0] * x0 - system[1] * v0
    form = c[9] * v0 * v0 + c[10] * v0 * n + c[11] * v0 * slope
    form += c[12] * n * n + c[13] * n * slope + c[14] * slope * slope
    assert form == pytest.approx(square, rel=5e-13)


def test_a_spring_swings_back_after_a_thousand_periods() -> None:
    k, m = 1e6, 0.25
    period = 2.0 * math.pi * math.sqrt(m / k)
    x, v, area = linear_flow(k, 0.0, m, 0.0, 0.0, 0.01, 0.0, 1000.0 * period)
    assert x == pytest.approx(0.01, rel=1e-10)
    assert v == pytest.approx(0.0, abs=1e-10 * 20.0)
    assert area == pytest.approx(0.0, abs=1e-10)


def test_a_zero_step_changes_nothing() -> None:
    assert linear_flow(538.0, 5.0, 0.1, 3.0, 4.0, 0.2, -1.0, 0.0) == (0.2, -1.0, 0.0)


def test_heavy_damping_keeps_the_slow_mode() -> None:
    # b/m h = 1e6, the spring relaxes at k/b: after 100 s x = x0 exp(-0.1) to many digits.
    k, b, m = 1.0, 1000.0, 1e-6
    slow = (b - math.sqrt(b * b - 4.0 * k * m)) / (2.0 * m)
    slow = 2.0 * k / (b + math.sqrt(b * b - 4.0 * k * m)) if slow else 0.0
    x, _, _ = linear_flow(k, b, m, 0.0, 0.0, 1.0, -slow, 100.0)
    assert x == pytest.approx(math.exp(-100.0 * slow), rel=1e-13)


@pytest.mark.parametrize("rate", [1e200, 1e305])
def test_absurd_rates_end(rate: float) -> None:
    flow_coefficients(rate, rate, 1e-3, 1.0)


@given(
    st.sampled_from(SYSTEMS),
    st.floats(-1.0, 1.0),
    st.floats(-10.0, 10.0),
    st.floats(-100.0, 100.0),
    st.floats(1e-6, 5e-3),
    st.floats(0.01, 0.99),
)
def test_two_parts_make_one_step(
    system: tuple[float, float, float], v: float, net: float, slope: float, t: float, part: float
) -> None:
    dx, v1, n1 = flow_increment(*system, v, net, slope, t)
    da, va, na = flow_increment(*system, v, net, slope, part * t)
    db, vb, nb = flow_increment(*system, va, na, slope, t - part * t)
    k, b, m = system
    force = abs(net) + abs(slope) * t + (math.sqrt(k * m) + b) * abs(v)
    speed = abs(v) + force * min(t / m, 1.0 / b if b else math.inf)
    assert da + db == pytest.approx(dx, rel=1e-12, abs=1e-12 * speed * t)
    assert vb == pytest.approx(v1, rel=1e-11, abs=1e-12 * speed)
    assert nb == pytest.approx(n1, rel=1e-10, abs=1e-11 * force)
