"""The plain wave-teleoperation scene, and the wave-wall rig's devices alone, against MuJoCo.

MuJoCo is timed on what it does: both devices in one model, at rest and out of contact, nothing
recorded, the law for free. tautwave is timed three ways: the plain scene with law, line and
three columns; a shipped rig with everything `simulate` does; that rig's two devices alone, where
works and losses, which are not requested, fall away in the compiler. MuJoCo's error stops falling
where its least `solimp` makes the wall a ten-thousandth stiffer than asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableSequence, Sequence
from typing import NamedTuple

import numpy as np

from tautwave.bench.precision.points import Point, Scene
from tautwave.bench.precision.rigs import RigScene
from tautwave.bench.result import Goal, Table, Value
from tautwave.models.integrators.schemes import DORMAND_PRINCE
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantCache, PlantParams, plant_cache
from tests.lab.peers import mujoco as peers_mujoco
from tests.lab.plain.lanes import as_records, compiled_plain, plain_aims
from tests.lab.plain.scene import DELAY, plain_set
from tests.lab.plain.truth import plain_error, plain_truth
from tests.lab.timing import cheapest, cpu_time
from tests.lab.workprecision.contact import compiled, records
from tests.lab.workprecision.rigs import WAVE_WALL

NAME = "wave-plain"
SET = plain_set(1e-3, 6.0, 0.45, 0.45, 0.005, 2000.0)
FACTOR = 100.0
STEPS = 4000
START = -0.6
"""Where the devices alone begin [rad], at 1 rad/s: they come to rest before anything is met."""


def plain_scene(counts: Sequence[int], rounds: int) -> Scene:
    """Return the plain scene: tautwave's one point, exact, and MuJoCo at `counts` of sub-steps."""
    aims = plain_aims(STEPS)
    oracle = plain_truth(SET, aims.tolist(), DORMAND_PRINCE, 1e-13)
    run = compiled_plain()
    rows = np.zeros(3 * STEPS)
    tables = as_records([SET]), aims, np.zeros(2 * DELAY), rows, np.zeros(2)
    sizes = np.array([1, STEPS, 1])
    simulated = STEPS * SET.period
    spent = cpu_time(lambda: run(*tables, sizes), simulated, rounds)
    error = plain_error(rows.reshape(-1, 3), oracle)
    own = Point(NAME, "exact", SET.period, error, float("nan"), spent)
    peers = peers_mujoco.mujoco_plain(NAME, SET, aims.tolist(), counts, oracle, rounds)
    what = (
        "hand, master, wave line of 50 ms, slave and an elastic wall, no books, for "
        f"{simulated:g} s; error: the slave's greatest distance from the oracle's over its travel"
    )
    why = "there is one step, closed forms with the wall located in closed form"
    return Scene(NAME, what, (own, *peers), None, why)


def devices_alone(scene: RigScene, rounds: int) -> float:
    """Return CPU time per simulated second [s] of a rig's devices by `simulate`'s exact step."""
    from tautwave.simulation.kernel.pack import pack_rig

    one, two = pack_rig(scene.load(), 1.0).devices
    t = one.period
    plants = np.concatenate([records(PlantParams, d.plant) for d in (one, two)])
    caches = np.concatenate([records(PlantCache, plant_cache(d.plant, t)) for d in (one, two)])
    run = compiled(run_devices)
    given, state = np.zeros(6), np.zeros(4)
    return cpu_time(lambda: run(plants, caches, given, state, STEPS, t), STEPS * t, rounds)


def run_devices(
    plants: Sequence[PlantParams],
    caches: Sequence[PlantCache],
    given: Sequence[float],
    state: MutableSequence[float],
    n: int,
    t: float,
) -> int:
    """Move two devices `n` steps of `t` [s] from 1 rad/s; `state` takes x and v of both.

    `given`: effort, the hand's position and its rate, of each, the same in every step.
    """
    x = START
    y = START
    v = 1.0
    w = 1.0
    one = 0
    two = 0
    for _ in range(n):
        x, v, one, _, _, _, _, _ = plant_step(
            plants[0], caches[0], x, v, one, given[0], given[1], given[2], t
        )
        y, w, two, _, _, _, _, _ = plant_step(
            plants[1], caches[1], y, w, two, given[3], given[4], given[5], t
        )
    state[0] = x
    state[1] = v
    state[2] = y
    state[3] = w
    return n


class Charge(NamedTuple):
    """A comparison: what tautwave's time holds, and a time to take in place of its points'."""

    scene: Scene
    what: str
    alone_s: float | None = None

    def against(self) -> Iterator[tuple[Point, Point, float, float]]:
        """Yield MuJoCo's points, ours with no greater error, our time [s] and the ratio."""
        own = [point for point in self.scene.points if not point.peer]
        for point in self.scene.points:
            best = cheapest(own, point.error)
            if point.method.startswith("MuJoCo") and best is not None and np.isfinite(point.error):
                spent = best.cpu_s if self.alone_s is None else self.alone_s
                yield point, best, spent, point.cpu_s / spent


PLAIN = "law and line"
WHOLE = "all of simulate"
ALONE = "devices alone"


def charges(scenes: Iterable[Scene], rounds: int) -> Iterator[Charge]:
    """Yield what is compared with MuJoCo, of the scenes that there are."""
    for scene in scenes:
        if scene.name == NAME:
            yield Charge(scene, PLAIN)
        elif scene.name == WAVE_WALL.name:
            yield Charge(scene, WHOLE)
            yield Charge(scene, ALONE, devices_alone(WAVE_WALL, rounds))


def mujoco_table(charges: Iterable[Charge]) -> Table:
    """Return every point of MuJoCo on the wave scenes, and what each side is charged for."""
    rows: list[list[Value]] = [
        [
            charge.scene.name,
            charge.what,
            point.method,
            point.step_s,
            point.error,
            point.cpu_s,
            best.method,
            best.error,
            spent,
            ratio,
        ]
        for charge in charges
        for point, best, spent, ratio in charge.against()
    ]
    return Table(
        "MuJoCo on wave teleoperation: time at no smaller error, and what it is the time of",
        "CPU s per simulated s; MuJoCo is charged for its two devices alone, at rest, out of "
        "contact, nothing recorded and the law for nothing; charged: what tautwave's time holds, "
        "law and line (3 columns recorded), all of simulate (law, books, accounts, 75 columns), or "
        "two devices alone, as MuJoCo's; "
        "errors are those of the closed loop; ratio: MuJoCo's time over tautwave's cheapest with "
        "an error no greater",
        (
            *("scene", "charged", "mujoco", "step_s", "error", "cpu_s_per_s"),
            *("tautwave", "its_error", "its_cpu_s_per_s", "ratio"),
        ),
        rows,
    )


def mujoco_goals(charges: Iterable[Charge]) -> Iterator[Goal]:
    """Yield the ratio at MuJoCo's cheapest and at its most accurate point, for each charge."""
    for charge in charges:
        found = list(charge.against())
        if not found:
            continue
        ends = {
            "cheapest": min(found, key=lambda row: row[0].cpu_s),
            "most accurate": min(found, key=lambda row: row[0].error),
        }
        for end, (point, best, _, ratio) in ends.items():
            name = (
                f"{charge.scene.name}, {charge.what}: {point.method} {1e3 * point.step_s:g} ms, "
                f"its {end} (errors {best.error:.0e}, {point.error:.0e})"
            )
            yield Goal(name, FACTOR, "times", ratio, at_least=True)
