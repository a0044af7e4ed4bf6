"""A force that is shown late: its lag is found, also where it is more than the damping tells."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.analysis.identification.contact_model import fit_contact
from tautwave.analysis.identification.contact_motion import motion_of
from tautwave.analysis.identification.sensor_lag import Recorded, fit_lagged

PERIOD = 5e-4


def test_a_contact_that_damps_a_little_has_no_lag() -> None:
    t = np.arange(2000) * PERIOD
    x = 0.05 * np.sin(2.0 * np.pi * 2.1 * t)
    speed = np.gradient(x, PERIOD)
    depth = np.maximum(x - 0.01, 0.0)
    effort = 20.0 * depth + 5e-3 * speed * (depth > 0.0)
    plain = fit_contact(motion_of(x, effort, PERIOD, cutoff_hz=40.0), "contact")
    assert plain is not None
    assert 0.0 < plain.parameters["damping"].value < 0.01
    assert fit_lagged(Recorded(x, effort, PERIOD, 40.0, np.ones(len(t), bool)), plain) is None


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.03])
def test_the_lag_of_a_force_sensor_is_found_beside_the_damping(damping: float) -> None:
    """20 N m/rad behind a surface, shown 3 ms late: alone, its damping would be -0.06 or -0.03."""
    t = np.arange(8000) * PERIOD
    omega = 2.0 * np.pi * np.array([0.9, 2.1, 7.3])[:, None]
    size = np.array([0.05, 0.03, 0.02])[:, None]

    def at(when: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = (size * np.sin(omega * when)).sum(axis=0)
        return x, (size * omega * np.cos(omega * when)).sum(axis=0)

    late, speed = at(t - 3e-3)
    depth = np.maximum(late - 0.01, 0.0)
    effort = 20.0 * depth + damping * speed * (depth > 0.0)
    position, _ = at(t)
    known = np.ones(len(t), bool)
    plain = fit_contact(motion_of(position, effort, PERIOD, cutoff_hz=40.0), "contact")
    assert plain is not None
    assert plain.parameters["damping"].value < -0.02
    found = fit_lagged(Recorded(position, effort, PERIOD, 40.0, known), plain)
    assert found is not None
    assert found.parameters["lag"].value == pytest.approx(3e-3, rel=0.04)
    assert found.parameters["stiffness"].value == pytest.approx(20.0, rel=2e-3)
    assert found.parameters["damping"].value == pytest.approx(damping, abs=2e-3)
