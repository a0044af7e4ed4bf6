"""What noise has a wall give: bounds against exact loops with hands that resonate."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from tautwave.analysis.walls.noise import wall_noise_power
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall

T = 1e-3


def error_power(
    wall: SampledWall, mass: float, damping: float, hand: tuple[float, ...], colour: np.ndarray
) -> tuple[float, float]:
    """Return the mean power of the wall's error, and of it what surplus damping takes [W].

    The loop is exact: device, hand (mass, spring, damper on it, spring to the ground), wall; the
    noise is a moving average of unit white noise by `colour`. `wall` is not filtered.
    """
    mh, ks, bs, kg = hand
    a = np.array([
        [0.0, 1.0, 0.0, 0.0],
        [-(kg + ks) / mass, -(damping + bs) / mass, ks / mass, bs / mass],
        [0.0, 0.0, 0.0, 1.0],
        [ks / mh, bs / mh, -ks / mh, -bs / mh],
    ])  # fmt: skip
    block = np.zeros((5, 5))
    block[:4, :4], block[1, 4] = a, 1.0 / mass
    step = expm(block * T)
    move, push = step[:4, :4], step[:4, 4]
    k, b = wall.stiffness, wall.damping / T
    taps = np.convolve(colour, [k + b, -b])  # the error per white sample, up to its sign
    # The rest answers to each error as a linear loop does; the error is what drives it.
    x, before, moved = np.zeros(4), 0.0, []
    for at in range(800):
        drive = taps[at] if at < len(taps) else 0.0
        effort = -(k * x[0] + b * (x[0] - before)) + drive
        before = x[0]
        x = move @ x + push * effort
        moved.append(x[0] - before)
    # What moves later took more: left out, on the adversary's side.
    power = float(np.dot(taps, moved[: len(taps)])) / T
    surplus = damping - wall_leak(wall).damping
    return power, power - surplus * float(np.dot(moved, moved)) / T**2


def test_white_noise_on_a_spring_is_what_a_free_device_gets() -> None:
    wall = SampledWall(stiffness=2000.0, damping=0.0, period=T)
    sigma, mass = 1e-4, 0.1
    bound = wall_noise_power(wall, mass, 0.0, sigma, ())
    assert bound == pytest.approx((2000.0 * sigma) ** 2 * T / (2.0 * mass), rel=1e-12)
    power, _ = error_power(wall, mass, 1.05, (1e-3, 200.0, 1.0, 0.0), np.array([sigma]))
    assert 0.95 * bound < power <= bound


@pytest.mark.parametrize("seed", range(3))
def test_no_passive_hand_gets_more_of_any_colour(seed: int) -> None:
    rng = np.random.default_rng(seed)
    greatest = 0.0
    for _ in range(40):
        mass = 10.0 ** rng.uniform(-2, 0)
        wall = SampledWall(
            stiffness=10.0 ** rng.uniform(1, 4), damping=rng.choice([0.0, 0.5]), period=T
        )
        damping = wall_leak(wall).damping * rng.choice([1.0, 1.01, 2.0])
        lags = int(rng.integers(0, 17))
        theta = rng.uniform(0.0, np.pi)
        colour = np.cos(theta * np.arange(lags + 1)) * rng.choice([1.0, 0.3])
        colour /= np.linalg.norm(colour)
        rho = np.correlate(colour, colour, "full")[lags + 1 :]
        # A hand tuned to the noise, as an adversary would have it.
        mh = 10.0 ** rng.uniform(-3, 0)
        ks = mh * (max(theta, 0.05) / T) ** 2
        hand = (mh, ks, 1e-2 * np.sqrt(ks * mh), rng.choice([0.0, 100.0]))
        power, net = error_power(wall, mass, damping + 0.05, hand, colour)
        surplus = damping + 0.05 - wall_leak(wall).damping
        by_inertia = wall_noise_power(wall, mass, 0.0, 1.0, tuple(rho))
        assert power <= by_inertia * (1.0 + 1e-9)
        assert net <= wall_noise_power(wall, mass, surplus, 1.0, tuple(rho)) * (1.0 + 1e-9)
        assert by_inertia <= wall_noise_power(wall, mass, 0.0, 1.0) * (1.0 + 1e-9)
        greatest = max(greatest, power / by_inertia)
    assert greatest > 0.3  # the bound is not idle
