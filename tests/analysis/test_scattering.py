"""Scattering of ports as implemented: against the live laws, their proofs, and loops."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.analysis.ports.loop_modes import loop_roots, spectral_radius, transfer
from tautwave.analysis.ports.sampled_loop import Device, Site, close_loop, reflecting_end, wave_end
from tautwave.analysis.ports.scattering import greatest_gain, port_scattering, spring_damping
from tautwave.analysis.walls.sampled import PulseTransfer
from tautwave.laws.admittance import admittance_params
from tautwave.laws.tracked_port import port_params
from tautwave.laws.wave_filter import filter_gain, filter_step
from tests.analysis.reference.admittance import admittance_scattering, filter_transfer

T = 1e-3


def site_of(
    mass: float,
    *,
    impedance: float = 10.0,
    delay: int = 0,
    late: float = 0.0,
    gain: float = 1.0,
    matched: bool = False,
    drift: float = 0.05,
    period: float = T,
) -> Site:
    port = port_params(period, impedance, mass, matched, drift, 0.0)
    return Site(port, gain, delay, late)


def values(pulse: PulseTransfer, z: np.ndarray) -> np.ndarray:
    top, bottom = (np.array([float(v) for v in part]) for part in pulse)
    return np.polyval(top, z) / np.polyval(bottom, z)


@pytest.mark.parametrize("seed", range(25))
def test_equals_the_live_laws_run_slot_by_slot(seed: int) -> None:
    rng = np.random.default_rng(seed)
    delay = int(rng.integers(4))
    late = float(rng.choice([0.0, rng.uniform(0.05, 0.95)]))
    mass = float(np.exp(rng.uniform(-4, 1)))
    device = Device(
        mass,
        float(rng.choice([0.0, rng.uniform(0, 3)])),
        float(rng.choice([0.0, rng.uniform(0, 5e3) * mass])),
        float(rng.integers(4)) + float(rng.choice([0.0, late, 0.3])),
    )
    site = site_of(
        mass * float(rng.uniform(0.4, 1.5)),
        impedance=float(np.exp(rng.uniform(-2, 3))) * mass,
        delay=delay,
        late=late,
        gain=float(rng.choice([1.0, rng.uniform(0.1, 1.0)])),
        matched=bool(rng.integers(2)),
        drift=float(rng.uniform(0.005, 0.5)),
    )
    step = float(rng.choice([1.0, rng.uniform(0.05, 1.0)]))
    z = np.exp(1j * np.linspace(0.05, 3.1, 60))
    reported, _ = transfer(wave_end(device, site, filter_gain=step), z)
    found = values(port_scattering(device, site, filter_gain=step), z)
    assert found == pytest.approx(reported, rel=1e-7, abs=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2, 5, 12])
@pytest.mark.parametrize("share", [0.25, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("impedance", [0.5, 10.0, 400.0])
def test_a_free_mass_never_underestimated_is_passive(
    delay: int, share: float, impedance: float
) -> None:
    site = site_of(0.5 * share, impedance=impedance, delay=delay)
    gain = greatest_gain(port_scattering(Device(0.5, command_delay=delay), site))
    assert gain.passive
    assert gain.greatest == pytest.approx(1.0, abs=1e-9)  # nothing is lost at standstill


@pytest.mark.parametrize("delay", [0, 2])
@pytest.mark.parametrize("excess", [1.01, 1.25, 2.0, 4.0])
def test_an_overestimated_mass_is_not(delay: int, excess: float) -> None:
    site = site_of(0.5 * excess, delay=delay)
    device = Device(0.5, command_delay=delay)
    gain = greatest_gain(port_scattering(device, site))
    assert not gain.passive
    assert gain.greatest > 1.0 + 1e-7
    # and a lossless far end, somewhere far enough, makes it grow
    end, far = wave_end(device, site), reflecting_end(1.0)
    if excess >= 2.0:
        radii = [spectral_radius(close_loop(end, far, samples)) for samples in (20, 21, 40, 41)]
        assert max(radii) > 1.0 + 1e-6


def test_passive_means_stable_behind_any_lossless_line() -> None:
    site = site_of(0.4, delay=1)
    device = Device(0.5, 0.05, 20.0, 1.0)
    assert greatest_gain(port_scattering(device, site)).passive
    for reflection in (1.0, -1.0):
        for samples in (0, 1, 7, 30):
            matrix = close_loop(wave_end(device, site), reflecting_end(reflection), samples)
            assert spectral_radius(matrix) <= 1.0 + 1e-9


@pytest.mark.parametrize(
    ("impedance", "stiffness", "mass"), [(20.0, 538.0, 0.25), (10.0, 1e4, 0.5), (100.0, 1e5, 0.1)]
)
def test_a_spring_asks_for_damping(impedance: float, stiffness: float, mass: float) -> None:
    site = site_of(mass, impedance=impedance)
    least = spring_damping(site, stiffness)
    gains = [
        greatest_gain(port_scattering(Device(1.3 * mass, least * share, stiffness), site))
        for share in (0.98, 1.001)
    ]
    assert gains[0].greatest > 1.0 + 1e-8
    assert gains[1].passive


def test_a_share_of_a_period_late_is_not_covered_by_the_proof() -> None:
    gain = greatest_gain(port_scattering(Device(0.5, command_delay=0.4), site_of(0.4, late=0.4)))
    assert gain.greatest == pytest.approx(1.01588, abs=1e-5)


def test_repaying_drift_keeps_it_and_filtering_the_velocity_does_not() -> None:
    device = Device(0.5, 0.0)
    for drift in (1e-3, 0.05, 5.0):
        assert greatest_gain(port_scattering(device, site_of(0.4, drift=drift))).passive
    assert not greatest_gain(port_scattering(Device(0.4), site_of(0.5, gain=0.3))).passive


def test_the_proof_beats_a_grid() -> None:
    device, site = Device(0.1, 0.001, 4e3, 1.0), site_of(0.08, delay=1, impedance=5.0, gain=0.5)
    gain = greatest_gain(port_scattering(device, site))
    z = np.exp(1j * np.linspace(1e-4, np.pi, 40_000))
    seen = np.abs(values(port_scattering(device, site), z)).max()
    assert seen <= gain.upper
    assert gain.upper == pytest.approx(gain.greatest, rel=1e-9)
    assert gain.greatest == pytest.approx(seen, rel=1e-4)


# -- admittance ------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0, 1, 3, 8])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 1.0])
def test_admittance_port_is_passive_up_to_the_bound(delay: int, share: float) -> None:
    port = admittance_params(T, 10.0, 1000.0, delay)
    assert greatest_gain(admittance_scattering(port, delay, 1000.0 * share)).passive


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_admittance_port_without_a_bound_is_active(delay: int) -> None:
    port = admittance_params(T, 10.0, 0.0, delay)
    assert greatest_gain(admittance_scattering(port, delay, 100.0)).greatest > 1.01


def test_admittance_port_at_a_stiffer_spring_or_a_damper() -> None:
    port = admittance_params(T, 10.0, 1000.0, 0)
    assert greatest_gain(admittance_scattering(port, 0, 1200.0)).greatest > 1.02
    # an outside damper is pressed a period late: the bound of stiffness says nothing of it
    assert greatest_gain(admittance_scattering(port, 0, 500.0, 2.0)).greatest > 1.4
    assert not greatest_gain(admittance_scattering(port, 0, 500.0, 50.0)).stable


# -- filter, and bounds as such --------------------------------------------------------------------


@pytest.mark.parametrize("corner", [1.0, 40.0, 300.0])
def test_wave_filter(corner: float) -> None:
    step = filter_gain(corner, T)
    assert greatest_gain(filter_transfer(step)).passive
    z = np.exp(0.7j)
    state, wave, out = 0.0, 0.0, []
    for at in range(4000):  # a long sine through the live law
        wave = np.cos(0.7 * at)
        state, _, _ = filter_step(step, T, state, wave)
        out.append(state)
    seen = max(out[2000:])
    assert seen == pytest.approx(abs(values(filter_transfer(step), np.array([z]))[0]), rel=1e-2)


def test_an_unstable_transfer_has_no_gain() -> None:
    gain = greatest_gain(PulseTransfer((1.0,), (1.0, -1.0)))
    assert not gain.stable
    assert not gain.passive
    assert gain.theta == pytest.approx(0.0)
    assert greatest_gain(PulseTransfer((0.0,), (1.0,))).greatest == 0.0


def test_a_resonance_no_grid_sees() -> None:
    # (z^2 - a) of a notch beside a pole pair: a peak 1e-6 wide and 1.5 high
    radius, theta = 1.0 - 1e-6, 1.234
    poles = np.poly([radius * np.exp(1j * theta), radius * np.exp(-1j * theta)]).real
    inner = 1.0 - 1.5e-6
    zeros = np.poly([inner * np.exp(1j * theta), inner * np.exp(-1j * theta)]).real
    gain = greatest_gain(PulseTransfer(tuple(zeros), tuple(poles)))
    assert gain.greatest == pytest.approx(1.5, rel=1e-4)
    assert gain.theta == pytest.approx(theta, abs=1e-5)


def test_roots_of_a_long_line_agree() -> None:
    end = wave_end(Device(0.5, 0.02), site_of(0.4))
    roots = loop_roots(end, reflecting_end(-1.0), 60)
    assert np.abs(roots).max() <= 1.0 + 1e-9
