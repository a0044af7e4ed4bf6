"""A position coupling without delay: passive exactly where it is soft, against the exact loop."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.ports.sampled_loop import Device, close_loop, position_end
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.certificate import Element
from tests.analysis.ends import site_of
from tests.certificate.rigs import certified, element

RIG = "bench-position-coupling"
LINE = "coupling.delay_s=0"


def damping_between(first: float, second: float) -> float:
    """Damping of the relative motion of two damped devices."""
    return first * second / (first + second)


def soft(stiffness: float, damping: float = 0.0, *more: str) -> tuple[str, ...]:
    pair = f"coupling.pairs.lever={{stiffness: {stiffness!r}, damping: {damping!r}}}"
    return (LINE, pair, *more)


def coupling(*changes: str) -> Element:
    return element(certified(*changes, name=RIG), "coupling of lever")


@pytest.mark.parametrize("damping", [0.0, 4e-4])
def test_the_bound_is_half_a_period_of_stiffness_and_the_damper(damping: float) -> None:
    """K T / 2 + D <= d_m d_s / (d_m + d_s), 2e-3 N m s/rad at either lever."""
    between = damping_between(2e-3, 2e-3)
    limit = 2.0 * (between - damping) / 1e-3
    fine = coupling(*soft(0.999 * limit, damping)).passive
    assert fine.passed
    assert "passive by tuning for any hand and environment" in fine.reason
    assert not coupling(*soft(1.001 * limit, damping)).passive.passed


def test_a_scaled_slave_counts_as_the_master_feels_it() -> None:
    """A slave that turns half as far: a quarter of its damping, at force scale two."""
    scaled = "coupling.pairs.lever={stiffness: 1.0, damping: 0, position_scale: 0.5}"
    numbers = coupling(LINE, scaled).numbers
    assert numbers["damping_left"] == pytest.approx([2e-3, 2e-3 * 0.5 / 2.0])


def test_a_wall_takes_its_damping_first() -> None:
    """Half a period of 2 N m/rad takes half of the master's; the rest covers 4/3 N m/rad."""
    wall = "coupling.pairs.lever.wall_master={position: 0.3, stiffness: 2.0}"
    assert coupling(*soft(1.5)).passive.passed
    assert coupling(*soft(1.33), wall).passive.passed
    assert not coupling(*soft(1.34), wall).passive.passed


def test_with_a_delay_or_a_filter_the_law_itself_is_asked() -> None:
    delayed = coupling().passive
    assert not delayed.passed
    assert "sampled, with delays" in delayed.reason
    filtered = "master.axes.lever.velocity_filter_s=0.002"
    assert coupling(*soft(0.1), filtered).passive.passed
    assert not coupling(*soft(3.0), filtered).passive.passed


def test_late_commands_cost_what_they_cost_a_wall() -> None:
    late = "buses.bench.options={command_delay_s: 0.001}"
    needed = coupling(*soft(0.6, 0.0, late)).numbers["clipped_needed"]
    assert needed == pytest.approx(2.0 * 0.6 * 1e-3 * 1.5, rel=1e-9)


@pytest.mark.parametrize("share", [0.25, 0.5, 0.9])
def test_a_fraction_of_a_period_costs_what_it_costs_a_wall(share: float) -> None:
    """Two equal devices are one of half the damping, on the wall that their motion feels."""
    late = f"buses.bench.options={{command_delay_s: {share * 1e-3}}}"
    wall = wall_leak(SampledWall(0.6, 0.0, 1e-3, share)).damping
    needed = coupling(*soft(0.6, 0.0, late)).numbers["clipped_needed"]
    assert needed == pytest.approx(2.0 * wall, rel=1e-6)


def spectral_radius(stiffness: float, damping: float, one: Device, two: Device) -> float:
    site = site_of(1e-3, 1e-3)
    end = {"stiffness": stiffness, "damping": damping}
    sent = {"sent_stiffness": stiffness, "sent_damping": damping}
    ends = [position_end(device, site, **end, **sent) for device in (one, two)]
    return float(np.max(np.abs(np.linalg.eigvals(close_loop(*ends, 0)))))


def test_no_pair_of_springs_shakes_a_certified_coupling_and_some_shake_one_beyond() -> None:
    rng = np.random.default_rng(5)
    between = damping_between(2e-3, 2e-3)
    worst = {0.98: 0.0, 4.0: 0.0}
    for share in worst:
        for _ in range(400):
            devices = [
                Device(
                    1e-3 * math.exp(rng.exponential()),
                    2e-3,
                    float(rng.choice([0.0, math.exp(rng.uniform(-2.0, 8.0))])),
                )
                for _ in range(2)
            ]
            stiffness = 2.0 * share * between / 1e-3
            found = spectral_radius(stiffness, 0.0, *devices)
            worst[share] = max(worst[share], found)
    assert worst[0.98] <= 1.0 + 1e-9
    assert worst[4.0] > 1.0 + 1e-4
