"""Planes of stiffness: simulated maps against the loop's prediction, and growth in time."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from tautwave.analysis.maps.simulated import simulated_growths
from tautwave.analysis.maps.stability import Column, stability_plane, vary
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import wall_matrix, wall_mode
from tautwave.errors import ConfigError
from tests.analysis.reference.simulated_map import simulated_map, time_growth
from tests.analysis.reference.wall_bounds import prompt_bound

T = 1e-3
START = Column(0.0, SampledWall(0.0, 0.0, T), Device(0.1, 0.1), 0.1)


@pytest.mark.slow
def test_a_plane_of_a_hundred_by_a_hundred() -> None:
    columns = [vary(START, "wall_damping", value) for value in np.linspace(0.0, 150.0, 100)]
    begin = time.process_time()
    plane = stability_plane(columns, np.geomspace(1.0, 1e5, 100))
    assert time.process_time() - begin < 20.0
    assert plane.growth.shape == (100, 100)
    assert plane.mismatched == 0
    assert plane.disagreement < 1e-6
    assert len(plane.edges) == 100
    # Without delay: b > K T / 2 + |B|, and the theory's stable limit at B = 0.
    for column, limit in zip(columns, plane.passive, strict=True):
        reported = max(0.0, (0.1 - column.wall.damping) * 2.0 / T)
        assert limit == pytest.approx(reported, rel=1e-6)
    assert plane.simulated[0] == pytest.approx(200.0333, rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [1.0, 2.4, 20.0])
def test_with_delay(delay: float) -> None:
    start = START._replace(wall=START.wall._replace(delay=delay))
    columns = [vary(start, "wall_damping", float(value)) for value in np.linspace(0.0, 30.0, 16)]
    plane = stability_plane(columns, np.geomspace(0.5, 1e5, 40))
    assert plane.mismatched == 0
    assert plane.disagreement < 1e-6


@pytest.mark.sparse(4)
@pytest.mark.parametrize(
    ("key", "low", "high"),
    [("period_s", 2e-5, 2e-2), ("delay_periods", 0.0, 20.0), ("mass", 1e-4, 1e3),
     ("damping", 1e-6, 10.0)],
)  # fmt: skip
def test_other_axes(key: str, low: float, high: float) -> None:
    values = np.linspace(low, high, 12) if low == 0.0 else np.geomspace(low, high, 12)
    start = START._replace(wall=START.wall._replace(damping=0.01))
    progress: list[float] = []
    plane = stability_plane(
        [vary(start, key, float(value)) for value in values], np.geomspace(1e-4, 1e6, 60),
        progress.append,
    )  # fmt: skip
    assert plane.mismatched == 0
    assert plane.disagreement < 0.01
    assert len(plane.edges) >= 10
    assert progress[-1] == 1.0


@pytest.mark.slow
def test_growth_in_time_is_that_of_the_map() -> None:
    device = Device(0.1, 0.1)
    for delay, stiffness in ((0.0, 2178.4834), (1.0, 725.38746), (1.4, 500.0)):
        for share in (0.9, 1.1):
            wall = SampledWall(stiffness * share, 1.0, T, delay)
            growth = simulated_growths(wall, device, [wall.stiffness])[0]
            assert growth == pytest.approx(wall_mode(wall, device).growth * T, rel=1e-6)
            seen = time_growth(wall, device, 6000)
            assert seen == pytest.approx(growth, rel=0.05)


def test_the_map_is_the_loop() -> None:
    wall = SampledWall(400.0, 0.5, T, 1.3, 2e-3)
    for device in (Device(0.1, 0.1), Device(0.143, 5.0, 538.0, 0.7)):
        found, reported = simulated_map(wall, device), wall_matrix(wall, device)
        assert np.abs(np.linalg.eigvals(found)).max() == pytest.approx(
            np.abs(np.linalg.eigvals(reported)).max(), rel=1e-9
        )


def test_varying_keeps_the_rest() -> None:
    late = START._replace(wall=START.wall._replace(delay=2.0))
    assert vary(late, "period_s", 5e-4).wall.delay == 2.0
    assert vary(late, "period_s", 5e-4, keep_delay_s=True).wall.delay == 4.0
    held = START._replace(device=Device(0.1, 5.1))
    assert vary(held, "damping", 0.3).device.damping == pytest.approx(5.3)
    assert vary(held, "damping", 0.3).own_damping == 0.3
    assert prompt_bound(vary(late, "wall_damping", -0.2).wall) == 0.2
    with pytest.raises(ConfigError, match="varied"):
        vary(START, "colour", 1.0)
    with pytest.raises(ConfigError, match="rise"):
        stability_plane([START], np.array([1.0, 1.0]))


def test_outside_the_plane_nothing_is_claimed() -> None:
    plane = stability_plane([START], np.array([1.0, 2.0]))
    assert math.isnan(plane.simulated[0])
    assert plane.disagreement == 0.0
    assert plane.stable[0] == pytest.approx(200.0333, rel=1e-5)
