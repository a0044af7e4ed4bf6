"""Maps of stability by simulation."""

from __future__ import annotations

import math

import numpy as np

from tautwave.analysis.maps.simulated import _advance, _bench, _law, _map_of
from tautwave.analysis.ports.sampled_loop import Device, Matrix
from tautwave.analysis.walls.sampled import SampledWall


def simulated_map(wall: SampledWall, device: Device) -> Matrix:
    """Return the one-period map minus the identity, shape (n, n), n = 3 + delayed efforts.

    States: position, velocity and filtered velocity times T, efforts under way times T**2 / mass.
    The wall is bilateral: pressed all the time.
    """
    return _map_of(_bench(wall, device), wall)


def time_growth(wall: SampledWall, device: Device, periods: int) -> float:
    """Return the growth per period that a run in time shows over its last half.

    The state is followed from an off-centre start and scaled down whenever it has grown large,
    so any number of periods will do; half the slope of ln(energy-like norm).
    """
    bench = _bench(wall, device)
    spring, damper = _law(wall)
    state = bench.units * np.linspace(1.0, 0.4, 3 + bench.late)
    logs = np.empty(periods)
    offset = 0.0
    for at in range(periods):
        state = state + _advance(bench, wall, spring, damper, state.tolist())
        size = float(np.linalg.norm(state / bench.units))
        logs[at] = offset + math.log(size) if size > 0.0 else -math.inf
        if not 1e-100 < size < 1e100 and size > 0.0:
            offset += math.log(size)
            state = state / size
    last = logs[periods // 2 :]
    # Windows even out the swing within an oscillation.
    parts = np.array_split(last, 8)
    level = np.array([part.max() for part in parts])
    time = np.array([float(np.argmax(part)) for part in parts])
    time += np.cumsum([0, *[len(part) for part in parts[:-1]]])
    time -= time.mean()
    return float(time @ (level - level.mean()) / (time @ time))
