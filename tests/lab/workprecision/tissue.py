"""A beam of tissue thrown aside: error against run time of both steps, and rates in real time.

The beam is clamped at one end and swings, undamped; the error is the distance of its nodes from a
run of the discrete gradient at a sixteenth of the shortest step, as a share of how far they move.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.bench.precision.points import Point, Scene
from tautwave.bench.result import Goal, Table, Value
from tautwave_scenes.models.tissue.mesh import Mesh, block, on_faces
from tautwave_scenes.networks.network import GROUND
from tautwave_scenes.networks3d.network import ORIGIN, Network3d
from tautwave_scenes.networks3d.tissue import Material, tissue_of
from tautwave_scenes.simulation.ticking3d import CompiledModel3d

Array = npt.NDArray[np.float64]

NAME = "tissue"
SCHEMES = ("discrete_gradient", "linearly_implicit")
SOFT = Material(young=2e4, poisson=0.4, density=1000.0)
CELLS = {50: (10, 1, 1), 150: (10, 3, 1), 500: (10, 5, 2), 1500: (12, 5, 5)}
"""Cells of five tetrahedra each, of a beam of 0.1 m."""

RATES = {"discrete_gradient": 200.0, "linearly_implicit": 1000.0}
"""The rate at which each step is to keep up with real time, of 500 tetrahedra [Hz]."""

SPAN_S = 0.08
THROWN = 1.5
"""[m/s] Velocity of the free end at the start."""

LONG = 0.1
"""[m] Length of a beam."""

CLAMPED = ("-x",)


def beam_mesh(tetrahedra: int) -> Mesh:
    """Return a beam of cells of about 10 mm by the number of its tetrahedra."""
    cells = CELLS[tetrahedra]
    return block((LONG, 0.01 * cells[1], 0.01 * cells[2]), cells)


def speed_at(x: float) -> float:
    """Return how fast a node at `x` [m] is thrown up [m/s]."""
    return THROWN * (x / LONG) ** 2


def beam(tetrahedra: int) -> Network3d:
    """Return a beam that is thrown up, by the number of its tetrahedra."""
    mesh = beam_mesh(tetrahedra)
    made = tissue_of("beam", mesh, SOFT, on_faces(mesh, CLAMPED))
    masses = tuple(
        one._replace(velocity=(0.0, 0.0, speed_at(one.position[0]))) for one in made.masses
    )
    return Network3d(masses, (), (), ((GROUND, ORIGIN), *made.grounds), elements=made.elements)


def throw(network: Network3d, scheme: str, step: float, span: float) -> tuple[Array, float, float]:
    """Return where the nodes end (3 n,) [m], the share of energy made, and CPU time [s]."""
    model = CompiledModel3d(network, scheme, step)
    begun = time.thread_time_ns()
    for _ in range(round(span / step)):
        model.advance([])
    spent = 1e-9 * (time.thread_time_ns() - begun)
    made = abs(model.booked.energy - model.start.energy) / model.start.energy
    return np.array(model.arrays.x[: 3 * model.arrays.count[0]]), made, spent


class Flexed(NamedTuple):
    """A peer's points, and how far its fine run ends from ours, as a share of the motion."""

    points: tuple[Point, ...]
    apart: float


Peer = Callable[[Mesh, Sequence[float], Array, float], Flexed | None]
"""Runs the beam of a mesh at some steps [s], given our fine run's end and how far it moves [m]."""


def tissue_scene(steps: tuple[float, ...], max_error: float, peer: Peer) -> Scene:
    """Return error and run time of both steps and a peer at `steps` [s], 50 tetrahedra."""
    network = beam(50)
    start = np.array([part for mass in network.masses for part in mass.position])
    fine, _, _ = throw(network, "discrete_gradient", min(steps) / 16.0, SPAN_S)
    moved = float(np.abs(fine - start).max())
    points = []
    for scheme in SCHEMES:
        for step in steps:
            places, made, spent = throw(network, scheme, step, SPAN_S)
            error = max(float(np.abs(places - fine).max()) / moved, 1e-17)
            points.append(Point(NAME, scheme, step, error, max(made, 1e-17), spent / SPAN_S))
    good = [point for point in points if point.error <= max_error] or points
    chosen = min(good, key=lambda point: point.cpu_s)
    what = (
        f"a beam of 50 tetrahedra, thrown at {THROWN:g} m/s; distance of its nodes from a run at "
        f"{1e6 * min(steps) / 16.0:.3g} us after {1e3 * SPAN_S:g} ms, as a share of how far they "
        f"moved, {1e3 * moved:.3g} mm"
    )
    notes = []
    flexed = peer(beam_mesh(50), steps, fine, moved)
    if flexed is not None:
        points += flexed.points
        notes.append(
            "MuJoCo is held against a fine run of its own, which another law of the material takes "
            f"{flexed.apart:.2g} of the motion away from ours"
        )
    return Scene(
        NAME, what, tuple(points), chosen, "the cheapest within the error", tuple(notes), "cheapest"
    )


def rates(seconds: float) -> list[list[Value]]:
    """Return what each beam costs at the rate of each step, simulated for `seconds` [s].

    Tetrahedra, scheme, rate [Hz], CPU time a step [us], its share of the period, and the share of
    the energy that the steps made.
    """
    rows: list[list[Value]] = []
    for count in CELLS:
        network = beam(count)
        for scheme, rate in RATES.items():
            _, made, spent = throw(network, scheme, 1.0 / rate, seconds)
            step = spent / round(seconds * rate)
            rows.append([count, scheme, rate, 1e6 * step, step * rate, made])
    return rows


def rate_table(rows: list[list[Value]]) -> Table:
    """Return the rates as a table."""
    return Table(
        "Tissue in real time",
        "CPU time of one step of a thrown beam, compiled, as a share of its period: below 1 is "
        "real time on one core; energy is what all its steps made, as a share of the beam's",
        ("tetrahedra", "step", "rate_hz", "us_per_step", "share_of_period", "energy"),
        rows,
    )


def rate_goals(rows: list[list[Value]]) -> list[Goal]:
    """Return the goals: 500 tetrahedra keep up with real time at the rate of each step."""
    return [
        Goal(f"tissue: 500 tetrahedra at {row[2]:g} Hz, {row[1]}", 1.0, "periods", float(row[4]))
        for row in rows
        if row[0] == 500 and isinstance(row[4], float)
    ]
