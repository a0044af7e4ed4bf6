"""Quantised walls: where an adversary's motion pays, simulated against Abbott and Okamura."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from tautwave.analysis.maps.quantised import adversary_gain, paying_stiffness, quantised_plane
from tautwave.analysis.maps.stability import Column, vary
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.rules import quantised_stiffness
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.errors import ConfigError

START = Column(0.0, SampledWall(0.0, 0.0, 1e-3), Device(0.1, 0.7), 0.7, 0.03, 1e-4)


@pytest.mark.slow
def test_simulated_boundary_is_the_rule_over_decades() -> None:
    limited_by = set()
    for device in itertools.product(
        (1e-4, 3e-2, 10.0), (1e-4, 3e-2, 1.0), (2e-5, 1e-3, 1e-2), (1e-7, 3e-5, 1e-3)
    ):
        reported = quantised_stiffness(*device)
        found = paying_stiffness(*device, 1e-6 * reported, 1e6 * reported)
        assert found == pytest.approx(reported, rel=0.01), device
        b, _, T, _ = device
        limited_by.add(reported == 2.0 * b / T)
    assert limited_by == {False, True}


def test_without_coulomb_friction_no_stiffness_is_safe() -> None:
    assert adversary_gain(1e-3, 0.7, 0.0, 1e-3, 1e-4) > 1.0
    assert adversary_gain(1e-3, 0.0, 0.0, 1e-3, 1e-4) == math.inf
    assert math.isnan(paying_stiffness(0.7, 0.0, 1e-3, 1e-4, 1e-3, 1e3))


@pytest.mark.parametrize(("key", "low", "high"), [("quantum", 1e-7, 1e-2), ("coulomb", 1e-4, 1.0)])
def test_planes(key: str, low: float, high: float) -> None:
    columns = [vary(START, key, float(value)) for value in np.geomspace(low, high, 12)]
    progress: list[float] = []
    plane = quantised_plane(columns, np.geomspace(1.0, 1e5, 30), progress.append)
    assert plane.mismatched == 0
    assert plane.disagreement < 0.01
    assert len(plane.edges) == 12
    assert progress[-1] == 1.0


def test_only_prompt_springs_with_an_encoder_step() -> None:
    wall = START.wall
    for wrong in (
        START._replace(quantum=0.0),
        START._replace(wall=wall._replace(damping=0.1)),
        START._replace(wall=wall._replace(delay=1.0)),
    ):
        with pytest.raises(ConfigError, match="springs"):
            quantised_plane([wrong], np.array([1.0, 2.0]))
    with pytest.raises(ConfigError, match="rise"):
        quantised_plane([START], np.array([1.0, 1.0]))
