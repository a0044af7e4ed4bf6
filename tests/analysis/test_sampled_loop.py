"""The state matrix of a sampled pair against published boundaries and against itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from tautwave.analysis.ports.loop_modes import least_damped, loop_roots, mode_of
from tautwave.analysis.ports.sampled_loop import (
    Device,
    LinearEnd,
    close_loop,
    position_end,
)
from tests.analysis.ends import port_end, reflecting_end, site_of, spectral_radius
from tests.analysis.reference.boundary import stability_boundary, stability_crossings

T = 1e-3


def naive_radius(m: float, b: float, samples: int) -> float:
    """Spectral radius of the obvious port, F = b v - sqrt(2b) a, u = sqrt(2b) v - a, u returned."""
    root = math.sqrt(2.0 * b)

    def slot(state: list[float]) -> list[float]:
        v, effort, *line = state
        mean = v - 0.5 * T / m * effort
        arriving = line[-1]
        leaving = root * mean - arriving
        return [v - T / m * effort, b * mean - root * arriving, leaving, *line[:-1]]

    size = 2 + samples
    return spectral_radius(np.array([slot(list(unit)) for unit in np.eye(size)]).T)


def wall(k: float, b: float, *, delay: int = 0, own: float = 0.1, m: float = 0.1) -> float:
    """Spectral radius of a device at a sampled spring-damper that never lets go."""
    end = position_end(
        Device(m, own, 0.0, delay),
        site_of(T, m, delay),
        stiffness=k,
        damping=b,
        sent_stiffness=k,
        sent_damping=b,
    )
    return spectral_radius(end.a)


def test_naive_port_is_unstable_and_ours_is_not() -> None:
    assert naive_radius(0.5, 10.0, 2) == pytest.approx(1.00995, abs=5e-6)
    end = port_end(Device(0.5), site_of(T, 0.5), 10.0)
    for samples in (0, 1, 2, 50):
        # A double root at 1: rounding moves it by its root.
        assert spectral_radius(close_loop(end, reflecting_end(1.0), samples)) <= 1.0 + 1e-7


@pytest.mark.parametrize(
    ("b", "delay", "critical"),
    [
        (0.0, 0, 200.0333),
        (0.0, 1, 66.68518),
        (1.0, 0, 2178.4834),
        (1.0, 1, 725.38746),
        (5.0, 1, 3211.4264),
        (50.0, 1, 14017.358),
    ],
)
def test_stiffest_stable_wall_as_published(b: float, delay: int, critical: float) -> None:
    assert (
        wall(critical * (1 - 2e-6), b, delay=delay)
        < 1.0
        < wall(critical * (1 + 2e-6), b, delay=delay)
    )


def test_pole_of_a_mass_at_a_sampled_spring() -> None:
    assert wall(1000.0, 0.0, own=0.0) == pytest.approx(1.0024968828, abs=1e-10)


def test_device_moves_as_the_matrix_exponential_says() -> None:
    device = Device(0.3, 0.7, 400.0)
    end = position_end(
        device, site_of(T, 0.3), stiffness=0.0, damping=0.0, sent_stiffness=1.0, sent_damping=0.0
    )
    flow = np.zeros((3, 3))
    flow[0, 1] = 1.0
    flow[1] = [-400.0 / 0.3, -0.7 / 0.3, -1.0 / 0.3]
    expected = expm(flow * T)
    at = [end.states.index(name) for name in ("position", "velocity", "command")]
    assert end.a[np.ix_(at[:2], at)] == pytest.approx(expected[:2], rel=1e-12, abs=1e-15)


def test_late_command_acts_in_two_parts() -> None:
    whole = port_end(Device(0.3, 0.1, 400.0, 1.0), site_of(T, 0.3, 1), 5.0)
    almost = port_end(Device(0.3, 0.1, 400.0, 1.0 - 2e-9 + 1e-9), site_of(T, 0.3, 1), 5.0)
    assert whole.a.shape == almost.a.shape
    late = port_end(Device(0.3, 0.1, 400.0, 0.4), site_of(T, 0.3, late=0.4), 5.0)
    assert "acting" in late.states
    assert "last_acted" in late.states


@pytest.mark.parametrize("b", [1.0, 20.0, 400.0])
@pytest.mark.parametrize(("delay", "share"), [(0, 1.0), (0, 0.5), (1, 1.0), (1, 0.6)])
def test_wave_line_is_stable_at_every_delay(b: float, delay: int, share: float) -> None:
    end = port_end(Device(0.5, 0.0, 0.0, delay), site_of(T, 0.5 * share, delay), b)
    other = port_end(Device(0.2, 0.0, 0.0, delay), site_of(T, 0.2 * share, delay), b)
    for samples in (1, 2, 7, 50):
        assert least_damped(end, other, samples, T).radius <= 1.0 + 1e-9


@pytest.mark.slow
def test_wave_line_is_stable_at_half_a_second() -> None:
    for b in (1.0, 400.0):
        end, other = (port_end(Device(m), site_of(T, 0.8 * m), b) for m in (0.5, 0.2))
        assert least_damped(end, other, 500, T).radius <= 1.0 + 1e-9


def test_overestimated_mass_is_not() -> None:
    end = port_end(Device(0.5), site_of(T, 1.0), 50.0)
    assert least_damped(end, end, 7, T).radius > 1.0 + 1e-5


@pytest.mark.parametrize(("b", "k"), [(10.0, 538.0), (100.0, 538.0), (10.0, 5380.0)])
def test_stiff_hand_costs_the_port_some_damping(b: float, k: float) -> None:
    """A spring is a force the port cannot predict: it needs b k T**2 / 2 m, and little less."""
    m = 0.5
    needed = b * k * T * T / (2.0 * m)
    free = port_end(Device(m), site_of(T, m), b)
    for samples in (0, 5, 50, 300):
        held = port_end(Device(m, needed, k), site_of(T, m), b)
        assert least_damped(held, free, samples, T).radius <= 1.0 + 1e-9
    less = port_end(Device(m, 0.5 * needed, k), site_of(T, m), b)
    assert least_damped(less, free, 50, T).radius > 1.0 + 1e-8


def random_pair(rng: np.random.Generator) -> tuple[LinearEnd, LinearEnd, int]:
    samples = int(rng.integers(1, 60))
    b = float(np.exp(rng.uniform(0, 6)))
    delay = float(rng.choice([0.0, 1.0, 2.0, 0.4, 1.3]))
    pipe = int(delay)
    ends = []
    by_wave = bool(rng.integers(2))
    k = 5.0 * b / (samples * T) * float(rng.choice([0.01, 0.1, 1.0]))
    for _ in range(2):
        m = float(np.exp(rng.uniform(-3, 1)))
        stiffness = float(np.exp(rng.uniform(2, 8)) * rng.integers(2))
        damping = float(np.exp(rng.uniform(-5, 2)) * rng.integers(2))
        device = Device(m, damping, stiffness, delay)
        gain = float(rng.choice([1.0, 0.3]))
        belief = site_of(T, m * float(rng.uniform(0.5, 1)), pipe, delay - pipe, gain=gain)
        if by_wave:
            step, matched = float(rng.choice([1.0, 0.2])), bool(rng.integers(2))
            ends.append(port_end(device, belief, b, pole=0.3, matched=matched, filter_gain=step))
        else:
            ends.append(
                position_end(
                    device, belief, stiffness=k, damping=b, sent_stiffness=k, sent_damping=b
                )
            )
    return ends[0], ends[1], samples


@pytest.mark.slow
def test_roots_of_a_long_line_are_the_eigenvalues_of_its_matrix() -> None:
    rng = np.random.default_rng(5)
    for _ in range(40):
        master, slave, samples = random_pair(rng)
        dense = np.linalg.eigvals(close_loop(master, slave, samples)).astype(complex)
        roots = loop_roots(master, slave, samples)
        assert len(roots) == len(dense)
        assert mode_of(roots, T).radius == pytest.approx(mode_of(dense, T).radius, abs=1e-9)


def test_mode_tells_growth_and_frequency() -> None:
    z = 1.001 * np.exp(1j * 0.1)
    mode = mode_of(np.array([1.0, z, z.conjugate(), 0.5], dtype=complex), T)
    assert mode.radius == pytest.approx(1.001)
    assert mode.growth == pytest.approx(math.log(1.001) / T)
    assert mode.frequency == pytest.approx(0.1 / (2 * math.pi * T))
    assert mode_of(np.array([1.0], dtype=complex), T).growth == 0.0
    assert mode_of(np.zeros(2, dtype=complex), T).growth == -math.inf


def test_crossings_are_found_to_one_sample() -> None:
    def radius(samples: int) -> float:
        return 1.1 if 17 <= samples < 226 or samples >= 400 else 0.9

    found = stability_crossings(radius, [0, 10, 100, 300, 500])
    assert [(c.samples, c.stable) for c in found] == [(17, False), (226, True), (400, False)]
    assert stability_boundary(radius, [0, 100]) == 17
    assert stability_boundary(radius, [0, 10]) is None
    assert stability_boundary(radius, [20, 100]) == 20
