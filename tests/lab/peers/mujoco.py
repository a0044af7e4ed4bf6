"""The same scenes by MuJoCo, where it is installed.

A joint limit gives the specified stiffness only with tiny `solimp` (default-like values give up to
ten times as much): here `solimplimit=".0001 .0001 .001"` and `solreflimit="-K/m -B/m"`. MuJoCo is
given its best case: many steps per call, one model for both devices when it is timed, and the
control law for nothing.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from tautwave.bench.precision.points import Point
from tautwave.bench.precision.rigs import RigScene, rig_errors
from tautwave.models.integrators.schemes import EXACT
from tautwave.models.plant_params import PlantParams
from tautwave.simulation.kernel.pack import Job, pack_rig
from tautwave.simulation.kernel.records import DeviceParams, DeviceState
from tautwave.simulation.kernel.schemes import with_scheme
from tests.lab.peers.scipy_control import missing
from tests.lab.plain.scene import Plain
from tests.lab.plain.truth import Move, plain_error, plain_loop, plain_plants
from tests.lab.timing import cpu_time
from tests.lab.workprecision import linear as resonator
from tests.lab.workprecision.contact import Array, ContactScene

INTEGRATORS = ("Euler", "RK4")
_FAR = 1e3


def slide_text(name: str, plant: PlantParams) -> str:
    """Return the body of one mass on a slide, its wall a limit of the joint [SI]."""
    limit = ""
    if plant.wall_stiffness > 0.0:
        k, b = plant.wall_stiffness / plant.mass, plant.wall_damping / plant.mass
        end = plant.wall_position
        ends = f"{-_FAR:g} {end:.17g}" if plant.wall_side > 0.0 else f"{end:.17g} {_FAR:g}"
        limit = (
            f' limited="true" range="{ends}" solreflimit="{-k:.17g} {-b:.17g}" '
            'solimplimit=".0001 .0001 .001"'
        )
    damping = plant.viscous + plant.grip_damping
    return (
        f'<body><joint name="{name}" type="slide" axis="1 0 0" damping="{damping:.17g}" '
        f'stiffness="{plant.grip_stiffness:.17g}"{limit}/>'
        f'<geom type="sphere" size=".001" mass="{plant.mass:.17g}" contype="0" conaffinity="0"/>'
        "</body>"
    )


def make_model(
    bodies: Sequence[str], step: float, integrator: str, more: str = ""
) -> tuple[Any, Any, Any]:
    """Return mujoco, a model and its data; no gravity, step [s]."""
    mujoco: Any = importlib.import_module("mujoco")
    text = (
        f'<mujoco><option timestep="{step:.17g}" gravity="0 0 0" integrator="{integrator}" '
        'iterations="50" tolerance="1e-12"><flag eulerdamp="disable"/></option>'
        f"<worldbody>{''.join(bodies)}</worldbody>{more}</mujoco>"
    )
    mujoco.set_mju_user_warning(ignore)  # else it writes a log file where it stands
    model = mujoco.MjModel.from_xml_string(text)
    return mujoco, model, mujoco.MjData(model)


def ignore(_: str) -> None:
    """Suppress the message: errors are read from the data."""


def fine(data: Any) -> bool:
    """Return whether MuJoCo never had to reset an unstable state."""
    return not any(int(warning.number) for warning in data.warning)


def mujoco_contact(scene: ContactScene, counts: Sequence[int], rounds: int) -> Iterator[Point]:
    """Yield MuJoCo on a throw: a limit for the linear wall, a Python call-back for a power law."""
    if missing("mujoco"):
        return
    starts = scene.starts()
    for integrator in INTEGRATORS:
        for n in counts:
            step = scene.span_s / n
            mujoco, model, data = make_model([slide_text("x", scene.plant)], step, integrator)
            out = np.zeros(2 * len(starts))

            def run(
                n: int = n,
                mujoco: Any = mujoco,
                model: Any = model,
                data: Any = data,
                out: Array = out,
            ) -> None:
                for i, x in enumerate(starts):
                    mujoco.mj_resetData(model, data)
                    data.qpos[0], data.qvel[0] = x, 1.0
                    mujoco.mj_step(model, data, n)
                    out[2 * i], out[2 * i + 1] = data.qpos[0], data.qvel[0]

            with power_law(mujoco, scene):
                spent = cpu_time(run, scene.span_s * len(starts), min(rounds, 3))
            error, energy = scene.errors(out)
            yield Point(
                scene.name,
                f"MuJoCo {integrator}",
                step,
                error,
                energy,
                spent,
                False,
                True,
            )


@contextmanager
def power_law(mujoco: Any, scene: ContactScene) -> Iterator[None]:
    """Have MuJoCo call a power law back at every evaluation of its forces, inside the block."""
    if scene.exponent == 1.0:
        yield
        return
    k, a = scene.stiffness, scene.exponent

    def push(_: Any, data: Any) -> None:
        depth = data.qpos[0]
        if depth > 0.0:
            data.qfrc_passive[0] -= k * depth**a

    mujoco.set_mjcb_passive(push)
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(None)


def mujoco_linear(counts: Sequence[int], rounds: int) -> Iterator[Point]:
    """Yield MuJoCo on the resonator: two slides and a tendon with the coupling's stiffness."""
    if missing("mujoco"):
        return
    m, k, b, n, hard, c, spring = (float(value) for value in resonator.PAIR)
    bodies = [
        slide_text("x", PlantParams(m, b, 0.0, k, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
        slide_text("y", PlantParams(n, c, 0.0, hard, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)),
    ]
    tendon = (
        f'<tendon><fixed stiffness="{spring:.17g}" springlength="0"><joint joint="x" coef="1"/>'
        '<joint joint="y" coef="-1"/></fixed></tendon>'
    )
    for integrator in (*INTEGRATORS, "implicit"):
        for steps in counts:
            mujoco, model, data = make_model(bodies, resonator.SPAN_S / steps, integrator, tendon)

            def run(
                state: Array,
                steps: int = steps,
                mujoco: Any = mujoco,
                model: Any = model,
                data: Any = data,
            ) -> None:
                mujoco.mj_resetData(model, data)
                data.qpos[:], data.qvel[:] = state[:2], state[2:]
                mujoco.mj_step(model, data, steps)
                state[:2], state[2:] = data.qpos, data.qvel

            state, spent = resonator.timed(run, min(rounds, 3))
            # MuJoCo resets an unstable simulation to its start, with a warning.
            error, energy = resonator.errors(state if fine(data) else state * np.nan)
            step = resonator.SPAN_S / steps
            yield Point(
                resonator.NAME, f"MuJoCo {integrator}", step, error, energy, spent, False, True
            )


def mujoco_rig(
    scene: RigScene, counts: Sequence[int], duration_s: float, oracle: Array, rounds: int
) -> Iterator[Point]:
    """Yield MuJoCo's devices behind tautwave's own law, in closed loop.

    The error is that of the whole loop; the time is that of MuJoCo's steps alone, both devices in
    one model, their law and the recording for nothing. Walls only.
    """
    if missing("mujoco"):
        return
    rig = scene.load()
    job = with_scheme(pack_rig(rig, duration_s), EXACT, 1, 0.0)
    for integrator in INTEGRATORS:
        for substeps in counts:
            rows = _closed_loop(job, integrator, substeps)
            step = rig.period_s / substeps
            plants = [device.plant for device in job.devices]
            spent = _time_alone(plants, step, integrator, 1000 * substeps, rounds)
            error, _ = rig_errors(job, rows, oracle)
            name = f"MuJoCo {integrator}"
            yield Point(scene.name, name, step, error, float("nan"), spent, False, True)


def mujoco_plain(
    name: str,
    p: Plain,
    aims: Sequence[float],
    counts: Sequence[int],
    oracle: Array,
    rounds: int,
) -> Iterator[Point]:
    """Yield MuJoCo's devices in the plain scene, in closed loop; timed as in `mujoco_rig`."""
    if missing("mujoco"):
        return
    plants = plain_plants(p)
    for integrator in INTEGRATORS:
        for substeps in counts:
            step = p.period / substeps
            moves = [_mover(plant, step, integrator, substeps) for plant in plants]
            rows = plain_loop(p, aims, moves)
            spent = _time_alone(plants, step, integrator, 1000 * substeps, rounds)
            error = plain_error(rows, oracle)
            nan = float("nan")
            yield Point(name, f"MuJoCo {integrator}", step, error, nan, spent, False, True)


def _mover(plant: PlantParams, step: float, integrator: str, substeps: int) -> Move:
    """Return what moves a device by a period under a held force."""
    mujoco, model, data = make_model([slide_text("x", plant)], step, integrator)

    def move(x: float, v: float, force: float) -> tuple[float, float]:
        data.qpos[0], data.qvel[0] = x, v
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data, substeps)
        return float(data.qpos[0]), float(data.qvel[0])

    return move


def _time_alone(
    plants: Sequence[PlantParams], step: float, integrator: str, many: int, rounds: int
) -> float:
    """Return CPU time per simulated second [s] of devices in one model, `many` steps a call."""
    bodies = [slide_text(f"x{i}", plant) for i, plant in enumerate(plants)]
    mujoco, model, data = make_model(bodies, step, integrator)
    return cpu_time(lambda: mujoco.mj_step(model, data, many), many * step, rounds)


def _closed_loop(job: Job, integrator: str, substeps: int) -> Array:
    """Return the rows of a run in plain Python whose devices are moved by MuJoCo."""
    from tautwave.simulation.kernel import device as devices
    from tautwave.simulation.kernel.run import run_rig
    from tautwave.simulation.kernel.tables import object_tables

    tables = object_tables(job)
    period = job.devices[0].period
    made: Mapping[int, tuple[Any, Any, Any]] = {
        id(body): make_model([slide_text("x", params.plant)], period / substeps, integrator)
        for body, params in zip(tables.bodies, job.devices, strict=True)
    }

    def move_device(
        b: DeviceState, d: DeviceParams, command: float, reference: float, rate: float, h: float
    ) -> None:
        mujoco, model, data = made[id(b)]
        p = d.plant
        data.qpos[0], data.qvel[0] = b.x, b.v
        step = h / substeps
        for i in range(substeps):
            aim = reference + rate * (i + 0.5) * step
            data.qfrc_applied[0] = command + p.grip_stiffness * aim + p.grip_damping * rate
            mujoco.mj_step(model, data)
        b.x, b.v = float(data.qpos[0]), float(data.qvel[0])

    own = devices.move_device
    devices.move_device = move_device
    try:
        count = run_rig(tables, job.law.steps)
    finally:
        devices.move_device = own
    width = len(job.columns)
    return np.asarray(tables.out, dtype=np.float64)[: count * width].reshape(count, width)
