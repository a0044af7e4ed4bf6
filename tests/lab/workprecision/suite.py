"""Error against run time: every scene, every scheme, step sizes over decades, and the peers.

Contacts and a resonator with closed forms; the shipped teleoperation rigs and scenes; tissue.

Compiling is not part of any figure. Times are CPU times of the best undisturbed run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path

from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.precision.points import Point, Scene
from tautwave.bench.precision.rigs import ORACLE, rig_scene, run_job
from tautwave.bench.precision.suite import scene_table, write_files
from tautwave.bench.result import Goal, Suite, Table, Value
from tautwave.errors import ConfigError
from tautwave.simulation.kernel.schemes import with_scheme
from tests.lab.peers import mujoco as peers_mujoco
from tests.lab.peers import scipy_control as peers
from tests.lab.peers.mujoco_flex import flex_points
from tests.lab.timing import cheapest
from tests.lab.workprecision import plain as workprecision_plain
from tests.lab.workprecision.contact import HERTZ, WALL, contact_scene
from tests.lab.workprecision.linear import linear_scene
from tests.lab.workprecision.rigs import WAVE_FOAM, WAVE_WALL
from tests.lab.workprecision.scenes import SCENES, scene_with_peers
from tests.lab.workprecision.tissue import (
    rate_goals,
    rate_table,
    rates,
    tissue_scene,
)

MAX_ERROR = 1e-4
PEER_FACTOR = 100.0
_COUNTS = {
    False: (9, 31, 101, 331, 1009, 3301),
    True: (5, 9, 17, 31, 57, 101, 179, 331, 577, 1009, 1801, 3301, 10007),
}
_LINEAR = {
    False: (50, 100, 300, 1000, 3000, 10_000, 100_000),
    True: (50, 70, 100, 150, 300, 600, 1000, 2000, 5000, 10_000, 30_000, 100_000, 1_000_000),
}
_SUBSTEPS = {False: (1, 3, 10, 30), True: (1, 2, 3, 5, 10, 20, 30, 100)}
_TOLERANCES = {
    False: (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    True: tuple(10.0**-n for n in range(1, 14)),
}
_PEER_TOLERANCES = {False: (1e-3, 1e-6, 1e-9), True: (1e-2, 1e-4, 1e-6, 1e-8, 1e-10)}
_PEER_COUNTS = {False: (9, 31, 101, 1009), True: (9, 31, 101, 331, 1009, 3301)}
_MUJOCO_SUBSTEPS = {False: (1, 10, 100), True: (1, 2, 5, 10, 20, 50, 100)}
_DURATION_S = {False: 4.0, True: 10.0}
_TISSUE = {False: (4e-3, 1e-3, 2.5e-4), True: (8e-3, 4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4)}
_TISSUE_S = {False: 0.2, True: 1.0}
_ROUNDS = {False: 4, True: 6}

Tell = Callable[[str], None]


def silent(_: str) -> None:
    """Say nothing about progress."""


def workprecision(
    *,
    full: bool = False,
    out: Path | None = None,
    max_error: float = MAX_ERROR,
    tell: Tell = silent,
) -> Suite:
    """Measure error against run time, and write CSV, JSON and pictures into `out` if given.

    Parameters
    ----------
    full : bool
        More steps over more decades, and longer rigs: minutes instead of one.
    out : Path, optional
        Directory of `workprecision.csv`, `.json` and `.png`, and `workprecision-energy.png`.
    max_error : float
        Error bound for the chosen point of each scene.
    tell : callable
        Called with the name of each measurement as it starts.

    Raises
    ------
    ConfigError
        numba is not installed.
    RecordingError
        `out` cannot be written.
    """
    if not has_numba():
        raise ConfigError(NO_NUMBA)
    scenes = list(scenes_of(full, max_error, tell))
    tell("tissue, rates")
    in_real_time = rates(_TISSUE_S[full])
    charges = list(workprecision_plain.charges(scenes, _ROUNDS[full]))
    suite = Suite(
        "workprecision",
        [
            *(scene_table(scene, max_error) for scene in scenes),
            rate_table(in_real_time),
            _peer_table(scenes),
            workprecision_plain.mujoco_table(charges),
        ],
        [
            *workprecision_plain.mujoco_goals(charges),
            *(goal for scene in scenes for goal in _peer_goals(scene)),
            *rate_goals(in_real_time),
        ],
    )
    if out is not None:
        tell("pictures")
        write_files(out, scenes, suite, max_error)
    return suite


def scenes_of(full: bool, max_error: float, tell: Tell) -> Iterable[Scene]:
    rounds = _ROUNDS[full]
    counts, tolerances = _COUNTS[full], _TOLERANCES[full]
    few, fewer = _PEER_TOLERANCES[full], _PEER_COUNTS[full]
    for contact in (WALL, HERTZ):
        tell(f"{contact.name} (numba compiles for some seconds where it has not yet)")
        scene = contact_scene(contact, counts, tolerances, max_error, rounds)
        tell(f"{contact.name}, peers")
        yield _with_peers(
            scene,
            peers.scipy_contact(contact, few, rounds),
            peers_mujoco.mujoco_contact(contact, fewer, rounds),
        )
    tell("resonator")
    yield _with_peers(
        linear_scene(_LINEAR[full], max_error, rounds),
        peers.scipy_linear(few, rounds),
        peers.control_linear((100, 1000), rounds),
        peers_mujoco.mujoco_linear((100, 1000, 10_000), rounds),
    )
    tell(workprecision_plain.NAME)
    yield workprecision_plain.plain_scene(_MUJOCO_SUBSTEPS[full], rounds)
    seconds = _DURATION_S[full]
    for rig in (WAVE_WALL, WAVE_FOAM):
        tell(f"{rig.name} (the kernel compiles for half a minute where it has not yet)")
        above = tuple(t for t in tolerances if t > 5.0 * ORACLE)  # the oracle is no point
        scene = rig_scene(rig, _SUBSTEPS[full], above, max_error, seconds, rounds)
        if rig is WAVE_WALL:
            from tautwave.simulation.kernel.compiled import compiled_kernel
            from tautwave.simulation.kernel.pack import pack_rig

            tell(f"{rig.name}, MuJoCo")
            job = with_scheme(pack_rig(rig.load(), seconds), 4, 1, ORACLE)
            oracle = run_job(job, compiled_kernel(job.law), 1).rows
            substeps = _MUJOCO_SUBSTEPS[full]
            scene = _with_peers(
                scene, peers_mujoco.mujoco_rig(rig, substeps, seconds, oracle, rounds)
            )
        yield scene
    # SciPy takes minutes for digits that are meaningless for a scene with contacts.
    coarse = tuple(tolerance for tolerance in few if tolerance > 1e-7)
    for shipped in SCENES:
        tell(f"{shipped.name} (numba compiles for half a minute where it has not yet)")
        yield _with_peers(scene_with_peers(shipped, full, max_error, rounds, coarse))
    tell("tissue")
    yield _with_peers(tissue_scene(_TISSUE[full], max_error, partial(flex_points, rounds=rounds)))


def _with_peers(scene: Scene, *more: Iterable[Point]) -> Scene:
    points = [*scene.points, *(point for found in more for point in found)]
    absent = [reason for reason in map(peers.missing, ("scipy", "control", "mujoco")) if reason]
    return scene._replace(points=tuple(points), notes=(*scene.notes, *absent))


def _ratios(scene: Scene) -> list[tuple[Point, Point, float]]:
    """Return each peer's point, our cheapest with no greater error, and the ratio of times."""
    own = [point for point in scene.points if not point.peer]
    found = []
    for point in scene.points:
        best = cheapest(own, point.error)
        if point.peer and best is not None and math.isfinite(point.error):
            found.append((point, best, point.cpu_s / best.cpu_s))
    return found


def _peer_table(scenes: Iterable[Scene]) -> Table:
    rows: list[list[Value]] = [
        [scene.name, peer.method, peer.step_s, peer.error, best.method, best.error, ratio]
        for scene in scenes
        for peer, best, ratio in _ratios(scene)
    ]
    return Table(
        "Peers: how many times longer, at no smaller error",
        "Each point of a peer over tautwave's cheapest whose error is no greater; on the rigs "
        "MuJoCo's time is that of its devices alone, tautwave's with law, books and rows",
        ("scene", "peer", "step", "error", "tautwave", "its_error", "ratio"),
        rows,
    )


def _peer_goals(scene: Scene) -> Iterable[Goal]:
    """Yield MuJoCo's least ratio of times over all its steps, by integrator.

    Those of the wave scenes are `workprecision_plain`'s, which says what each side is charged for.
    """
    if scene.name in (workprecision_plain.NAME, WAVE_WALL.name):
        return
    for method in ("MuJoCo Euler", "MuJoCo RK4"):
        ratios = [ratio for peer, _, ratio in _ratios(scene) if peer.method == method]
        if ratios:
            name = f"{scene.name}: {method} over tautwave at no smaller error, worst step"
            yield Goal(name, PEER_FACTOR, "times", min(ratios), at_least=True)
