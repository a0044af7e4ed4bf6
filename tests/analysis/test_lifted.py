"""Sampled position pair: the algebra against its own search, motions in time, one-port limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.ports.sampled_loop import Device, LinearEnd, close_loop, position_end
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.errors import ConfigError
from tests.analysis.ends import site_of, spectral_radius
from tests.analysis.reference.lifted import (
    PairLaw,
    damping_curve,
    is_pair_passive,
    lifted_need,
    needed_equal_damping,
    needed_matrix,
    needed_slave_damping,
    spring_pair_damping,
)

T = 1e-3


@pytest.mark.parametrize("samples", [0, 1, 3, 50])
def test_a_spring_needs_half_the_round_trip_and_a_period(samples: int) -> None:
    law = PairLaw(SampledWall(1000.0, 0.0, T), samples, samples)
    need = needed_equal_damping(law)
    assert need.master == pytest.approx(spring_pair_damping(1000.0, T, samples), rel=1e-9)
    assert need.theta == 0.0
    assert need.proved


@pytest.mark.parametrize("samples", [0, 2, 20])
def test_the_pair_of_dampers_lies_on_a_hyperbola(samples: int) -> None:
    # (b_m - K T/2)(b_s - K T/2) >= (K T (1/2 + M))^2
    law = PairLaw(SampledWall(1000.0, 0.0, T), samples, samples)
    for master in (0.6, 1.0, 5.0, 80.0):
        need = needed_slave_damping(law, master)
        reported = 0.5 + (0.5 + samples) ** 2 / (master - 0.5)
        assert need.slave == pytest.approx(reported, rel=1e-9)
        assert is_pair_passive(law, master, reported)
        assert not is_pair_passive(law, master, 0.999 * reported)
    assert math.isinf(needed_slave_damping(law, 0.5).slave)
    assert math.isinf(needed_slave_damping(law, 0.3).slave)


@pytest.mark.slow
def test_towards_continuous_time_it_is_b_m_b_s_over_k_tau_squared() -> None:
    stiffness, tau = 1000.0, 0.02
    for period in (1e-3, 1e-4):
        samples = round(tau / period)
        law = PairLaw(SampledWall(stiffness, 0.0, period), samples, samples)
        need = needed_slave_damping(law, 40.0)
        assert need.slave * 40.0 == pytest.approx((stiffness * tau) ** 2, rel=130 * period)
        assert need.slave * 40.0 > (stiffness * tau) ** 2


@pytest.mark.parametrize(
    "law",
    [
        PairLaw(SampledWall(1000.0, 0.5, T), 3, 3),
        PairLaw(SampledWall(1000.0, 2.0, T, 1.0), 5, 5),
        PairLaw(SampledWall(1000.0, -0.3, T), 2, 2),
        PairLaw(SampledWall(1000.0, 1.0, T, 1.0, 5e-3), 2, 2),
        PairLaw(SampledWall(1000.0, 0.5, T), 3, 3, None, SampledWall(3000.0, 0.5, T)),
        PairLaw(SampledWall(300.0, 0.0, T), 4, 4, SampledWall(2e3, 1.0, T, 0.0, 2e-3), None),
    ],
)
def test_algebra_equals_the_form_searched(law: PairLaw) -> None:
    need = needed_equal_damping(law)
    assert need.proved
    thetas = np.linspace(1e-3, math.pi, 4000)
    least = np.linalg.eigvalsh(need.master * np.eye(4) - needed_matrix(law, thetas))[:, 0]
    assert least.min() >= -1e-4 * need.master
    assert least.min() <= 2e-3 * need.master
    beside = needed_slave_damping(law, 3.0 * need.master)
    shape = np.diag([beside.master] * 2 + [beside.slave] * 2)
    least = np.linalg.eigvalsh(shape - needed_matrix(law, thetas))[:, 0]
    assert abs(least.min()) <= 2e-3 * need.master


@pytest.mark.parametrize(("damping", "samples"), [(0.0, 0), (0.0, 2), (0.5, 2), (-0.3, 1)])
def test_motions_in_time_rise_to_the_bound(damping: float, samples: int) -> None:
    law = PairLaw(SampledWall(1000.0, damping, T), samples, samples)
    need = needed_equal_damping(law).master
    short, long = lifted_need(law, 10, 4), lifted_need(law, 30, 4)
    assert short <= long * (1.0 + 1e-12)
    assert long <= need * (1.0 + 1e-9)
    assert long >= 0.93 * need


def test_a_command_delay_counts_at_both_ends() -> None:
    law = PairLaw(SampledWall(1000.0, 0.0, T, 1.0), 2, 2)
    assert needed_equal_damping(law).master == pytest.approx(5.0, rel=1e-9)
    assert lifted_need(law, 30, 3) <= 5.0


def test_a_wall_alone_is_the_one_port_with_any_share_of_a_period() -> None:
    for delay in (0.0, 0.3, 0.5, 1.7):
        wall = SampledWall(1000.0, 0.2, T, delay)
        law = PairLaw(SampledWall(0.0, 0.0, T, delay), 0, 0, None, wall)
        need = needed_slave_damping(law, 0.5)
        assert need.slave == pytest.approx(wall_leak(wall).damping, rel=1e-5)


def test_unequal_ways_need_their_mean() -> None:
    law = PairLaw(SampledWall(1000.0, 0.0, T), 3, 5)
    need = needed_equal_damping(law)
    assert not need.proved
    assert need.master == pytest.approx(5.0, rel=1e-5)


def test_a_share_of_a_period_lies_between_whole_ones() -> None:
    needs = [
        needed_equal_damping(PairLaw(SampledWall(1000.0, 0.0, T, delay), 2, 2)).master
        for delay in (0.0, 0.4, 1.0)
    ]
    assert needs[0] < needs[1] < needs[2]
    assert needs[1] >= 1000.0 * T * (1.0 + 2.0 + 0.4) * (1.0 - 1e-5)


def ends_of(mass: float, damping: float, stiffness: float, coupler: float) -> LinearEnd:
    site = site_of(T, mass)
    return position_end(
        Device(mass, damping, stiffness),
        site,
        stiffness=coupler,
        damping=0.0,
        sent_stiffness=coupler,
        sent_damping=0.0,
    )


def test_what_passes_is_stable_with_any_masses_and_springs() -> None:
    rng = np.random.default_rng(4)
    for samples in (0, 3, 10):
        law = PairLaw(SampledWall(1000.0, 0.0, T), samples, samples)
        for _ in range(15):
            master = spring_pair_damping(1000.0, T, samples) * float(rng.uniform(0.7, 4))
            slave = needed_slave_damping(law, master).slave * 1.001
            masses = np.exp(rng.uniform(-4, 3, 2))
            springs = np.exp(rng.uniform(-2, 9, 2)) * rng.integers(0, 2, 2)
            ends = [
                ends_of(float(m), b, float(k), 1000.0)
                for m, b, k in zip(masses, (master, slave), springs, strict=True)
            ]
            assert spectral_radius(close_loop(*ends, samples)) <= 1.0 + 1e-7


def test_below_it_heavy_carts_oscillate_against_each_other() -> None:
    samples = 5
    need = spring_pair_damping(1000.0, T, samples)
    for share, grows in ((0.98, True), (1.001, False)):
        end = ends_of(200.0, need * share, 0.0, 1000.0)
        radius = spectral_radius(close_loop(end, end, samples))
        assert (radius > 1.0 + 1e-8) == grows


def test_damping_curve_falls() -> None:
    law = PairLaw(SampledWall(1000.0, 0.0, T), 3, 3)
    curve = damping_curve(law, np.linspace(1.0, 40.0, 12))
    assert np.all(np.diff(curve) < 0)


def test_bad_numbers() -> None:
    with pytest.raises(ConfigError, match="to_slave"):
        needed_equal_damping(PairLaw(SampledWall(1.0), -1, 0))
    with pytest.raises(ConfigError, match="wall_slave"):
        needed_equal_damping(PairLaw(SampledWall(1.0), 0, 0, None, SampledWall(1.0, delay=1.0)))
    with pytest.raises(ConfigError, match="master damping"):
        needed_slave_damping(PairLaw(SampledWall(1.0)), -1.0)
