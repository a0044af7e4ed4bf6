"""A device that takes positions: what its port returns, how it feels, where its goal waits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from tautwave.laws.port import port_close
from tautwave.laws.servo.admittance import admittance_params, admittance_velocity, rigid_port
from tautwave.laws.servo.follower import FollowerParams, goal_effort, lag_damping, next_goal
from tests.laws.loops import RICH, Matrix, matrix_of, radius

T, B, K = 2e-3, 0.03, 2.0
CIRCLE = np.concatenate([np.geomspace(1e-4, 0.1, 30), np.linspace(0.1, np.pi, 120)])


def system(answer: Sequence[float], lag: float, delay: int) -> Matrix:
    """Return [[A, B], [C, D]] of port, goal, spring and a device with this impulse response.

    States at the end of a period: effort before, displacement, the wave that acted, the goals of
    the last samples, then the velocities and waves under way.
    """
    p = admittance_params(T, B, K, delay, lag_damping(K, lag))
    books = rigid_port(T, B, filter_gain=1.0, reserve=RICH, leak=0.0)
    goals = 3 + len(answer)
    size = goals + 2 * delay

    def both(state: list[float]) -> list[float]:
        before, moved, wave = state[:3]
        path = state[3:goals]
        velocities, waves = state[goals : goals + delay], state[goals + delay : size]
        place = sum(share * goal for share, goal in zip(answer, path, strict=True))
        effort = K * (place - path[0])
        mean = 0.5 * (before + effort)
        leaving, *_ = port_close(books, RICH, 0.0, 0.0, moved, moved, 1.0, mean, wave, 0.0, False)
        command = admittance_velocity(p, effort, state[size], sum(velocities), 0.0, 0.0, 0.0)
        velocities, waves = [*velocities, command], [*waves, state[size]]
        acting, acted = velocities.pop(0), waves.pop(0)
        path = [path[0] + acting * T, *path[:-1]]
        return [effort, acting * T, acted, *path, *velocities, *waves, leaving]

    return matrix_of(both, size + 1)


def returned(full: Matrix) -> float:
    """Return the greatest share of a wave that comes back."""
    n = len(full) - 1
    a, b, c, d = full[:n, :n], full[:n, n], full[n, :n], full[n, n]
    points = np.exp(1j * CIRCLE)[:, None, None] * np.eye(n) - a
    found = (
        d + (c @ np.linalg.solve(points, np.broadcast_to(b[:, None], (len(CIRCLE), n, 1))))[:, 0]
    )
    return float(np.abs(found).max())


def devices() -> list[np.ndarray]:
    """Devices whose answer rises without overshoot: seeded, slow and quick, some of them held."""
    rng = np.random.default_rng(1)
    found = [np.eye(12)[at] for at in (0, 1, 11)]
    found += [0.6 ** np.arange(12) * 0.4, np.full(12, 1 / 12), np.full(12, 0.5 / 12)]
    for _ in range(12):
        steps = rng.exponential(size=12) * (rng.random(12) < rng.choice([0.1, 0.5, 1.0]))
        found.append(steps / max(steps.sum(), 1e-9) * rng.choice([1.0, rng.random()]))
    return found


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_no_more_comes_back_whatever_the_device_touches(delay: int) -> None:
    for answer in devices():
        lag = T * float(answer @ np.arange(12))
        full = system(answer, lag, delay)
        assert returned(full) <= 1.0 + 1e-9
        assert radius(full[:-1, :-1]) <= 1.0 + 1e-9


def test_a_port_that_does_not_count_the_lag_gives_waves_away() -> None:
    late = np.eye(12)[11]
    assert returned(system(late, 11 * T, 1)) <= 1.0 + 1e-9
    assert returned(system(late, 0.0, 1)) > 1.1


def test_a_device_that_overshoots_is_not_covered() -> None:
    swinging = np.array([0.0, 1.9, 0.0, -0.9])  # its mean lag is below 0: nothing is stated
    assert returned(system(swinging, 0.0, 0)) > 1.1


def test_at_a_constant_velocity_the_lag_is_a_drag() -> None:
    p = FollowerParams(T, K, 10.0, -10.0, 10.0)
    goal, lag, speed = 0.0, 0.01, 0.5
    for _ in range(100):
        goal = next_goal(p, goal, speed, goal - speed * lag)
    assert goal == pytest.approx(100 * T * speed)
    assert goal_effort(p, goal, goal - speed * lag) == pytest.approx(-K * lag * speed)
    assert lag_damping(K, lag) == pytest.approx(K * lag)


def test_the_goal_waits_for_a_device_that_is_held() -> None:
    p = FollowerParams(T, K, 0.1, -1.0, 1.0)
    goal = 0.0
    for _ in range(1000):
        goal = next_goal(p, goal, 1.0, 0.3)
    assert goal == pytest.approx(0.4)
    assert goal_effort(p, goal, 0.3) == pytest.approx(-K * p.lead)
    assert next_goal(p, goal, 0.0, 0.2) == pytest.approx(0.3), "and goes with one pushed back"


def test_the_goal_stays_in_its_range_and_does_not_pull_a_device_into_it() -> None:
    p = FollowerParams(T, K, 0.5, -1.0, 1.0)
    assert next_goal(p, 0.9999, 1.0, 0.9) == 1.0
    assert next_goal(p, -0.9999, -1.0, -0.9) == -1.0
    assert next_goal(p, 1.3, 0.0, 1.3) == 1.3
    assert next_goal(p, 1.3, 2.0, 1.3) == 1.3
    assert next_goal(p, 1.3, -2.0, 1.3) == pytest.approx(1.3 - 2.0 * T)
