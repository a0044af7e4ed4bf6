"""Networks of points that several tests use, and what they should keep."""

from __future__ import annotations

import random
from typing import Any

import numpy as np

from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks3d.network import WAYS, Mass3d, Network3d, Port3d


def vector(rng: random.Random, size: float):
    return tuple(rng.uniform(-size, size) for _ in range(3))


def free_ring(seed: int, count: int = 6, stiffness: float = 300.0) -> Network3d:
    """Points without ground: a ring of springs, a cubic one and balls across. Nothing is lost."""
    rng = random.Random(seed)
    masses = tuple(
        Mass3d(f"m{i}", 0.01 * (1.0 + rng.random()), vector(rng, 0.1), vector(rng, 1.0))
        for i in range(count)
    )
    links = [
        Link(f"s{i}", "spring", f"m{i}", f"m{(i + 1) % count}", rng.uniform(0.2, 1.0) * stiffness,
             rest=0.05)
        for i in range(count)
    ]  # fmt: skip
    links.append(Link("hard", "nonlinear", "m0", f"m{count // 2}", 30.0 * stiffness, exponent=3.0,
                      rest=0.02))  # fmt: skip
    links.append(Link("balls", "contact", "m1", f"m{count - 1}", 30.0 * stiffness, exponent=1.5,
                      rest=0.1))  # fmt: skip
    return Network3d(masses, tuple(links))


def everything(seed: int = 1) -> Network3d:
    """A link of every kind, on a port of three axes and on masses, over a plane, under gravity."""
    rng = random.Random(seed)
    masses = tuple(
        Mass3d(f"m{i}", 0.01 * (1.0 + rng.random()), vector(rng, 0.1), vector(rng, 1.0), 0.01)
        for i in range(6)
    )
    links = [
        Link(f"s{i}", "spring", f"m{i}", f"m{(i + 1) % 6}", 200.0, damping=0.1, rest=0.05)
        for i in range(6)
    ]
    links += [
        Link("hard", "nonlinear", "m0", "m3", 1e4, exponent=3.0, rest=0.02),
        Link("balls", "contact", "m1", "m4", 1e4, exponent=1.5, rest=0.1, loss=0.3),
        Link("clay", "plastic", "m2", "p", 300.0, limit=0.5),
        Link("dry", "friction", "m5", "ground", limit=0.1),
        Link("hair", "bow", "p", "m0", limit=0.2, scale=0.1),
        Link("minus", "negative_damper", "m1", "ground", damping=0.05),
        Link("engine", "energy_source", "m0", "ground", limit=0.01, scale=0.1),
        Link("knock", "contact", "p", "m5", 1e5, exponent=2.0, loss=0.1, rest=0.08),
        Link("oil", "damper", "p", "m5", damping=0.3),
        Link("floor", "contact", "m3", "low", 1e5, loss=0.2, normal=(0.1, 0.0, 2.0)),
        Link("coupling", "spring", "p", "m4", 100.0, damping=0.3),
    ]
    return Network3d(
        masses,
        tuple(links),
        (Port3d("p", ("x", "y", "z"), WAYS, (0.02, 0.0, 0.0)),),
        grounds=(("ground", (0.0, 0.0, 0.0)), ("low", (0.0, 0.0, -0.1))),
        forced=(("m2", (0.0, 0.6, 0.8)),),
        gravity=(0.0, 0.0, -9.81),
    )


def momenta(s) -> np.ndarray:
    """Return momentum and angular momentum of the masses, (6,)."""
    n = s.count[0]
    x, v = (np.array(values[: 3 * n]).reshape(n, 3) for values in (s.x, s.v))
    p = np.array(s.mass)[:, None] * v
    return np.concatenate([p.sum(axis=0), np.cross(x, p).sum(axis=0)])


def flat(values: Any) -> list[float]:
    """Return the numbers of nested lists, tuples and arrays, in their order."""
    if not hasattr(values, "__len__"):
        return [float(values)]
    return [number for value in values for number in flat(value)]
