"""The greatest wave that a class of devices returns, against devices in it and beyond it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from tautwave.analysis.wave_port.device_class import (
    DeviceClass,
    class_gain,
    frequencies,
    returned_wave,
    sampled_support,
    stable_when_locked,
    support,
)
from tests.laws.ports import MASS, PERIOD, Ends, ends

THETA = np.unique(
    np.concatenate([np.geomspace(1e-3, 0.05, 30), np.linspace(0.05, math.pi - 1e-3, 500)])
)
CASES = [
    *((0.02, 0.3, 0, 1e-3, 3500.0), (0.02, 0.5, 0, 1e-3, 1000.0), (0.02, 0.5, 1, 1e-2, 1000.0)),
    *((0.05, 0.3, 0, 1e-2, 3500.0), (0.05, 0.5, 0, 1e-3, 900.0), (0.05, 0.3, 1, 1e-3, 1500.0)),
    *((0.02, None, 0, 1e-3, 1500.0), (0.05, None, 1, 1e-2, 500.0)),
]
"""Impedance, pole, command delay, least damping, greatest spring: certified."""


def admittance(matrix: np.ndarray, drive: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Return the sampled admittance of x' = matrix x + drive f; x[0] is the position."""
    size = len(drive)
    whole = np.zeros((size + 1, size + 1))
    whole[:size, :size], whole[:size, size] = matrix, drive
    step = expm(whole * PERIOD)
    z = np.exp(1j * theta)
    left = z[:, None, None] * np.eye(size) - step[None, :size, :size]
    states = np.linalg.solve(left, np.broadcast_to(step[:size, size:], (len(theta), size, 1)))
    return (z - 1.0) / PERIOD * states[:, 0, 0]


def some_device(rng: np.random.Generator, least: DeviceClass, far: float = 1.0) -> tuple:
    """Return a device of the class: mass, damper, spring, and a mass on a damped spring beside."""
    mass = least.mass * math.exp(rng.exponential(0.7))
    damping = least.damping * math.exp(rng.exponential(1.0))
    spring = far * least.stiffness * rng.choice([0.0, rng.uniform(), 1.0])
    if rng.uniform() < 0.5 and far == 1.0:
        # A hand: its spring and damper in parallel, to a mass. Nowhere softer than spring c >= .
        share = rng.uniform(0.0, 0.5) * least.stiffness
        grip = math.sqrt(share * least.mass) * math.exp(rng.normal())
        hand = least.mass * math.exp(rng.normal())
        spring = spring * 0.5
        # d/dt (x, v, X, V)
        matrix = np.array([
            [0.0, 1.0, 0.0, 0.0],
            [-(spring + share) / mass, -(damping + grip) / mass, share / mass, grip / mass],
            [0.0, 0.0, 0.0, 1.0],
            [share / hand, grip / hand, -share / hand, -grip / hand],
        ])  # fmt: skip
        return matrix, np.array([0.0, 1.0 / mass, 0.0, 0.0])
    return (
        np.array([[0.0, 1.0], [-spring / mass, -damping / mass]]),
        np.array([0.0, 1.0 / mass]),
    )


def belongs(matrix: np.ndarray, drive: np.ndarray, least: DeviceClass) -> bool:
    """Return whether R >= d and X >= m w - K / w at frequencies up to ten times the rate."""
    w = np.geomspace(1e-2, 20.0 * math.pi / PERIOD, 4000)
    left = 1j * w[:, None, None] * np.eye(len(drive)) - matrix[None]
    x = np.linalg.solve(left, np.broadcast_to(drive[:, None], (len(w), len(drive), 1)))
    impedance = 1.0 / (1j * w * x[:, 0, 0])
    resists = impedance.real >= least.damping * (1.0 - 1e-9)
    bound = least.mass * w - least.stiffness / w
    return bool(np.all(resists & (impedance.imag >= bound - 1e-6 * np.abs(bound))))


def returned(end: Ends, y: np.ndarray, theta: np.ndarray) -> np.ndarray:
    s = returned_wave(end.port, end.observer, end.delay, theta)
    return np.sqrt(s.low_pass) * np.abs((s.a * y + s.b) / (s.c * y + s.e))


@pytest.mark.parametrize(("impedance", "pole", "delay", "damping", "spring"), CASES)
def test_no_device_of_a_certified_class_returns_more(
    impedance: float, pole: float | None, delay: int, damping: float, spring: float
) -> None:
    end = ends(impedance, pole, delay=delay)
    least = DeviceClass(MASS, damping, spring)
    gain = class_gain(end.port, end.observer, delay, least)
    assert gain.contracting
    rng = np.random.default_rng(7)
    tried = 0
    for _ in range(120):
        device = some_device(rng, least)
        if len(device[1]) > 2 and not belongs(*device, least):
            continue
        tried += 1
        worst = returned(end, admittance(*device, THETA), THETA).max()
        assert worst <= gain.greatest + 1e-9
    assert tried > 60


@pytest.mark.parametrize(("impedance", "pole", "delay", "damping", "spring"), CASES[:5])
def test_beyond_the_greatest_spring_devices_do_return_more(
    impedance: float, pole: float | None, delay: int, damping: float, spring: float
) -> None:
    """The class is not much smaller than it has to be: 1.5 times the spring breaks the port."""
    end = ends(impedance, pole, delay=delay)
    low, high = spring, 64.0 * spring
    for _ in range(12):
        middle = 0.5 * (low + high)
        fine = class_gain(
            end.port, end.observer, delay, DeviceClass(MASS, damping, middle)
        ).contracting
        low, high = (middle, high) if fine else (low, middle)
    stiff = 1.5 * low
    theta = frequencies(PERIOD, DeviceClass(MASS, damping, stiff))
    matrix = np.array([[0.0, 1.0], [-stiff / MASS, -damping / MASS]])
    y = admittance(matrix, np.array([0.0, 1.0 / MASS]), theta)
    assert returned(end, y, theta).max() > 1.0 + 1e-4


def test_the_damped_light_slave_is_refused() -> None:
    """bT/2m = 5 and dT/m = 1: proved for an undamped mass only, it exploded."""
    end = ends(0.02, None, mass=1e-6)
    least = DeviceClass(1e-6, 2e-3, 0.0)
    assert class_gain(end.port, end.observer, 0, least).greatest > 2.0
    milder = ends(0.02 / 20.0, None, mass=1e-6)
    assert class_gain(milder.port, milder.observer, 0, least).contracting


def test_the_sign_near_standstill_is_that_of_the_limit() -> None:
    """1 - c theta**2: what is fine at the lowest theta of the grid is fine below it."""
    for impedance, pole, delay, damping, spring in CASES:
        end = ends(impedance, pole, delay=delay)
        least = DeviceClass(MASS, damping, spring)
        excess = [
            class_gain(end.port, end.observer, delay, least, np.array([theta])).greatest - 1.0
            for theta in (3e-3, 1e-3, 5e-4)
        ]
        curve = np.array(excess) / np.array([9e-6, 1e-6, 2.5e-7])
        assert curve == pytest.approx(curve[0], rel=0.05)


def test_a_port_that_a_locked_lever_makes_unstable_is_refused() -> None:
    end = ends(0.05, 0.5)
    assert stable_when_locked(end.port, end.observer, 0)
    heavy = end.port._replace(impedance=-3.0 / end.port.half_mobility)  # E(1) = 1, E(-1) < 0
    assert not stable_when_locked(heavy, end.observer, 0)
    least = DeviceClass(MASS, 1e-3, 0.0)
    assert class_gain(heavy, end.observer, 0, least).greatest == math.inf


def test_support_is_that_of_the_admittances_that_the_class_allows() -> None:
    rng = np.random.default_rng(3)
    least = DeviceClass(MASS, 5e-3, 800.0)
    for w in (10.0, 400.0, 852.0, 853.5, 3000.0, 2e4):
        bound = least.mass * w - least.stiffness / w
        r = least.damping * np.exp(np.minimum(np.abs(rng.standard_cauchy(40_000)), 50.0))
        r[:10_000] = least.damping
        x = np.maximum(bound, least.damping * rng.standard_cauchy(40_000))
        x[10_000:15_000] = bound
        x[20_000:30_000] = bound + np.abs(bound * rng.standard_cauchy(10_000))
        y = 1.0 / (r + 1j * x)
        for angle in np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False):
            u = np.array([np.exp(1j * angle)])
            reach = support(least, np.array([w]), u)[0]
            found = (np.conj(u) * y).real.max()
            assert found <= reach + 1e-9 / least.damping
            assert found >= reach - 0.06 / least.damping


def test_a_sampled_device_is_the_mean_of_what_sampling_folds_together() -> None:
    """Colgate & Schenkel's weights, for the device: they add up to one."""
    matrix = np.array([[0.0, 1.0], [-300.0 / MASS, -0.02 / MASS]])
    drive = np.array([0.0, 1.0 / MASS])
    theta = np.array([0.02, 0.4, 1.5, 3.0])
    total = np.zeros(4, dtype=complex)
    for at in range(-4000, 4001):
        angle = theta + 2.0 * math.pi * at
        s = 1j * angle / PERIOD
        total += np.sinc(angle / (2.0 * math.pi)) ** 2 * s / (MASS * s * s + 0.02 * s + 300.0)
    assert total == pytest.approx(admittance(matrix, drive, theta), rel=1e-6)
    least = DeviceClass(MASS, 0.02, 300.0)
    u = np.exp(1j * np.linspace(0.0, 6.2, 40))[None, :]
    reach = sampled_support(PERIOD, least, theta[:, None], u)
    y = admittance(matrix, drive, theta)[:, None]
    assert np.all((np.conj(u) * y).real <= reach + 1e-9)
