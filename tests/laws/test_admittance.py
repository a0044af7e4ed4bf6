"""The wave port of an admittance axis: where the plain one fails, and what the bound buys."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.laws.port import port_close
from tautwave.laws.servo.admittance import (
    admittance_params,
    admittance_velocity,
    greatest_stiffness,
    rigid_port,
)
from tests.laws.loops import RICH, Matrix, matrix_of, radius

T, B = 1e-3, 10.0
CIRCLE = np.concatenate([np.geomspace(1e-4, 0.1, 60), np.linspace(0.1, np.pi, 240)])


def system(b: float, stiffness: float, upper: float, delay: int) -> Matrix:
    """Return [[A, B], [C, D]] of port, drive and outside spring, wave in to wave out.

    States at the end of a period: effort before, displacement, x, wave that acted, then the
    velocities and waves under way.
    """
    p = admittance_params(T, b, upper, delay)
    books = rigid_port(T, b, filter_gain=1.0, reserve=RICH, leak=0.0)
    size = 4 + 2 * delay

    def both(state: list[float]) -> list[float]:
        before, moved, x, wave = state[:4]
        velocities, waves = state[4 : 4 + delay], state[4 + delay : size]
        arriving = state[size]
        effort = -stiffness * x
        mean = 0.5 * (before + effort)
        leaving, *_ = port_close(books, RICH, 0.0, 0.0, moved, moved, 1.0, mean, wave, 0.0, False)
        command = admittance_velocity(p, effort, arriving, sum(velocities), 0.0, 0.0, 0.0)
        velocities, waves = [*velocities, command], [*waves, arriving]
        acting, acting_wave = velocities.pop(0), waves.pop(0)
        return [effort, acting * T, x + acting * T, acting_wave, *velocities, *waves, leaving]

    return matrix_of(both, size + 1)


def response(full: Matrix) -> Matrix:
    n = len(full) - 1
    a, b, c, d = full[:n, :n], full[:n, n], full[n, :n], full[n, n]
    return np.array([d + c @ np.linalg.solve(np.exp(1j * w) * np.eye(n) - a, b) for w in CIRCLE])


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
@pytest.mark.parametrize("b", [1.0, 10.0, 300.0])
def test_greatest_stiffness_is_where_the_plain_port_loses_stability(b: float, delay: int) -> None:
    limit = greatest_stiffness(T, b, delay)
    assert radius(system(b, 0.999 * limit, 0.0, delay)[:-1, :-1]) < 1.0
    assert radius(system(b, 1.001 * limit, 0.0, delay)[:-1, :-1]) > 1.0
    if delay == 0:
        assert limit == pytest.approx(2.0 * b / T)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("ratio", [0.01, 0.3, 1.0, 3.0, 30.0])
def test_with_an_upper_bound_it_is_passive_for_every_stiffness_below(
    ratio: float, delay: int
) -> None:
    upper = ratio * B / T
    for share in (0.0, 1e-3, 0.1, 0.5, 0.9, 1.0):
        full = system(B, share * upper, upper, delay)
        assert np.abs(response(full)).max() <= 1.0 + 1e-9, share
        if share > 0.0:
            assert radius(full[:-1, :-1]) <= 1.0 + 1e-12, share


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_the_plain_port_is_active_on_any_spring(delay: int) -> None:
    for ratio in (0.05, 0.3):
        assert np.abs(response(system(B, ratio * B / T, 0.0, delay))).max() > 1.0 + 1e-6


def test_beyond_the_bound_nothing_holds() -> None:
    upper = 0.5 * B / T
    assert np.abs(response(system(B, 8.0 * upper, upper, 1))).max() > 1.0 + 1e-3


def test_velocity_is_what_the_line_and_the_outside_agree_on() -> None:
    p = admittance_params(T, B, 0.0, 0)
    v = admittance_velocity(p, 2.0, 0.3, 0.0, 0.0, 0.0, 0.0)
    assert B * v - math.sqrt(2.0 * B) * 0.3 == pytest.approx(2.0, rel=1e-14)


def test_a_wall_is_taken_at_mid_period() -> None:
    p = admittance_params(T, B, 0.0, 0)
    push, K, D = 3.0, 5000.0, 2.0
    v = admittance_velocity(p, 2.0, 0.3, 0.0, push, K, D)
    resisted = push + (D + 0.5 * K * T) * v
    assert B * v - math.sqrt(2.0 * B) * 0.3 + resisted == pytest.approx(2.0, rel=1e-13)
