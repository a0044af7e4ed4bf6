"""The plain scene once more, its slave moved by what `simulate` moves a device with.

Line and law are written anew, over a queue; nothing but the parameters is shared with
`plain_scene`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from tautwave.bench.plain_scene import DELAY, Plain
from tautwave.models.foam import FoamParams
from tautwave.models.integrators import EXACT, integrate_step
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantParams, plant_cache


def slave_plant(p: Plain) -> PlantParams:
    """Return the slave as a plant: a mass, and its wall."""
    return PlantParams(p.mass, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, p.stiffness, 0.0, p.wall, 1.0)


def master_plant(p: Plain) -> PlantParams:
    """Return the master as a plant: a mass."""
    return PlantParams(p.mass_1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def plain_truth(
    p: Plain, aims: Sequence[float], scheme: int, tolerance: float
) -> npt.NDArray[np.float64]:
    """Return positions of both [m] and the force on the master [N] after every step.

    `scheme` is one of `models.integrators`; `tolerance` is that of Dormand-Prince.
    """
    devices = (master_plant(p), slave_plant(p))
    caches = [plant_cache(plant, p.period) for plant in devices]
    foams = [
        FoamParams(
            plant.wall_stiffness, 1.0, 0.0, plant.wall_position, 1.0, 1, 0.0, scheme, tolerance
        )
        for plant in devices
    ]
    x, v, mode = [0.0, 0.0], [0.0, 0.0], [0, 0]
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
        for i, (plant, force) in enumerate(zip(devices, forces, strict=True)):
            if scheme == EXACT:
                x[i], v[i], mode[i], *_ = plant_step(
                    plant, caches[i], x[i], v[i], mode[i], force, 0.0, 0.0, p.period
                )
            else:
                x[i], v[i], *_ = integrate_step(
                    plant, foams[i], x[i], v[i], force, 0.0, 0.0, p.period
                )
        rows.append((x[0], x[1], resisting))
    return np.array(rows)
