"""Bounces and long runs of the shipped contact models, in the subset that numba understands.

One mass, 1 m/s towards a contact that begins at 0. The same text runs as plain Python.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.bench.compiled import has_numba
from tautwave.models.foam import FoamParams, elastic_energy
from tautwave.models.integrators.schemes import integrate_step
from tautwave.models.plant import plant_step
from tautwave.models.plant_params import PlantCache, PlantParams
from tautwave.simulation.kernel.records import empty, record_type


class Bounce(NamedTuple):
    """One bounce: at `x` [m] with 1 m/s, `steps` of `h` [s] at most; `exact`: `plant_step`.

    `whole`: all steps are made, however often it comes back.
    """

    plant: PlantParams
    cache: PlantCache
    foam: FoamParams
    x: float
    v: float
    h: float
    steps: int
    exact: bool
    whole: bool


class Bounced:
    """How it ended: state, energy lost and greatest energy [J], steps made, whether it came out."""

    x: float
    v: float
    lost: float
    energy: float
    least: float
    steps: int
    out: bool
    finite: bool


def bounce_all(bounces: Sequence[Bounce], ends: Sequence[Bounced], counts: Sequence[int]) -> int:
    """Make `counts[0]` bounces; return how many."""
    count = counts[0]
    for at in range(count):
        b = bounces[at]
        e = ends[at]
        x = b.x
        v = b.v
        mode = 0
        e.finite = True
        e.least = 1e300
        made = 0
        while made < b.steps:
            if b.exact:
                x, v, mode, _, _, viscous, coulomb, environment = plant_step(
                    b.plant, b.cache, x, v, mode, 0.0, 0.0, 0.0, b.h
                )
            else:
                x, v, _, _, viscous, coulomb, environment = integrate_step(
                    b.plant, b.foam, x, v, 0.0, 0.0, 0.0, b.h
                )
            made = made + 1
            e.lost += viscous + coulomb + environment
            energy = 0.5 * b.plant.mass * v * v
            energy = energy + elastic_energy(b.foam, x)
            if b.plant.spring_stiffness > 0.0:
                stretch = x - b.plant.spring_position
                energy = energy + 0.5 * b.plant.spring_stiffness * stretch * stretch
            total = energy + x
            if total - total != 0.0:
                e.finite = False
                break
            if energy > e.energy:
                e.energy = energy
            if energy < e.least:
                e.least = energy
            if not b.whole and v < 0.0 and x < 0.0:
                e.out = True
                break
        e.x = x
        e.v = v
        e.steps = made
    return count


def run_bounces(bounces: Sequence[Bounce], *, fast: bool = True) -> list[Any]:
    """Return a `Bounced` for every bounce; compiled where `fast` asks for it and can be."""
    if not fast or not has_numba():
        ends = [empty(Bounced) for _ in bounces]
        bounce_all(bounces, ends, [len(bounces)])
        return ends
    cases = np.array([_plain(bounce) for bounce in bounces], dtype=record_type(Bounce))
    found = np.zeros(len(bounces), dtype=record_type(Bounced))
    counts = np.array([len(bounces)], dtype=np.int64)
    _compiled()(cases, found, counts)
    return list(found.view(np.recarray))


@functools.cache
def _compiled() -> Callable[..., int]:
    from tautwave.simulation.kernel.compiled import cached

    return cached(bounce_all)


def _plain(value: Any) -> Any:
    return tuple(_plain(part) for part in value) if isinstance(value, tuple) else value
