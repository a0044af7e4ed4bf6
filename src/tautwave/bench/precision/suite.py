"""Error against run time of one rig: every scheme at steps over decades, and what `auto` takes.

Compiling is not part of any figure. Times are CPU times of the best undisturbed run.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tautwave.bench.compiled import NO_NUMBA, has_numba
from tautwave.bench.hooks import bench_hooks
from tautwave.bench.precision.points import Point, Scene, pareto
from tautwave.bench.result import Suite, Table, Value, machine
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError, WritingError

MAX_ERROR = 1e-4
SUBSTEPS = {False: (1, 3, 10, 30), True: (1, 2, 3, 5, 10, 20, 30, 100)}
TOLERANCES = {
    False: (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12),
    True: tuple(10.0**-n for n in range(1, 14)),
}
LONGEST_S = {False: 4.0, True: 10.0}
"""So much of a rig is simulated [s]: once for each point."""

ROUNDS = {False: 4, True: 6}


def workprecision(
    path: Path,
    *,
    changes: Sequence[str] = (),
    full: bool = False,
    begin_s: float = 0.0,
    out: Path | None = None,
    max_error: float = MAX_ERROR,
    tell: Callable[[str], None] = lambda _: None,
) -> Suite:
    """Measure error against run time of a rig, or of its scene.

    Parameters
    ----------
    path : Path
        The rig file, with a `simulation` block.
    changes : sequence of str
        As for `--set`.
    full : bool
        More steps over more decades, and more of the rig.
    begin_s : float
        Where the part of a scene begins that is compared [s].
    out : Path, optional
        Directory of `workprecision.csv`, `.json` and `.png`, and `workprecision-energy.png`.
    max_error : float
        Error bound for the chosen point [1].
    tell : callable
        Called with the name of each measurement as it starts.

    Raises
    ------
    ConfigError
        numba is not installed, or the rig has nothing to measure.
    WritingError
        `out` cannot be written.
    """
    if not has_numba():
        raise ConfigError(NO_NUMBA)
    rig = load_rig(path, changes)
    if rig.simulation is None:
        raise ConfigError(f"{path}: has no simulation block, so there is nothing to simulate")
    tell(f"{rig.name} (numba compiles for half a minute where it has not yet)")
    scene = _measured(rig, path, tuple(changes), full, begin_s, max_error)
    suite = Suite("workprecision", [scene_table(scene, max_error)], [])
    if out is not None:
        tell("pictures")
        write_files(out, [scene], suite, max_error)
    return suite


def _measured(
    rig: Rig, path: Path, changes: tuple[str, ...], full: bool, begin_s: float, max_error: float
) -> Scene:
    if rig.scene is not None:
        return bench_hooks().precision(rig, path, changes, full, begin_s, max_error)
    from tautwave.bench.precision.rigs import ORACLE, RigScene, rig_scene

    above = tuple(t for t in TOLERANCES[full] if t > 5.0 * ORACLE)  # the oracle is no point
    seconds = min(LONGEST_S[full], rig.duration_s)
    named = RigScene(rig.name, path, changes)
    return rig_scene(named, SUBSTEPS[full], above, max_error, seconds, ROUNDS[full])


def scene_table(scene: Scene, max_error: float) -> Table:
    """Return the points of a scene as a table, with the front and the chosen point marked."""
    front = pareto(point for point in scene.points if not point.peer)
    rows: list[list[Value]] = [
        [
            point.method,
            "tolerance" if point.adaptive else "step [s]",
            point.step_s,
            point.error,
            None if math.isnan(point.energy_error) else point.energy_error,
            point.cpu_s,
            "front" if point in front else "",
        ]
        for point in scene.points
    ]
    if scene.chosen is not None:
        at = scene.chosen
        rows.append(
            [
                f"chosen: {at.method}",
                "tolerance" if at.adaptive else "step [s]",
                at.step_s,
                at.error,
                at.energy_error,
                at.cpu_s,
                f"<= {max_error:g}" if at.error <= max_error else f"NOT <= {max_error:g}",
            ]
        )
    notes = "".join(f"; {note}" for note in scene.notes)
    return Table(
        f"Work-precision: {scene.name}",
        f"{scene.what}. CPU s per simulated s; 1 is real time. Chosen: {scene.why}{notes}",
        ("method", "by", "step", "error", "energy_error", "cpu_s_per_s", "mark"),
        rows,
    )


def write_files(out: Path, scenes: list[Scene], suite: Suite, max_error: float) -> list[Path]:
    """Write CSV, JSON and pictures into a directory; return their paths.

    Raises
    ------
    WritingError
        The directory cannot be written.
    """
    from tautwave.bench.precision.figure import energy_figure, error_figure
    from tautwave.canvas import png

    paths = [out / f"workprecision{end}" for end in (".csv", ".json", ".png", "-energy.png")]
    try:
        out.mkdir(parents=True, exist_ok=True)
        with paths[0].open("w", newline="", encoding="utf-8") as file:
            table = csv.writer(file)
            table.writerow(Point._fields)
            for scene in scenes:
                table.writerows(scene.points)
        text = json.dumps(_as_dict(scenes, suite, max_error), indent=2, allow_nan=False)
        paths[1].write_text(text + "\n", encoding="utf-8")
        paths[2].write_bytes(png(error_figure(scenes, max_error)))
        paths[3].write_bytes(png(energy_figure(scenes)))
    except OSError as err:
        raise WritingError(f"{out}: cannot be written: {err.strerror}") from err
    return paths


def _as_dict(scenes: list[Scene], suite: Suite, max_error: float) -> dict[str, Any]:
    return {
        "bench": suite.name,
        "machine": machine(),
        "max_error": max_error,
        "scenes": [
            {
                "name": scene.name,
                "what": scene.what,
                "why": scene.why,
                "notes": list(scene.notes),
                "chosen": None if scene.chosen is None else _plain(scene.chosen),
                "front": [_plain(point) for point in pareto(p for p in scene.points if not p.peer)],
                "points": [_plain(point) for point in scene.points],
            }
            for scene in scenes
        ],
        "goals": [{**goal._asdict(), "met": goal.met} for goal in suite.goals],
    }


def _plain(point: Point) -> dict[str, Any]:
    """Return a point for JSON, which has no infinities."""
    return {
        key: None if isinstance(value, float) and not math.isfinite(value) else value
        for key, value in point._asdict().items()
    }
