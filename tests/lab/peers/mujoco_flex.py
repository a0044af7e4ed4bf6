"""The beam of tissue as a flex of MuJoCo, where it is installed.

The same nodes, masses, moduli and start. MuJoCo's material is that of Saint Venant and Kirchhoff,
ours is linear in axes that turn with an element: at a hundredth of the speed the two agree to 1e-4
of the motion, at the speed of the scene they differ by 1 %. So each is held against a fine run of
its own, and the distance of the two fine runs is stated beside.
"""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from tautwave.bench.precision.points import Point
from tautwave_scenes.models.tissue.mesh import Mesh, on_faces
from tautwave_scenes.networks3d.tissue import tissue_of
from tests.lab.peers.mujoco import fine, ignore
from tests.lab.peers.scipy_control import missing
from tests.lab.timing import cpu_time
from tests.lab.workprecision.tissue import CLAMPED, NAME, SOFT, SPAN_S, Array, Flexed, speed_at

INTEGRATORS = ("Euler", "RK4", "discrete")
"""MuJoCo's explicit steps, and the one that takes a flex implicitly."""


def flex_text(mesh: Mesh, step: float, integrator: str) -> str:
    """Return the beam: a body of three slides for each free node, its share of the mass in it."""
    fixed = on_faces(mesh, CLAMPED)
    bodies = []
    masses = {one.name: one.mass for one in tissue_of("n", mesh, SOFT, fixed).masses}
    for i, (x, y, z) in enumerate(mesh.nodes):
        axes = () if i in fixed else ("1 0 0", "0 1 0", "0 0 1")
        slides = "".join(f'<joint type="slide" axis="{axis}"/>' for axis in axes)
        bodies.append(
            f'<body name="n{i + 1}" pos="{x:.17g} {y:.17g} {z:.17g}">{slides}<inertial '
            f'pos="0 0 0" mass="{masses.get(f"n{i + 1}", 1.0):.17g}" '
            'diaginertia="1e-12 1e-12 1e-12"/></body>'
        )
    names = " ".join(f"n{i + 1}" for i in range(len(mesh.nodes)))
    corners = " ".join(str(node) for one in mesh.tetrahedra for node in one)
    return (
        f'<mujoco><option timestep="{step:.17g}" gravity="0 0 0" integrator="{integrator}">'
        f'<flag contact="disable" constraint="disable"/></option><worldbody>{"".join(bodies)}'
        f'</worldbody><deformable><flex name="beam" dim="3" body="{names}" element="{corners}">'
        '<contact contype="0" conaffinity="0" selfcollide="none"/>'
        f'<elasticity young="{SOFT.young:.17g}" poisson="{SOFT.poisson:.17g}"/>'
        "</flex></deformable></mujoco>"
    )


def throw_flex(
    mesh: Mesh, step: float, integrator: str, span: float, rounds: int = 0
) -> tuple[Array, float]:
    """Return where the free nodes end (3 n,) [m], NaN if it blew up, and CPU seconds a second."""
    mujoco: Any = importlib.import_module("mujoco")
    mujoco.set_mju_user_warning(ignore)  # else it writes a log file where it stands
    model = mujoco.MjModel.from_xml_string(flex_text(mesh, step, integrator))
    data = mujoco.MjData(model)
    fixed = on_faces(mesh, CLAMPED)
    free = np.array([place for i, place in enumerate(mesh.nodes) if i not in fixed])

    def run() -> None:
        mujoco.mj_resetData(model, data)
        data.qvel[2::3] = [speed_at(x) for x in free[:, 0]]
        mujoco.mj_step(model, data, round(span / step))

    if rounds:
        spent = cpu_time(run, span, rounds)
    else:
        run()
        spent = float("nan")
    # MuJoCo resets an unstable simulation to its start, with a warning.
    ends = free.ravel() + data.qpos
    return (ends if fine(data) else ends * np.nan), spent


def flex_points(
    mesh: Mesh, steps: Sequence[float], own: Array, moved: float, rounds: int
) -> Flexed | None:
    """Return MuJoCo's flex on the beam at `steps` [s], None where it is not installed.

    Parameters
    ----------
    mesh : Mesh
        Of the beam.
    steps : sequence of float
        [s]
    own : ndarray, (3 n,)
        Where our fine run ends [m].
    moved : float
        How far its nodes move [m].
    rounds : int
        Timings of each run.
    """
    if missing("mujoco"):
        return None
    finest, _ = throw_flex(mesh, min(steps) / 8.0, "RK4", SPAN_S)
    points = []
    for integrator in INTEGRATORS:
        for step in steps:
            ends, spent = throw_flex(mesh, step, integrator, SPAN_S, min(rounds, 3))
            error = float(np.abs(ends - finest).max()) / moved
            name = f"MuJoCo flex {integrator}"
            points.append(Point(NAME, name, step, error, float("nan"), spent, False, True))
    return Flexed(tuple(points), float(np.abs(finest - own).max()) / moved)
