"""The simulator's own one-period map of a device at a wall: columns are runs from unit states.

Nothing of the stability analysis is used: the plant's step and the live wall law are run for a
period from each unit initial state, and the eigenvalues of what comes out tell growth. It is what
predictions are held against. Only increments are kept, so that a growth of 1e-12 per period still
has digits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.sampled_loop import Device, Matrix
from tautwave.analysis.walls.sampled import SampledWall, split_delay, velocity_gain
from tautwave.laws.wall import WallParams, wall_effort
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantCache, PlantParams, plant_cache

Floats = npt.NDArray[np.float64]


class _Bench(NamedTuple):
    """A device ready to be stepped: its constants, and for each part of a period its cache."""

    plant: PlantParams
    spans: tuple[float, ...]
    caches: tuple[PlantCache, ...]
    whole: int
    late: int
    units: Floats


def simulated_growths(
    wall: SampledWall, device: Device, stiffnesses: Sequence[float] | Floats
) -> Floats:
    """Return ln|z| per period of the least damped mode at each stiffness; shape (n,)."""
    bench = _bench(wall, device)
    maps = [_map_of(bench, wall._replace(stiffness=float(value))) for value in stiffnesses]
    roots = np.linalg.eigvals(np.array(maps))
    return np.asarray(_growth(roots.astype(np.complex128)).max(axis=-1))


def _bench(wall: SampledWall, device: Device) -> _Bench:
    plant = PlantParams(
        device.mass, device.damping, 0.0, device.stiffness, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    )
    whole, rest = split_delay(wall.delay + device.command_delay)
    period = wall.period
    spans = (rest * period, (1.0 - rest) * period) if rest else (period,)
    count = whole + (1 if rest else 0)
    units = [1.0, 1.0 / period, 1.0 / period, *[device.mass / period**2] * count]
    caches = tuple(plant_cache(plant, span) for span in spans)
    return _Bench(plant, spans, caches, whole, count, np.array(units))


def _law(wall: SampledWall) -> tuple[float, float]:
    """Return what the live law answers to a unit of depth and of velocity.

    It never pulls, so a negative damper shows on the other side.
    """
    law = WallParams(0.0, 1.0, wall.stiffness, wall.damping, controlled=False)
    sign = math.copysign(1.0, wall.damping)
    tiny = 1e-300
    return wall_effort(law, 1.0, 0.0), sign * wall_effort(law, tiny, sign)


def _advance(
    bench: _Bench, wall: SampledWall, spring: float, damper: float, state: list[float]
) -> Floats:
    """Return what a period adds to a state."""
    x, v, filtered = state[:3]
    pipe = [spring * x + damper * filtered, *state[3:]]
    whole = bench.whole
    acting = (pipe[whole + 1], pipe[whole]) if len(bench.spans) == 2 else (pipe[whole],)
    mode, moved, gained = 0, 0.0, 0.0
    for held, span, cache in zip(acting, bench.spans, bench.caches, strict=True):
        after, speed, mode, *_ = plant_step(
            bench.plant, cache, x + moved, v + gained, mode, -held, 0.0, 0.0, span
        )
        moved, gained = after - x, speed - v
    smoothed = velocity_gain(wall) * (moved / wall.period - filtered)
    shifted = [new - old for new, old in zip(pipe, state[3:], strict=False)]
    return np.array([moved, gained, smoothed, *shifted])


def _map_of(bench: _Bench, wall: SampledWall) -> Matrix:
    spring, damper = _law(wall)
    size = 3 + bench.late
    out = np.empty((size, size))
    for column in range(size):
        state = [0.0] * size
        state[column] = float(bench.units[column])
        out[:, column] = _advance(bench, wall, spring, damper, state)
    return out / bench.units[:, None]


def _growth(roots: npt.NDArray[np.complex128]) -> Floats:
    """Return ln|z| of roots z - 1."""
    square = 2.0 * roots.real + np.abs(roots) ** 2
    return np.asarray(0.5 * np.log1p(np.maximum(square, -1.0 + 1e-15)))
