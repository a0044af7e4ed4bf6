"""A teleoperation rig, hand to contact and back, its devices moved by every scheme.

Encoder steps and Coulomb friction are left out: they would hide the schemes' orders in their own
error. The oracle is the same rig with the same controller, its devices moved by Dormand-Prince at
1e-13; a scheme's error is therefore that of the devices' motion alone, in closed loop.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.bench.chunks import TOLERANCE, calibrate
from tautwave.bench.precision.points import ROUNDS, Point, Scene
from tautwave.config import Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT, SCHEMES
from tautwave.rig import axis_integration
from tautwave.simulation.kernel.pack import Job, pack_rig
from tautwave.simulation.kernel.records import FOAM, PLANT
from tautwave.simulation.kernel.schemes import with_scheme

Array = npt.NDArray[np.float64]

BOOKS = (
    *("hand_work", "motor_work", "kinetic", "grip_stored", "environment_stored"),
    *("grip_loss", "viscous_loss", "coulomb_loss", "environment_loss"),
)
STATE = ("outcomes", "axes", "samples", "bodies", "states", "table")
ORACLE = 1e-13
MOVED = (PLANT, FOAM)
"""Kinds of devices that an integrator moves; a drive's own loop and an arm are stepped exactly."""


class RigScene(NamedTuple):
    """A rig file under its name in the tables, and what is changed in it, as for `--set`."""

    name: str
    path: Path
    changes: tuple[str, ...] = ()

    def load(self) -> Rig:
        """Return the rig without the encoder steps and the Coulomb friction of its devices."""
        axes = load_rig(self.path, self.changes).axes
        smooth = [
            f"simulation.axes.{name}.{key}=0"
            for name, axis in axes.items()
            if axis.causality == "impedance"
            for key in ("coulomb", "encoder_quantum")
        ]
        return load_rig(self.path, (*self.changes, *smooth))


class RigRun(NamedTuple):
    """Rows of a run by the compiled kernel, and its CPU time per simulated second [s]."""

    rows: Array
    cpu_s: float


def run_job(job: Job, kernel: Any, rounds: int) -> RigRun:
    """Run a job `rounds` times; the best time of an undisturbed core counts."""
    from tautwave.simulation.kernel.tables import record_tables

    tables = record_tables(job)
    fresh = {name: getattr(tables, name).copy() for name in STATE}
    count = 0
    taken = []
    for at in range(max(rounds, 1) + 1):
        for name, values in fresh.items():
            getattr(tables, name)[:] = values
        before = calibrate()
        began = time.thread_time_ns()
        count = kernel(tables)
        spent = time.thread_time_ns() - began
        if at > 0:
            taken.append((max(before, calibrate()), spent))
    quickest = min(speed for speed, _ in taken)
    best = min(spent for speed, spent in taken if speed <= TOLERANCE * quickest)
    width = len(job.columns)
    simulated = job.run.cycles * job.run.period_ns * 1e-9
    rows = np.asarray(tables.out)[: count * width].reshape(count, width)
    return RigRun(rows.copy(), 1e-9 * best / simulated)


def column(job: Job, rows: Array, name: str) -> Array:
    """Return one column of a run."""
    return rows[:, job.columns.index(name)]


def rig_errors(job: Job, rows: Array, oracle: Array) -> tuple[float, float]:
    """Return how far devices are from the oracle's at most, over their travel, and energy lost.

    Of slaves that move, or of masters where no slave's device is simulated. The energy is what the
    plants' books lack over the run, over what hands and motors put in.
    """
    n = min(len(rows), len(oracle))
    error = 0.0
    for name in _followed(job):
        want = column(job, oracle, name)
        travel = float(np.ptp(want))
        if travel > 0.0:
            gap = float(np.abs(column(job, rows, name)[:n] - want[:n]).max())
            error = max(error, gap / travel)
    lacking, work = 0.0, 0.0
    for axis in job.axes:
        if f"plant.{axis}.hand_work" not in job.columns:
            continue
        books = {book: column(job, rows, f"plant.{axis}.{book}") for book in BOOKS}
        gains = books.pop("hand_work") + books.pop("motor_work")
        balance = gains - sum(books.values())
        lacking += float(np.abs(balance - balance[0]).max())
        work += float(np.abs(np.diff(gains)).sum())
    lost = max(lacking / work, 1e-17) if work > 0.0 else float("nan")
    return max(error, 1e-17), lost


def _followed(job: Job) -> list[str]:
    """Return the columns of true positions that are compared."""
    places = [f"true.{axis}.position" for axis in job.axes]
    known = [name for name in places if name in job.columns]
    return [name for name in known if name.startswith("true.slave.")] or known


def rig_scene(
    scene: RigScene,
    counts: Sequence[int],
    tolerances: Sequence[float],
    max_error: float,
    duration_s: float,
    rounds: int = ROUNDS,
) -> Scene:
    """Return all schemes on a rig; `counts` are sub-steps of a cycle.

    Raises
    ------
    ConfigError
        None of its devices is moved by an integrator.
    """
    from tautwave.simulation.kernel.compiled import compiled_kernel

    rig = scene.load()
    job = pack_rig(rig, duration_s)
    if not any(device.kind in MOVED for device in job.devices):
        raise ConfigError(
            f"{scene.path}: no device of this rig is moved by an integrator that could be chosen: "
            "arms, drives with a velocity loop and followers are stepped exactly"
        )
    kernel = compiled_kernel(job.law)
    linear = all(device.kind == PLANT for device in job.devices)
    oracle = run_job(with_scheme(job, DORMAND_PRINCE, 1, ORACLE), kernel, 1).rows
    points = []
    for name, scheme in SCHEMES.items():
        if scheme == EXACT and not linear:
            continue
        adaptive = scheme == DORMAND_PRINCE
        values = tolerances if adaptive else counts[:1] if scheme == EXACT else counts
        for value in values:
            substeps = 1 if adaptive else int(value)
            made = with_scheme(job, scheme, substeps, float(value) if adaptive else 0.0)
            outcome = run_job(made, kernel, rounds)
            step = float(value) if adaptive else rig.period_s / substeps
            error = rig_errors(job, outcome.rows, oracle)
            points.append(Point(scene.name, name, step, *error, outcome.cpu_s, adaptive))
    chosen, why = _chosen(scene, rig, oracle, kernel, max_error, duration_s, rounds)
    what = (
        f"{scene.path.name} for {duration_s:g} s without encoder steps and Coulomb friction, all "
        "rows written; error: a slave's greatest distance from the oracle's over its travel"
    )
    return Scene(scene.name, what, tuple(points), chosen, why)


def _chosen(
    scene: RigScene,
    rig: Rig,
    oracle: Array,
    kernel: Any,
    max_error: float,
    duration_s: float,
    rounds: int,
) -> tuple[Point, str]:
    """Return the point of `simulation.integrator: {scheme: auto}`, and why it is that."""
    assert rig.simulation is not None
    from tautwave.config import Integrator

    keys = Integrator(scheme="auto", max_error=max_error)
    simulation = rig.simulation.model_copy(update={"integrator": keys})
    auto = rig.model_copy(update={"simulation": simulation})
    job = pack_rig(auto, duration_s)
    moved = [n for n, d in zip(job.axes, job.devices, strict=True) if d.kind in MOVED]
    made = axis_integration(auto, moved[-1])
    outcome = run_job(job, kernel, rounds)
    step = rig.period_s
    if made.foam is not None:
        step = rig.period_s / made.foam.substeps
    error = rig_errors(job, outcome.rows, oracle)
    return Point(scene.name, made.scheme, step, *error, outcome.cpu_s), made.why
