from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.models.servo import (
    ServoParams,
    lag_integrals,
    servo_forces,
    servo_step,
    servo_stored,
)
from tests.examples import tried
from tests.models.plants import STEP

FREE = ServoParams(0.002, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize("r", [1e-9, 1e-3, 0.3, 0.499999, 0.500001, 2.0, 50.0, 1e4])
def test_lag_integrals(r: float) -> None:
    tau = 0.003
    decay, first, second, square = lag_integrals(r * tau, tau)
    assert decay == pytest.approx(math.exp(-r), rel=1e-14, abs=1e-300)
    assert first == pytest.approx(-tau * math.expm1(-r), rel=1e-14)
    series = sum((-r) ** k / math.factorial(k + 2) for k in range(20)) * r * r
    exact = series if r < 1.0 else r + math.expm1(-r)
    assert second == pytest.approx(tau * tau * exact, rel=1e-14)
    assert square == pytest.approx(-0.5 * tau * math.expm1(-2.0 * r), rel=1e-14)


def test_the_velocity_follows_with_a_first_order_lag() -> None:
    x, v = 0.01, 0.3
    for _ in range(7):
        x, v, *_ = servo_step(FREE, x, v, 1.0, 0.0, 0.0, STEP)
    decay = math.exp(-3.5)
    assert v == pytest.approx(1.0 - 0.7 * decay, rel=1e-14)
    assert x == pytest.approx(0.01 + 0.007 - 0.7 * 0.002 * (1.0 - decay), rel=1e-13)


def test_without_lag_the_command_is_the_velocity() -> None:
    p = FREE._replace(time_constant=0.0, hand_mass=0.2)
    x, v, _, _, _, work = servo_step(p, 0.0, 0.5, -1.0, 0.0, 0.0, STEP)
    assert (x, v) == (-1e-3, -1.0)
    assert work == pytest.approx(-0.1 * (1.0 - 0.25))


def test_the_measured_effort_pushes_back() -> None:
    p = ServoParams(0.002, 0.1, 500.0, 5.0, 100.0, 0.0, 1e4, 20.0, 0.01, 1.0)
    # Inside the wall, moving in, hand at 0, accelerating: everything resists.
    effort = sum(servo_forces(p, 0.011, 0.1, 0.2, 0.0, 0.0))
    parts = -500.0 * 0.011 - 5.0 * 0.1 - 100.0 * 0.011 - (1e4 * 0.001 + 20.0 * 0.1)
    assert effort == pytest.approx(parts - 0.1 * 0.1 / 0.002)
    # The wall does not pull.
    free = p._replace(grip_stiffness=0.0, grip_damping=0.0, spring_stiffness=0.0, hand_mass=0.0)
    assert sum(servo_forces(free, 0.011, -1.0, 0.0, 0.0, 0.0)) == 0.0


@pytest.mark.parametrize(("stiffness", "damping"), [(5e-3, 0.0), (0.0, 5e-3)])
def test_a_soft_grip_does_its_work(stiffness: float, damping: float) -> None:
    """A hand that is led over 0.01 rad in a step, on a servo that stands: half K d^2, or D d v."""
    p = FREE._replace(grip_stiffness=stiffness, grip_damping=damping)
    _, _, work, *_ = servo_step(p, 0.0, 0.0, 0.0, 0.0, 0.01 / STEP, STEP)
    assert work == pytest.approx(0.5 * stiffness * 1e-4 + damping * 1e-4 / STEP, rel=1e-9)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_visit_to_the_wall_within_a_step_closed_form(side: float) -> None:
    # Constant speed in for 1 ms: entry at a known time inside the step.
    p = FREE._replace(wall_stiffness=2e4, wall_damping=30.0, wall_position=0.1, wall_side=side)
    x0 = 0.1 - side * 0.4e-3
    x, _, _, _, lost, work = servo_step(p, x0, side, side, 0.0, 0.0, STEP)
    assert side * (x - 0.1) == pytest.approx(0.6e-3, rel=1e-11)
    assert lost == pytest.approx(30.0 * 0.6e-3, rel=1e-11)
    assert work == pytest.approx(-lost - 1e4 * 0.6e-3**2, rel=1e-11)
    # Out again, faster than the wall creeps: it does no work, its spring's energy is lost.
    _, _, _, _, more, none = servo_step(p, x, -side, -side, 0.0, 0.0, STEP)
    assert none == 0.0
    assert more == pytest.approx(1e4 * 0.6e-3**2, rel=1e-11)


@settings(max_examples=tried(80))
@given(
    tau=st.sampled_from([0.0, 1e-4, 2e-3, 1.0]),
    mass=st.sampled_from([0.0, 0.143]),
    grip=st.sampled_from([(0.0, 0.0), (538.0, 5.0), (0.0, 8.0)]),
    spring=st.sampled_from([0.0, 200.0]),
    wall=st.sampled_from([(0.0, 0.0), (1e4, 0.0), (1e4, 40.0), (0.0, 20.0), (1e7, 100.0)]),
    side=st.sampled_from([1.0, -1.0]),
    h=st.sampled_from([2.5e-4, 1e-3, 2e-2]),
    seed=st.integers(0, 999),
)
def test_the_books_close(
    tau: float,
    mass: float,
    grip: tuple[float, float],
    spring: float,
    wall: tuple[float, float],
    side: float,
    h: float,
    seed: int,
) -> None:
    p = ServoParams(tau, mass, *grip, spring, 0.001, *wall, 0.0002, side)
    x, v, ref = 0.0, 0.1, 0.0
    stored = sum(servo_stored(p, x, v, ref))
    residual = 0.0
    gross = stored
    for k in range(60):
        command = 0.4 * math.sin(seed + 1.3 * k)
        rate = 0.3 * math.cos(seed + 0.4 * k)
        x, v, work, grip_loss, loss, outside = servo_step(p, x, v, command, ref, rate, h)
        assert grip_loss >= -1e-15
        assert loss >= -1e-15
        ref += rate * h
        now = sum(servo_stored(p, x, v, ref))
        residual += work - outside - (now - stored) - grip_loss - loss
        gross += abs(work) + abs(outside) + abs(now - stored) + grip_loss + loss
        stored = now
    assert abs(residual) <= 1e-12 * gross + 1e-18


@settings(max_examples=tried(50))
@given(
    x=st.floats(-1e-3, 1e-3),
    v=st.floats(-1.0, 1.0),
    command=st.floats(-1.0, 1.0),
    tau=st.sampled_from([5e-4, 2e-3, 2e-2]),
)
def test_one_step_is_many_small_ones(x: float, v: float, command: float, tau: float) -> None:
    p = ServoParams(tau, 0.1, 538.0, 5.0, 0.0, 0.0, 1e4, 30.0, 0.0, 1.0)
    whole = servo_step(p, x, v, command, 0.0, 0.2, STEP)
    flows = [0.0] * 4
    for k in range(50):
        part = STEP / 50
        x, v, *more = servo_step(p, x, v, command, 0.2 * part * k, 0.2, part)
        flows = [a + b for a, b in zip(flows, more, strict=True)]
    assert whole[:2] == pytest.approx((x, v), rel=1e-11, abs=1e-15)
    assert whole[2:] == pytest.approx(flows, rel=1e-8, abs=1e-13)


def test_numbers_beyond_floats_end_the_step() -> None:
    p = ServoParams(1e-3, 0.1, 538.0, 5.0, 1.0, 0.0, 1e9, 1e9, 0.0, 1.0)
    for x in (1e308, -1e308):
        servo_step(p, x, -1e300, 1e308, 0.0, 1e300, STEP)
