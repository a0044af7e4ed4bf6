"""The plain scene once more, its slave moved by what `simulate` moves a device with.

Line and law are written anew, over a queue; nothing but the parameters is shared with
`plain_scene`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from tautwave.models.foam import FoamParams
from tautwave.models.integrators.schemes import EXACT, integrate_step
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantParams, plant_cache
from tests.lab.plain.scene import DELAY, Plain

Move = Callable[[float, float, float], tuple[float, float]]
"""Takes position, velocity and a force held for a period; returns both after it."""


def plain_plants(p: Plain) -> tuple[PlantParams, PlantParams]:
    """Return master, a mass, and slave, a mass with its wall, as plants."""
    free = PlantParams(p.mass_1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    walled = free._replace(mass=p.mass, wall_stiffness=p.stiffness, wall_position=p.wall)
    return free, walled


def plain_truth(
    p: Plain, aims: Sequence[float], scheme: int, tolerance: float
) -> npt.NDArray[np.float64]:
    """Return positions of both [m] and the force on the master [N] after every step.

    `scheme` is one of `models.integrators`; `tolerance` is that of Dormand-Prince.
    """
    moves = [_mover(plant, p.period, scheme, tolerance) for plant in plain_plants(p)]
    return plain_loop(p, aims, moves)


def plain_loop(p: Plain, aims: Sequence[float], moves: Sequence[Move]) -> npt.NDArray[np.float64]:
    """Close the loop over two devices, master and slave; as `plain_truth`."""
    x, v = [0.0, 0.0], [0.0, 0.0]
    to_slave = deque([0.0] * DELAY)
    to_master = deque([0.0] * DELAY)
    rows = []
    for aim in aims:
        at_master, at_slave = to_master.popleft(), to_slave.popleft()
        resisting = p.impedance * v[0] - p.root * at_master
        pushing = p.root * at_slave - p.impedance * v[1]
        to_slave.append(p.root * v[0] - at_master)
        to_master.append(p.root * v[1] - at_slave)
        forces = (500.0 * (aim - x[0]) - 5.0 * v[0] - resisting, pushing)
        for i, (move, force) in enumerate(zip(moves, forces, strict=True)):
            x[i], v[i] = move(x[i], v[i], force)
        rows.append((x[0], x[1], resisting))
    return np.array(rows)


def _mover(plant: PlantParams, period: float, scheme: int, tolerance: float) -> Move:
    """Return what moves a device by a period, by `simulate`'s own functions."""
    if scheme != EXACT:
        wall = (plant.wall_stiffness, 1.0, 0.0, plant.wall_position, 1.0, 1, 0.0)
        foam = FoamParams(*wall, scheme, tolerance)

        def integrate(x: float, v: float, force: float) -> tuple[float, float]:
            x, v, *_ = integrate_step(plant, foam, x, v, force, 0.0, 0.0, period)
            return x, v

        return integrate
    cache = plant_cache(plant, period)
    mode = 0

    def step(x: float, v: float, force: float) -> tuple[float, float]:
        nonlocal mode
        x, v, mode, *_ = plant_step(plant, cache, x, v, mode, force, 0.0, 0.0, period)
        return x, v

    return step


def plain_error(rows: npt.NDArray[np.float64], oracle: npt.NDArray[np.float64]) -> float:
    """Return the slave's greatest distance from the oracle's over its travel."""
    distance = float(np.abs(rows[:, 1] - oracle[:, 1]).max() / np.ptp(oracle[:, 1]))
    return max(distance, 1e-17)
