"""Z-width and what is felt, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.ports.z_width import (
    Environment,
    greatest_impedance,
    least_impedance,
    transmitted,
    z_width,
)
from tests.analysis.reference.hybrids import Rig, position_position, wave_line

W = np.geomspace(0.1, 200.0, 500)


def test_free_and_clamped_line() -> None:
    b, tau = 10.0, 0.004
    rig = Rig(0.0, 0.0, 0.0, 0.0, math.inf, 0.0, tau, tau, b)
    h = wave_line(rig, 1j * W)
    assert np.abs(least_impedance(h)) == pytest.approx(b * np.abs(np.tan(W * tau)), rel=1e-9)
    assert np.abs(greatest_impedance(h)) == pytest.approx(b / np.abs(np.tan(W * tau)), rel=1e-9)


def test_width_of_a_line_is_twice_its_logarithm() -> None:
    b, tau = 10.0, 0.004
    rig = Rig(0.0, 0.0, 0.0, 0.0, math.inf, 0.0, tau, tau, b)
    found = z_width(lambda s: wave_line(rig, s), 1.0, 100.0, 4000)
    w = np.linspace(1.0, 100.0, 40_000)
    reported = float(np.mean(np.abs(2.0 * np.log(np.tan(w * tau)))))
    assert found.width == pytest.approx(reported, rel=1e-3)
    assert found.decibels == pytest.approx(20.0 * reported / math.log(10.0), rel=1e-3)


def test_limits_of_what_is_felt() -> None:
    rig = Rig(0.5, 1.0, 0.5, 1.0, 300.0, 5.0, 0.01, 0.02)
    h = position_position(rig, 1j * W)
    assert transmitted(h, np.zeros(len(W), complex)) == pytest.approx(least_impedance(h))
    hard = transmitted(h, np.full(len(W), 1e12, complex))
    assert hard == pytest.approx(greatest_impedance(h), rel=1e-6)


def test_a_coupler_in_series_and_nothing_else() -> None:
    # massless devices without delay: K in series with k shows K k / (K + k)
    rig = Rig(0.0, 0.0, 0.0, 0.0, 300.0)
    s = 1j * W
    felt = transmitted(position_position(rig, s), Environment(stiffness=100.0).impedance(s))
    assert felt * s == pytest.approx(np.full(len(W), 75.0 + 0j), rel=1e-9)
