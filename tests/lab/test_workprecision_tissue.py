"""Tissue beside MuJoCo's flex: the same beam, held against a fine run."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave_scenes.networks3d.live import Model3d
from tests.lab.peers import mujoco_flex as flex
from tests.lab.peers import scipy_control
from tests.lab.workprecision import tissue

SPAN_S, STEP = 0.03, 1e-3


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A beam of ten tetrahedra, thrown so gently that both materials are linear."""
    monkeypatch.setitem(tissue.CELLS, 10, (2, 1, 1))
    monkeypatch.setattr(tissue, "THROWN", 0.01)


@pytest.mark.usefixtures("slow")
def test_mujoco_s_flex_is_the_same_beam() -> None:
    """It ends within what our step at 1 ms is off; at rest they would be 100 % apart."""
    pytest.importorskip("mujoco")
    network = tissue.beam(10)
    model = Model3d(network, "linearly_implicit", STEP)
    for _ in range(round(SPAN_S / STEP)):
        model.advance([])
    start = np.array([part for mass in network.masses for part in mass.position])
    own = np.array(model.arrays.x[: len(start)]) - start
    ends, spent = flex.throw_flex(tissue.beam_mesh(10), 5e-5, "RK4", SPAN_S)
    assert np.abs(own).max() > 2e-5
    assert np.abs(ends - start - own).max() < 0.02 * np.abs(own).max()
    assert math.isnan(spent)


@pytest.mark.usefixtures("slow")
def test_a_flex_that_blew_up_has_no_error() -> None:
    pytest.importorskip("mujoco")
    mesh = tissue.beam_mesh(10)
    own = np.zeros(3 * 8)
    found = flex.flex_points(mesh, (1e-2, 2e-4), own, 1e-4, 1)
    errors = {(point.method, point.step_s): point.error for point in found.points}
    assert math.isnan(errors["MuJoCo flex Euler", 1e-2])
    assert errors["MuJoCo flex Euler", 2e-4] < 0.1
    assert errors["MuJoCo flex RK4", 2e-4] < errors["MuJoCo flex discrete", 2e-4]
    assert found.apart > 0.5  # `own` is nowhere
    assert all(point.peer and point.cpu_s > 0.0 for point in found.points)


def test_without_mujoco_there_is_no_flex(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scipy_control, "find_spec", lambda _: None)
    assert flex.flex_points(tissue.beam_mesh(50), (1e-3,), np.zeros(120), 1.0, 1) is None
