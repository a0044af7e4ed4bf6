"""A mass thrown against a wall and against a Hertz contact: every scheme, against closed forms."""

from __future__ import annotations

import functools
import importlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.bench.precision.points import Point, Scene
from tautwave.models.foam import FoamParams
from tautwave.models.integrators.choice import Choice, choose_scheme
from tautwave.models.integrators.schemes import DORMAND_PRINCE, EXACT, SCHEMES
from tautwave.models.plant_params import PlantCache, PlantParams, plant_cache
from tests.lab.timing import cpu_time
from tests.lab.workprecision import runs

Array = npt.NDArray[np.float64]
Engine = Callable[[Callable[..., int]], Callable[..., int]]

LOOP_S = 1e-3
MASS = 0.1
_PHASES = 20


class ContactScene(NamedTuple):
    """A contact of 0.1 kg at 1 m/s: its law, how long it lasts [s], and what it is called."""

    name: str
    stiffness: float
    exponent: float

    @property
    def plant(self) -> PlantParams:
        """The mass, with the wall where it is linear."""
        k = self.stiffness if self.exponent == 1.0 else 0.0
        return PlantParams(MASS, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, k, 0.0, 0.0, 1.0)

    @property
    def foam(self) -> FoamParams:
        """The contact as a power law."""
        return FoamParams(self.stiffness, self.exponent, 0.0, 0.0, 1.0, 1)

    @property
    def contact_s(self) -> float:
        """Closed form W1 or W3: how long the contact lasts [s]."""
        share = 1.0 / (self.exponent + 1.0)
        deepest = math.pow(0.5 * MASS / (self.stiffness * share), share)
        ratio = math.gamma(1.0 + share) / math.gamma(0.5 + share)
        return 2.0 * deepest * math.sqrt(math.pi) * ratio

    @property
    def span_s(self) -> float:
        """Time simulated: the throw is over by then [s]."""
        return 1.5 * self.contact_s

    def starts(self) -> Array:
        """Where the mass starts [m]: twenty phases that no step divides."""
        share = (np.arange(_PHASES) * 0.6180339887498949) % 1.0
        return np.asarray(-0.4 * self.contact_s * (0.05 + 0.95 * share), dtype=np.float64)

    def errors(self, out: Array) -> tuple[float, float]:
        """Return median state error and median energy error of the ends (x, v) of all starts."""
        x, v = out[0::2], out[1::2]
        # In at speed 1, out at speed 1, whatever the law.
        want = -(self.span_s + self.starts() - self.contact_s)
        gone = (x - want) / self.contact_s
        error = float(np.median(np.hypot(gone, v + 1.0)))
        return max(error, 1e-17), max(float(np.median(np.abs(v * v - 1.0))), 1e-17)


WALL = ContactScene("wall", 1e4, 1.0)
HERTZ = ContactScene("hertz", 1e7, 1.5)


def records(kind: Any, value: Any) -> Any:
    """Return one NamedTuple as the record table that compiled code takes."""
    from tautwave.simulation.kernel.records import record_type

    return np.array([plain(value)], dtype=record_type(kind))


def plain(value: Any) -> Any:
    """Return nested NamedTuples as nested tuples, which NumPy takes as records."""
    return tuple(plain(part) for part in value) if isinstance(value, tuple) else value


@functools.cache
def compiled(entry: Callable[..., int]) -> Callable[..., int]:
    """Return a run of `workprecision_runs` compiled by numba."""
    from tautwave.simulation.kernel.compiled import cached, load_numba

    if entry.__name__.startswith("run_pair"):
        load_numba()
        importlib.import_module("numba.extending").register_jitable(runs.pair_rates)
    return cached(entry)


def run_method(
    scene: ContactScene,
    scheme: int,
    steps: int,
    tolerance: float,
    engine: Engine,
    rounds: int,
) -> tuple[Array, float]:
    """Return the ends of all starts (x, v in turn) and CPU time per simulated second [s]."""
    t = scene.span_s / steps
    starts = scene.starts()
    out = np.zeros(2 * len(starts))
    repeats = max(1, 4000 // (steps * len(starts)))
    sizes = np.array([len(starts), steps, repeats])
    plants = records(PlantParams, scene.plant)
    if scheme == EXACT:
        table = records(PlantCache, plant_cache(scene.plant, t))
        run = engine(runs.run_exact)
    else:
        foam = scene.foam._replace(scheme=scheme, tolerance=tolerance)
        table = records(FoamParams, foam)
        run = engine(runs.run_contact)
    spent = cpu_time(
        lambda: run(plants, table, starts, out, sizes, t),
        scene.span_s * len(starts) * repeats,
        rounds,
    )
    return out, spent


def contact_scene(
    scene: ContactScene,
    counts: Sequence[int],
    tolerances: Sequence[float],
    max_error: float,
    rounds: int,
) -> Scene:
    """Return all schemes of tautwave on a contact.

    Parameters
    ----------
    counts : sequence of int
        Steps of a throw, of 1.5 contact times.
    tolerances : sequence of float
        Of Dormand-Prince, which takes its own steps.
    max_error : float
        What the chosen point has to meet.
    """
    points = []
    linear = scene.exponent == 1.0
    for name, scheme in SCHEMES.items():
        if scheme == EXACT and not linear:
            continue
        adaptive = scheme == DORMAND_PRINCE
        for value in tolerances if adaptive else counts:
            steps = 1 if adaptive else int(value)
            out, spent = run_method(scene, scheme, steps, float(value), compiled, rounds)
            step = float(value) if adaptive else scene.span_s / steps
            points.append(Point(scene.name, name, step, *scene.errors(out), spent, adaptive))
    choice = choose_scheme(scene.plant, scene.foam, 1.0, LOOP_S, max_error, linear)
    power = "" if linear else f"^{scene.exponent:g}"
    what = (
        f"0.1 kg at 1 m/s against F = {scene.stiffness:g} y{power}, "
        f"contact {1e3 * scene.contact_s:.3g} ms; error: median over {_PHASES} entry phases of the "
        "state's distance from the closed form after the contact, in impact speed and contact time"
    )
    return Scene(scene.name, what, tuple(points), chosen_point(scene, choice, rounds), choice.why)


def chosen_point(scene: ContactScene, choice: Choice, rounds: int) -> Point:
    """Return the point of what `auto` takes at the loop's step."""
    names: Mapping[int, str] = {number: name for name, number in SCHEMES.items()}
    best = choice.best
    adaptive = best.scheme == DORMAND_PRINCE
    t = LOOP_S / best.substeps
    steps = 1 if adaptive else max(1, math.ceil(scene.span_s / t))
    out, spent = run_method(scene, best.scheme, steps, best.tolerance, compiled, rounds)
    step = best.tolerance if adaptive else scene.span_s / steps
    return Point(scene.name, names[best.scheme], step, *scene.errors(out), spent, adaptive)
