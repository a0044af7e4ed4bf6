"""The bound of a cell, against devices drawn from every frequency that the sampling folds in."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.wave_port.contraction import Folded, least, touching
from tautwave.analysis.wave_port.reflection import Reflection

FOLDED = range(-6, 7)


def form(curve: float, slope: complex, rest: float) -> Reflection:
    """Return a form with the same curve and rest at all theta, and this slope at theta = pi/2."""
    two = np.zeros((2, 1))
    first = np.array([[1.0], [0.0]])
    return Reflection(
        two, first * slope.real, first * slope.imag, two, first[:, 0] * curve, first[:, 0] * rest,
        True,
    )  # fmt: skip


def members(rng: np.random.Generator, device: Folded, theta: float, count: int) -> np.ndarray:
    """Return sampled admittances of the class, many of them at its edges."""
    total = np.zeros(count, dtype=complex)
    alike = rng.uniform(size=count) < 0.5
    for n in FOLDED:
        at = theta + 2.0 * math.pi * n
        edge = device.mass * abs(at) - device.stiffness / abs(at)
        far = np.exp(rng.uniform(-6.0, 6.0, count))
        r = device.damping * (1.0 + np.where(rng.uniform(size=count) < 0.5, 0.0, far))
        far = np.exp(rng.uniform(-6.0, 6.0, count))
        x = edge + np.where(rng.uniform(size=count) < 0.5, 0.0, far) * (abs(edge) + device.mass)
        y = 1.0 / (r + 1j * x)
        y = np.where((rng.uniform(size=count) < 0.3) & ~alike & (n != 0), 0.0, y)
        total += np.sinc(0.5 * at / math.pi) ** 2 * (y if at > 0.0 else np.conj(y))
    return total


def draw(rng: np.random.Generator) -> tuple[Folded, float, complex]:
    device = Folded(
        1.0, math.exp(rng.uniform(-4.0, 1.0)), float(rng.choice([0.0, math.exp(rng.normal())]))
    )
    slope = complex(rng.normal(), rng.normal())
    curve = rng.normal() * math.exp(rng.uniform(-4.0, 2.0))
    return device, curve, slope


@pytest.mark.sparse(2)
@pytest.mark.parametrize("sought", [True, False])
def test_a_form_that_is_negative_somewhere_is_never_proved(sought: bool) -> None:
    """And one that is well above zero mostly is, with the point that is sought."""
    rng = np.random.default_rng(4)
    theta, width = np.array([0.5 * math.pi]), np.zeros(1)
    proved = tried = 0
    for _ in range(80):
        device, curve, slope = draw(rng)
        y = members(rng, device, theta[0], 1500)
        lowest = float(np.min(curve * np.abs(y) ** 2 + 2.0 * (slope * y).real))
        if lowest >= -1e-6:
            continue
        tried += 1
        for share in (0.99, 1.5):
            r = form(curve, slope, -share * lowest)
            point = touching(r, device, theta) if sought else rng.normal(size=1) * (1.0 + 1j)
            bound = least(r, device, theta, width, point)[0]
            if share < 1.0:
                assert not bound >= 0.0, (device, curve, slope)
            else:
                proved += bool(bound >= 0.0)
    assert tried > 40
    assert proved > 0.7 * tried or not sought
