"""Very many steps of lossless scenes: the effect of rounding on their energy."""

from __future__ import annotations

import time

from tautwave.bench.compiled import has_numba
from tautwave.bench.result import Table, Value
from tautwave.models.foam import FoamParams
from tautwave.models.plant_params import PlantParams, plant_cache
from tests.lab.extremes.kernel import Bounce, run_bounces

PLANT = PlantParams(
    mass=0.1,
    viscous=0.0,
    coulomb=0.0,
    grip_stiffness=0.0,
    grip_damping=0.0,
    spring_stiffness=40.0,
    spring_position=-0.02,
    wall_stiffness=0.0,
    wall_damping=0.0,
    wall_position=0.0,
    wall_side=1.0,
)
"""0.1 kg on a spring, 3.2 Hz, that throws it at the contact again and again."""

HERTZ = FoamParams(1e6, 1.5, 0.0, 0.0, 1.0, 1)


def long_bounces(steps: int) -> dict[str, Bounce]:
    """Return a scene for each conservative scheme, with this many steps of 1 ms."""
    h = 1e-3
    wall = PLANT._replace(wall_stiffness=5000.0)
    linear = HERTZ._replace(stiffness=5000.0, exponent=1.0)

    def scene(plant: PlantParams, foam: FoamParams, exact: bool) -> Bounce:
        cache = plant_cache(plant, h)
        return Bounce(plant, cache, foam, -0.05, 0.1, h, steps, exact, whole=True)

    return {
        "exact, wall of 5000 N/m": scene(wall, linear, True),
        "discrete gradient, 1e6 N/m^1.5": scene(PLANT, HERTZ, False),
    }


def long_table(steps: int) -> tuple[Table, float, int]:
    """Run both scenes; return the table, the greatest share of energy gained, and non-finite ends.

    Without numba 100 000 steps at most are made, in plain Python.
    """
    if not has_numba():
        steps = min(steps, 100_000)
    rows: list[list[Value]] = []
    worst = 0.0
    broken = 0
    for name, bounce in long_bounces(steps).items():
        start = 0.5 * bounce.plant.mass * bounce.v**2
        start += (
            0.5 * bounce.plant.spring_stiffness * (bounce.x - bounce.plant.spring_position) ** 2
        )
        began = time.thread_time()
        end = run_bounces([bounce])[0]
        spent = time.thread_time() - began
        gained = float(end.energy) / start - 1.0
        lost = 1.0 - float(end.least) / start
        worst = max(worst, gained)
        broken += not end.finite
        each = 1e9 * spent / max(int(end.steps), 1)
        per_step = max(gained, lost) / max(int(end.steps), 1)
        rows.append([name, int(end.steps), gained, lost, per_step, each, int(not end.finite)])
    columns = ("scene", "steps", "gained", "lost", "per_step", "step_ns", "not_finite")
    what = (
        "0.1 kg thrown at a contact by a spring, 1 ms; greatest energy above and below that of the "
        "start, as shares of it, over all steps; per step: the greater by the number of steps"
    )
    return Table("Many steps of a scene that loses nothing", what, columns, rows), worst, broken
