from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.models.foam import (
    FoamParams,
    foam_forces,
    foam_movement,
    foam_step,
    foam_stored,
    foam_substeps,
)
from tautwave.models.plant import PlantParams
from tests.examples import tried
from tests.models.plants import STEP, plant


def lambert(argument: float) -> float:
    """Principal branch of Lambert's W on (-1/e, 0)."""
    w = -0.5
    for _ in range(100):
        w -= (w * math.exp(w) - argument) / (math.exp(w) * (1.0 + w))
    return w


def restitution(a: float) -> float:
    return (1.0 + lambert(-(1.0 + a) * math.exp(-(1.0 + a)))) / a


def bounce(
    p: PlantParams, foam: FoamParams, x: float, v: float, h: float
) -> tuple[float, float, float]:
    """Speed after the bounce, greatest depth and time in contact, interpolated at its ends."""
    entry = -x / v
    t = 0.0
    depth = 0.0
    while True:
        before = x
        x, v, *_ = foam_step(p, foam, x, v, 0.0, 0.0, 0.0, h)
        t += h
        if before < 0.0 <= x:
            entry = t - x / v
        depth = max(depth, x)
        if v < 0.0 and x < 0.0:
            return -v, depth, t - x / v - entry


def test_D14_restitution_closed_forms() -> None:
    assert restitution(0.5) == pytest.approx(0.7484349316, abs=1e-9)
    assert restitution(5.0) == pytest.approx(0.1969802453, abs=1e-9)


@pytest.mark.parametrize(("loss", "error"), [(0.5, 3e-7), (5.0, 3e-6)])
def test_W4_restitution_and_depth(loss: float, error: float) -> None:
    foam = FoamParams(1e5, 1.5, loss, 0.0, 1.0, 1)
    p = plant()
    speed, depth, _ = bounce(p, foam, -0.0003, 1.0, 6.25e-6)
    assert speed == pytest.approx(restitution(loss), abs=error)
    closed = (2.5 * 0.1 / 1e5 * (1.0 / loss - math.log1p(loss) / loss**2)) ** 0.4
    assert depth == pytest.approx(closed, rel=3e-6)
    if loss == 0.5:
        assert closed == pytest.approx(3.8925738e-3, rel=1e-8)


def test_W3_depth_and_contact_time_of_hertz() -> None:
    p = plant(0.01)
    foam = FoamParams(1e6, 1.5, 0.0, 0.0, 1.0, 1)
    deepest = (2.5 * 0.01 / 2e6) ** 0.4
    assert deepest == pytest.approx(0.6898648e-3, rel=1e-7)
    duration = 2.0 * deepest * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    assert duration / deepest == pytest.approx(2.943275184, abs=1e-9)
    speed, depth, contact = bounce(p, foam, -1e-4, 1.0, 1e-6)
    assert speed == pytest.approx(1.0, abs=1e-12)
    assert depth == pytest.approx(deepest, rel=1e-5)
    assert contact == pytest.approx(duration, rel=1e-5)


def test_order_two() -> None:
    exact = restitution(0.5)
    errors = [
        abs(bounce(plant(), FoamParams(1e5, 1.5, 0.5, 0.0, 1.0, n), -0.0003, 1.0, 2e-4)[0] - exact)
        for n in (1, 2, 4, 8)
    ]
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert orders == pytest.approx([2.0, 2.0, 2.0], abs=0.05)


def test_order_two_with_grip_reference_and_viscosity() -> None:
    p = plant(0.2, 0.4, 0.0, (538.0, 5.0))

    def end(n: int) -> tuple[float, float]:
        foam = FoamParams(3e4, 1.5, 2.0, 0.001, 1.0, n)
        x, v, ref = 0.0, 0.0, 0.0
        for k in range(40):
            rate = 0.3 * math.cos(0.1 * k)
            x, v, *_ = foam_step(p, foam, x, v, 0.5 * math.sin(0.3 * k), ref, rate, STEP)
            ref += rate * STEP
        return x, v

    tight = end(256)
    errors = [abs(end(n)[0] - tight[0]) for n in (2, 4, 8)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.2)
    assert math.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.2)
    assert errors[2] < 1e-7


@pytest.mark.parametrize("stiffness", [1e6, 1e8, 1e10, 1e15])
@pytest.mark.parametrize("loss", [0.0, 0.5, 50.0])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0, 10.0])
def test_D15_extremes_gain_no_energy(stiffness: float, loss: float, exponent: float) -> None:
    p = plant(0.01)
    foam = FoamParams(stiffness, exponent, loss, 0.0, 1.0, 1)
    x, v = -0.0003, 1.0
    lost = 0.0
    for _ in range(300):
        x, v, _, _, _, _, more = foam_step(p, foam, x, v, 0.0, 0.0, 0.0, 22.7e-6)
        assert more >= 0.0
        lost += more
        total = sum(foam_stored(p, foam, x, v, 0.0)) + lost
        assert total == pytest.approx(0.005, rel=1e-13)
    assert abs(v) <= 1.0 + 1e-13


def test_D15_newton_needs_few_iterations() -> None:
    counts = []
    m, h = 0.01, 22.7e-6
    for stiffness in (1e6, 1e8, 1e10):
        foam = FoamParams(stiffness, 1.5, 0.0, 0.0, 1.0, 1)
        inertia = 2.0 * m / h**2
        x, v = -0.00031, 1.0
        for _ in range(300):
            u, _, _, count = foam_movement(foam, x, h * v, inertia, h)
            x, v = x + u, 2.0 * u / h - v
            if count:
                counts.append(count)
    assert sum(counts) / len(counts) <= 5.0
    assert max(counts) <= 12


@settings(max_examples=tried(60))
@given(
    mass=st.floats(0.01, 2.0),
    viscous=st.sampled_from([0.0, 0.3]),
    coulomb=st.sampled_from([0.0, 0.3]),
    grip=st.sampled_from([(0.0, 0.0), (538.0, 5.0)]),
    stiffness=st.sampled_from([1e2, 1e5, 1e9]),
    exponent=st.sampled_from([1.0, 1.5, 2.2]),
    loss=st.sampled_from([0.0, 0.5, 20.0]),
    side=st.sampled_from([1.0, -1.0]),
    substeps=st.integers(1, 5),
    seed=st.integers(0, 99),
)
def test_the_books_close_for_any_foam(
    mass: float,
    viscous: float,
    coulomb: float,
    grip: tuple[float, float],
    stiffness: float,
    exponent: float,
    loss: float,
    side: float,
    substeps: int,
    seed: int,
) -> None:
    p = plant(mass, viscous, coulomb, grip)
    foam = FoamParams(stiffness, exponent, loss, 0.0005, side, substeps)
    x, v, ref = 0.0, 0.2, 0.0
    stored = sum(foam_stored(p, foam, x, v, ref))
    residual = 0.0
    gross = stored
    for k in range(80):
        effort = math.sin(seed + 0.7 * k)
        rate = 0.3 * math.cos(seed + 0.1 * k)
        before = x
        x, v, work, *losses = foam_step(p, foam, x, v, effort, ref, rate, STEP)
        assert min(losses) >= 0.0
        ref += rate * STEP
        now = sum(foam_stored(p, foam, x, v, ref))
        motor = effort * (x - before)
        residual += work + motor - (now - stored) - sum(losses)
        gross += abs(work) + abs(motor) + abs(now - stored) + sum(losses)
        stored = now
    assert abs(residual) <= 1e-13 * gross


def test_friction_lets_a_mass_rest_in_foam() -> None:
    p = plant(0.2, 0.0, 0.5, (538.0, 5.0))
    foam = FoamParams(3e4, 1.5, 2.0, 0.0, 1.0, 4)
    x, v = -0.002, 0.3
    for _ in range(400):
        x, v, *_ = foam_step(p, foam, x, v, 0.0, 0.002, 0.0, STEP)
    assert v == 0.0
    hand, environment = foam_forces(p, foam, x, v, 0.002, 0.0)
    assert abs(hand + environment) <= 0.5
    assert foam_step(p, foam, x, v, 0.0, 0.002, 0.0, STEP)[0] == x


def test_without_contact_it_is_the_midpoint_rule_of_a_free_mass() -> None:
    p = plant(0.2)
    foam = FoamParams(1e4, 1.5, 1.0, 1.0, 1.0, 1)
    assert foam_step(p, foam, 0.0, 0.1, 0.4, 0.0, 0.0, STEP)[:2] == pytest.approx(
        (0.1e-3 + 1e-6, 0.102), rel=1e-13
    )


def test_foam_never_pulls() -> None:
    foam = FoamParams(1e4, 1.5, 3.0, 0.0, -1.0, 1)
    p = plant()
    assert foam_forces(p, foam, -0.01, 5.0, 0.0, 0.0)[1] == 0.0
    assert foam_forces(p, foam, -0.01, 0.0, 0.0, 0.0)[1] == pytest.approx(10.0)
    assert foam_forces(p, foam, 0.01, -1.0, 0.0, 0.0)[1] == 0.0


def test_substeps_follow_the_stiffness() -> None:
    p = plant(0.2, 0.1, 0.0, (538.0, 5.0))
    counts = [
        foam_substeps(p, FoamParams(k, 1.5, 1.0, 0.0, 1.0, 1), 0.5, 5.0, STEP)
        for k in (1e2, 1e4, 1e6, 1e8, 1e12)
    ]
    assert counts == sorted(counts)
    assert counts[0] >= 1
    assert counts[-1] <= 1000


def test_numbers_beyond_floats_end_the_step() -> None:
    p = plant(0.1, 0.1, 0.1, (538.0, 5.0))
    for x in (1e308, 1e200, -1e308):
        foam_step(p, FoamParams(1e15, 10.0, 1.0, 0.0, 1.0, 3), x, 1e300, 0.0, 0.0, 0.0, STEP)
