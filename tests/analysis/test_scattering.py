"""Scattering of an admittance port by its proof, of the wave filter, and greatest gains as such."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.analysis.ports.loop_modes import loop_roots
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.sampled import PulseTransfer
from tautwave.laws.servo.admittance import admittance_params
from tautwave.laws.wave_filter import filter_gain, filter_step
from tests.analysis.ends import port_end, reflecting_end, site_of
from tests.analysis.reference.admittance import admittance_scattering, filter_transfer
from tests.analysis.reference.scattering import greatest_gain

T = 1e-3


def values(pulse: PulseTransfer, z: np.ndarray) -> np.ndarray:
    top, bottom = (np.array([float(v) for v in part]) for part in pulse)
    return np.polyval(top, z) / np.polyval(bottom, z)


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
    end = port_end(Device(0.5, 0.02), site_of(T, 0.4), 10.0)
    roots = loop_roots(end, reflecting_end(-1.0), 60)
    assert np.abs(roots).max() <= 1.0 + 1e-9
