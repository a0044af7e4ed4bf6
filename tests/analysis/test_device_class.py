"""The greatest wave that a class of devices returns, against devices in it and beyond it."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

from tautwave.analysis.wave_port.contraction import Folded, least, touching
from tautwave.analysis.wave_port.device_class import (
    LATEST,
    ClassGain,
    DeviceClass,
    class_gain,
    contracting,
    stiffest_spring,
    suggested_spring,
)
from tautwave.analysis.wave_port.reflection import reflection
from tautwave.analysis.wave_port.sensor_noise import observer_response
from tests.examples import tried
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


class Moebius(NamedTuple):
    """S = (a Y + b) / (c Y + e) per frequency, and the filter's |H|**2; each of shape (n,)."""

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    e: np.ndarray
    low_pass: np.ndarray


def returned_wave(end: Ends, theta: np.ndarray) -> Moebius:
    """Return what a port makes of a wave at e^(j theta): no polynomials, in floats."""
    p, z = end.port, np.exp(1j * theta)
    q = 1.0 / z
    x, by_effort = observer_response(end.observer, theta)
    lead, b = p.period * p.lead, p.impedance
    late = q**end.delay
    under_way = sum((q**at for at in range(1, end.delay + 1)), np.zeros_like(q))
    by_velocity = late * (x[1] + lead * x[2]) * p.period / (z - 1.0)
    fed = late * (by_effort[1] + lead * by_effort[2]) - p.half_mobility * (1.0 + 2.0 * under_way)
    sent_fed = (z - 1.0) / p.period * by_effort[0]
    slipped = b * p.slip
    low_pass = p.filter_gain / np.abs(1.0 - (1.0 - p.filter_gain) * q)
    return Moebius(
        a=2.0 * b * x[0] - b * by_velocity,
        b=b * fed - 2.0 * b * sent_fed - (1.0 - slipped),
        c=b * by_velocity,
        e=1.0 + slipped - b * fed,
        low_pass=low_pass * low_pass,
    )


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
    s = returned_wave(end, theta)
    return np.sqrt(s.low_pass) * np.abs((s.a * y + s.b) / (s.c * y + s.e))


def held(spring: float, damping: float, theta: np.ndarray, mass: float = MASS) -> np.ndarray:
    matrix = np.array([[0.0, 1.0], [-spring / mass, -damping / mass]])
    return admittance(matrix, np.array([0.0, 1.0 / mass]), theta)


def gain_of(end: Ends, least_known: DeviceClass):
    return class_gain(end.port, end.observer, end.delay, least_known)


def proved(end: Ends, least_known: DeviceClass) -> bool:
    return contracting(end.port, end.observer, end.delay, least_known)


@pytest.mark.sparse(4)
@pytest.mark.parametrize(("impedance", "pole", "delay", "damping", "spring"), CASES)
def test_no_device_of_a_certified_class_returns_more(
    impedance: float, pole: float | None, delay: int, damping: float, spring: float
) -> None:
    end = ends(impedance, pole, delay=delay)
    known = DeviceClass(MASS, damping, spring)
    assert gain_of(end, known).contracting
    rng = np.random.default_rng(7)
    tried = 0
    for _ in range(70):
        device = some_device(rng, known)
        if len(device[1]) > 2 and not belongs(*device, known):
            continue
        tried += 1
        assert returned(end, admittance(*device, THETA), THETA).max() <= 1.0 + 1e-9
    assert tried > 35


@pytest.mark.sparse(3)
@pytest.mark.parametrize(("impedance", "pole", "delay", "damping", "spring"), CASES[:5])
def test_beyond_the_greatest_spring_devices_do_return_more(
    impedance: float, pole: float | None, delay: int, damping: float, spring: float
) -> None:
    """The class is not much smaller than it has to be: 1.5 times the spring breaks the port."""
    end = ends(impedance, pole, delay=delay)
    most = stiffest_spring(end.port, end.observer, delay, DeviceClass(MASS, damping, 0.0))
    assert most >= spring
    assert not proved(end, DeviceClass(MASS, damping, 1.04 * most))
    swing = PERIOD * math.sqrt(1.5 * most / MASS)
    theta = np.unique(np.concatenate([THETA, swing + np.linspace(-0.1, 0.1, 4001)]))
    assert returned(end, held(1.5 * most, damping, theta), theta).max() > 1.0 + 1e-4


class Draw(NamedTuple):
    """A random port on a random class, and the stiffest spring that is proved."""

    end: Ends
    known: DeviceClass
    most: float


def draw(rng: np.random.Generator) -> Draw:
    """Return a port that is certified at least for soft springs."""
    while True:
        pole = [None, 0.0, 0.3, 0.5, 0.7][rng.integers(5)]
        mass = MASS * math.exp(rng.uniform(-2.0, 2.0))
        delay = int(rng.integers(3))
        impedance = mass / PERIOD * math.exp(rng.uniform(-7.0, -2.0))
        corner = 2000.0 * math.exp(rng.uniform(-4.0, -1.0))
        end = ends(impedance, pole, delay=delay, mass=mass, corner=corner)
        damping = impedance * math.exp(rng.uniform(-6.0, 0.0))
        known = DeviceClass(mass, damping, 0.0)
        most = stiffest_spring(end.port, end.observer, delay, known)
        if most > 1e-4 * mass / PERIOD**2:
            return Draw(end, known._replace(stiffness=most), most)


def sharp(spring: float, mass: float, damping: float) -> np.ndarray:
    """Return frequencies that are dense at a swing."""
    at = PERIOD * math.sqrt(spring / mass)
    width = 0.5 * damping * PERIOD / mass
    near = at + width * np.concatenate([-np.geomspace(0.05, 1e3, 60), np.geomspace(0.05, 1e3, 60)])
    theta = np.concatenate([np.geomspace(1e-3, math.pi - 1e-6, 160), near])
    return np.unique(theta[(theta > 1e-4) & (theta < math.pi)])


def closed_radius(end: Ends, spring: float, damping: float, mass: float) -> float:
    """Return the spectral radius of the port on a device, each leaving wave coming straight back.

    Of either sign: a closed and an open far end. Written from the law's difference equations.
    """
    o, p, n = end.observer, end.port, end.delay
    step = expm(np.array([[0, 1, 0], [-spring / mass, -damping / mass, 1 / mass], [0, 0, 0]])
                * PERIOD)  # fmt: skip
    worst = 0.0
    x, v, at, speed, push, filtered, *rest = np.eye(6 + 2 * (n + 1))
    efforts, waves = rest[: n + 1], rest[n + 1 :]
    moved = step[:2] @ [x, v, -efforts[0]]
    outside = push - efforts[0] * o.inverse_mass
    ahead = at + PERIOD * speed + 0.5 * PERIOD**2 * outside
    error = moved[0] - ahead
    now = ahead + o.position * error
    speed = speed + PERIOD * outside + o.velocity * error
    push = push + o.disturbance * error
    filtered = filtered + p.filter_gain * (p.root * (now - at) / PERIOD - waves[0] - filtered)
    free_velocity = speed + PERIOD * p.lead * push - 2.0 * p.half_mobility * sum(efforts[1:])
    for far in (1.0, -1.0):
        wave = far * filtered
        effort = (p.impedance * free_velocity - p.root * wave) / p.divisor
        rows = [*moved, now, speed, push, filtered, *efforts[1:], effort, *waves[1:], wave]
        worst = max(worst, float(np.abs(np.linalg.eigvals(np.array(rows))).max()))
    return worst


def attack(seed: int, ports: int, devices: int) -> int:
    """Try devices in certified classes, and tuned ones beyond; return how many were tried."""
    rng = np.random.default_rng(seed)
    tried, broken = 0, 0
    for _ in range(ports):
        end, known, most = draw(rng)
        for _ in range(devices):
            mass = known.mass * math.exp(rng.exponential(0.7) * (rng.uniform() < 0.6))
            damping = known.damping * math.exp(rng.exponential(1.0) * (rng.uniform() < 0.6))
            spring = most * rng.choice([0.0, rng.uniform(), 1.0])
            theta = sharp(spring, mass, damping)
            worst = returned(end, held(spring, damping, theta, mass), theta).max()
            assert worst <= 1.0 + 1e-9, (end, known, mass, damping, spring)
            assert closed_radius(end, spring, damping, mass) <= 1.0 + 1e-9
            tried += 1
        tuned = 1.3 * most
        found = False
        for mass in known.mass * np.geomspace(1.0, 3.0, 5):
            theta = sharp(tuned, mass, known.damping)
            found = found or bool(
                returned(end, held(tuned, known.damping, theta, mass), theta).max() > 1.0 + 1e-9
            )
        broken += found
    assert broken > 0.5 * ports
    return tried


def test_random_exact_devices_in_certified_ports() -> None:
    """Passive and stable within what is certified; 1.3 times beyond, tuned users break most."""
    assert attack(1, ports=3, devices=8) == 24


@pytest.mark.nightly
@pytest.mark.slow  # `attack(2, ports=200, devices=50)` tries 10,000 of them, for a minute
def test_many_exact_devices_in_certified_ports() -> None:
    assert attack(2, ports=8, devices=50) == 400


def test_a_violation_between_the_points_of_any_grid_is_found() -> None:
    """A light damper makes it as narrow as d T / 2 m: 400 frequencies do not see it."""
    end = ends(0.05, 0.3)
    damping = 1e-3
    most = stiffest_spring(end.port, end.observer, 0, DeviceClass(MASS, damping, 0.0))
    spring = 1.006 * most
    grid = np.geomspace(5e-4, math.pi, 400)
    r, device = reflection(end.port, end.observer, 0), Folded(MASS / PERIOD, 1e-3, spring * PERIOD)
    assert np.all(least(r, device, grid, 0.0 * grid, touching(r, device, grid)) > 0.0)
    known = DeviceClass(MASS, damping, spring)
    assert not proved(end, known)
    theta = sharp(spring, MASS, damping)
    assert returned(end, held(spring, damping, theta), theta).max() > 1.007


def test_a_slow_resonance_is_not_hidden() -> None:
    """Below theta = 5e-4: a spring of 1e-3 N m/rad on a damper of 3e-9 N m s/rad."""
    end = ends(0.05, None, delay=1)
    known = DeviceClass(MASS, 3e-9, 9e-4)
    swing = PERIOD * math.sqrt(known.stiffness / MASS)
    assert swing < 5e-4
    found = gain_of(end, known)
    assert not found.contracting
    theta = swing * np.linspace(0.9, 1.1, 2001)
    assert returned(end, held(known.stiffness, known.damping, theta), theta).max() > 1.0
    assert gain_of(end, known._replace(stiffness=1e-6)).contracting


def test_the_damped_light_slave_is_refused() -> None:
    """bT/2m = 5 and dT/m = 1: proved for an undamped mass only, it exploded."""
    end = ends(0.02, None, mass=1e-6)
    known = DeviceClass(1e-6, 2e-3, 0.0)
    assert gain_of(end, known).greatest > 2.0
    assert gain_of(ends(0.02 / 20.0, None, mass=1e-6), known).contracting


def test_a_refused_gain_is_reached_by_a_device() -> None:
    """At 1.1 times the spring: a resistance and a reactance of the class do return as much."""
    end = ends(0.05, 0.5)
    assert gain_of(end, DeviceClass(MASS, 1e-3, 900.0)).greatest == 1.0
    found = gain_of(end, DeviceClass(MASS, 1e-3, 1200.0))
    assert found.greatest == pytest.approx(1.1127, abs=2e-4)
    theta = sharp(1200.0, MASS, 1e-3)
    y = held(1200.0, 1e-3, theta)
    assert 1.0 < returned(end, y, theta).max() < found.greatest + 1e-6


def test_the_polynomials_are_those_of_the_port() -> None:
    for impedance, pole, delay, *_ in CASES:
        end = ends(impedance, pole, delay=delay)
        r = reflection(end.port, end.observer, delay)
        s = returned_wave(end, THETA)
        curve = np.abs(s.c) ** 2 - s.low_pass * np.abs(s.a) ** 2
        slope = s.c * np.conj(s.e) - s.low_pass * s.a * np.conj(s.b)
        rest = np.abs(s.e) ** 2 - s.low_pass * np.abs(s.b) ** 2
        cosines = np.cos(np.outer(THETA, np.arange(r.rest.shape[1])))
        x = 1.0 - np.cos(THETA)
        scale = cosines @ r.slope[0] / slope.real
        assert scale[0] > 0.0
        below = np.abs(cosines @ r.slope[0] + 1j * np.sin(THETA) * (cosines @ r.slope_sine[0]))
        below = below / np.abs(slope)
        assert x * (cosines @ r.curve[0]) == pytest.approx(curve * below, rel=1e-6, abs=1e-9)
        assert x * (cosines @ r.rest[0]) == pytest.approx(rest * below, rel=1e-6, abs=1e-9)
        assert np.sin(THETA) * (cosines @ r.slope_sine[0]) == pytest.approx(
            slope.imag * below, rel=1e-6, abs=1e-9
        )
        assert r.curve_0[0] == 0.0
        assert r.rest_0[0] == 0.0


def test_a_port_that_a_locked_lever_makes_unstable_is_refused() -> None:
    end = ends(0.05, 0.5)
    assert reflection(end.port, end.observer, 0).locked
    heavy = end.port._replace(impedance=-3.0 / end.port.half_mobility)  # E(1) = 1, E(-1) < 0
    assert not reflection(heavy, end.observer, 0).locked
    device = DeviceClass(MASS, 1e-3, 0.0)
    assert class_gain(heavy, end.observer, 0, device) == ClassGain(math.inf, math.pi, False)
    assert suggested_spring(heavy, end.observer, 0, device) == 0.0
    assert stiffest_spring(heavy, end.observer, 0, device) == 0.0


def test_a_port_that_is_too_late_is_refused_without_a_proof() -> None:
    end = ends(0.02, 0.3, delay=LATEST + 1)
    device = DeviceClass(MASS, 1e-3, 1.0)
    assert gain_of(end, device) == ClassGain(math.inf, math.pi, False)
    assert not proved(end, device)


@settings(deadline=None, max_examples=tried(40))
@given(st.sampled_from(CASES), st.floats(0.0, 3.0), st.floats(1e-3, 0.1), st.floats(0.2, 1.5))
def test_a_cell_is_never_better_than_its_points(
    case: tuple, low: float, width: float, factor: float
) -> None:
    impedance, pole, delay, damping, spring = case
    end = ends(impedance, pole, delay=delay)
    r = reflection(end.port, end.observer, delay)
    device = Folded(MASS / PERIOD, damping, factor * spring * PERIOD)
    high = min(low * 1.05 + width, math.pi)
    centre, half = np.array([0.5 * (low + high)]), np.array([0.5 * (high - low)])
    bound = least(r, device, centre, half, touching(r, device, centre))
    if bound[0] < 0.0:
        return
    theta = np.linspace(max(low, 1e-3), high, 50)
    mass = MASS * np.geomspace(1.0, 10.0, 6)
    for m in mass:
        y = held(factor * spring, damping, theta, m)
        assert returned(end, y, theta).max() <= 1.0 + 1e-9


def test_a_sampled_device_is_the_mean_of_what_sampling_folds_together() -> None:
    """Colgate & Schenkel's weights, for the device: they add up to one."""
    theta = np.array([0.02, 0.4, 1.5, 3.0])
    total = np.zeros(4, dtype=complex)
    for at in range(-4000, 4001):
        turned = theta + 2.0 * math.pi * at
        s = 1j * turned / PERIOD
        total += np.sinc(turned / (2.0 * math.pi)) ** 2 * s / (MASS * s * s + 0.02 * s + 300.0)
    assert total == pytest.approx(held(300.0, 0.02, theta), rel=1e-6)


def test_a_class_with_stiffer_springs_is_found_no_better() -> None:
    """The class holds every softer spring: what was found with one is found with all stiffer."""
    end = ends()
    known = [DeviceClass(MASS, 1e-3, stiffness) for stiffness in np.geomspace(3e3, 3e5, 12)]
    found = [class_gain(end.port, end.observer, end.delay, one).greatest for one in known]
    assert found[0] > 1.0
    assert all(later >= 0.95 * earlier for earlier, later in pairwise(found))
