"""Several walls at once in the plane or in space: how stiff they are together.

The penalty forces of planes add up. Where planes meet at an angle their stiffness in the worst
direction is more than that of each; a force from the distance to a convex body, as a god object
gives it, never is. Since the form of one wall, y(theta) per K, is the same in all directions, the
scalar condition holds with the greatest eigenvalue in place of 1.

Sources: Zilles & Salisbury 1995 (god object); the bound is Colgate & Schenkel's, direction by
direction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from tautwave.analysis.walls.passivity import Leak, wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.errors import ConfigError


def additive_factor(angle: float) -> float:
    """Return how much stiffer two equal planes are together than one: 1 + |cos angle| [1].

    `angle` [rad] is that between their normals.
    """
    return 1.0 + abs(math.cos(angle))


def stiffest_factor(normals: Sequence[Sequence[float]], *, together: int | None = None) -> float:
    """Return the greatest eigenvalue of sum n n^T over equal planes with these normals [1].

    Parameters
    ----------
    normals : sequence of vectors
        Of any length above 0; they are normalised.
    together : int, optional
        How many of them can be touched at once; default: all.
    """
    units = []
    for normal in normals:
        length = math.hypot(*normal)
        if length == 0.0 or not math.isfinite(length):
            raise ConfigError(f"a normal must be finite and differ from zero (got {normal})")
        units.append(np.asarray(normal, float) / length)
    if not units:
        raise ConfigError("planes: at least one normal is needed")
    count = len(units) if together is None else min(together, len(units))
    return max(
        float(np.linalg.norm(np.array(touched), 2)) ** 2 for touched in combinations(units, count)
    )


def planes_leak(wall: SampledWall, factor: float) -> Leak:
    """Return the damping in every direction that equal walls need where they meet.

    `factor` is that of `additive_factor` or `stiffest_factor`; 1 for a god object in a convex
    body. Any of the planes may be touched alone: no factor below 1 helps.
    """
    many = max(1.0, factor)
    return wall_leak(wall._replace(stiffness=wall.stiffness * many, damping=wall.damping * many))
