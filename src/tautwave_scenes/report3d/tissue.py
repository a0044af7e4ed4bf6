"""The surface of tissues: triangles that belong to one tetrahedron, and how they are strained."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from tautwave.report.figures.envelope import Floats
from tautwave_scenes.networks3d.network import Network3d

Triangle = tuple[str, str, str]


def surface_of(network: Network3d) -> list[Triangle]:
    """Return the triangles of all tissues that belong to one element only."""
    seen: dict[frozenset[str], Triangle | None] = {}
    for element in network.elements:
        for corners in itertools.combinations(element.corners, 3):
            key = frozenset(corners)
            seen[key] = None if key in seen else corners
    return [triangle for triangle in seen.values() if triangle is not None]


def edges_at_rest(network: Network3d) -> dict[frozenset[str], float]:
    """Return the length of each edge of a tissue without stress [m]."""
    lengths: dict[frozenset[str], float] = {}
    for element in network.elements:
        for (one, a), (two, b) in itertools.combinations(
            zip(element.corners, element.rest, strict=True), 2
        ):
            lengths[frozenset((one, two))] = float(np.linalg.norm(np.subtract(a, b)))
    return lengths


def strain_of(
    triangle: Triangle, at: Mapping[str, Floats], rest: Mapping[frozenset[str], float]
) -> Floats:
    """Return the greatest stretch of a triangle's edges over time, as a share of their length."""
    shares = [
        np.linalg.norm(at[one] - at[two], axis=1) / rest[frozenset((one, two))] - 1.0
        for one, two in itertools.combinations(triangle, 2)
    ]
    return np.asarray(np.abs(shares).max(axis=0))
