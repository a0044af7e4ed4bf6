"""Networks of masses, springs and dampers, and what they are at one of their nodes.

Nodes have names; `ground` does not move. A mass sits between its node and ground, springs and
dampers between any two nodes. With M s**2 + B s + K = P(s) the impedance (force over velocity) at
node i is det P / (s det P without i). Every such network is passive, so its impedance is positive
real: Berdahl, Smith & Niemeyer's model of the hand and of its virtual objects.

Units: SI, linear (kg, N s/m, N/m) or rotary (kg m**2, N m s/rad, N m/rad).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact import polynomials as poly
from tautwave.analysis.exact.polynomials import Number, Poly, exact
from tautwave.analysis.exact.rational import Rational, rational
from tautwave.errors import ConfigError

GROUND = "ground"
Matrix = npt.NDArray[np.float64]


class Mass(NamedTuple):
    """A mass [kg or kg m**2] at a node."""

    node: str
    value: Number


class Spring(NamedTuple):
    """A spring [N/m or N m/rad] between two nodes, or a node and ground."""

    first: str
    second: str
    value: Number


class Damper(NamedTuple):
    """A damper [N s/m or N m s/rad] between two nodes, or a node and ground."""

    first: str
    second: str
    value: Number


Part = Mass | Spring | Damper


def nodes_of(parts: Sequence[Part]) -> tuple[str, ...]:
    """Return the moving nodes in the order they appear."""
    names = [name for part in parts for name in part[:-1] if isinstance(name, str)]
    return tuple(dict.fromkeys(name for name in names if name != GROUND))


def impedance(parts: Sequence[Part], node: str) -> Rational:
    """Return force over velocity at `node`, without external forces on all other nodes.

    Raises
    ------
    ConfigError
        If there is no such node, or a part is loose (its position is undetermined).
    """
    inner, whole = _determinants(parts, node)
    return rational(whole, poly.multiply((Fraction(1), Fraction(0)), inner))


def admittance(parts: Sequence[Part], node: str) -> Rational:
    """Return velocity over force at `node`; see `impedance`."""
    inner, whole = _determinants(parts, node)
    if not whole:
        raise ConfigError(
            f"node {node}: nothing is connected to it, so it offers no resistance to a force"
        )
    return rational(poly.multiply((Fraction(1), Fraction(0)), inner), whole)


def _determinants(parts: Sequence[Part], node: str) -> tuple[Poly, Poly]:
    names = nodes_of(parts)
    if node not in names:
        raise ConfigError(f"there is no node {node}; there are {', '.join(names) or 'none'}")
    mass, damping, stiffness = _assemble(parts)
    size = range(len(names))
    p = [[poly.trim([mass[i][j], damping[i][j], stiffness[i][j]]) for j in size] for i in size]
    at = names.index(node)
    inner = [[p[i][j] for j in size if j != at] for i in size if i != at]
    below = _determinant(inner)
    if not below:
        raise ConfigError("a node other than the driven one has no mass and is tied to nothing")
    return below, _determinant(p)


def _assemble(parts: Sequence[Part]) -> tuple[list[list[Fraction]], ...]:
    names = nodes_of(parts)
    index = {name: i for i, name in enumerate(names)}
    kinds: dict[type, list[list[Fraction]]] = {
        kind: [[Fraction(0)] * len(names) for _ in names] for kind in (Mass, Damper, Spring)
    }
    for part in parts:
        value = exact(part.value)
        if value < 0:
            raise ConfigError(f"{type(part).__name__} of {part.value}: must be >= 0 to be passive")
        matrix = kinds[type(part)]
        ends = [index[name] for name in part[:-1] if name != GROUND]
        for i in ends:
            matrix[i][i] += value
        if len(ends) > 1:
            i, j = ends
            if i == j:
                raise ConfigError(f"{type(part).__name__} with both ends at {names[i]}")
            matrix[i][j] -= value
            matrix[j][i] -= value
    return kinds[Mass], kinds[Damper], kinds[Spring]


def _determinant(p: list[list[Poly]]) -> Poly:
    """Return the determinant of a matrix of polynomials (Bareiss: every division is exact)."""
    rows = [list(row) for row in p]
    last: Poly = (Fraction(1),)
    sign = 1
    for k in range(len(rows) - 1):
        pivot = next((i for i in range(k, len(rows)) if rows[i][k]), None)
        if pivot is None:
            return ()
        if pivot != k:
            rows[k], rows[pivot] = rows[pivot], rows[k]
            sign = -sign
        for i in range(k + 1, len(rows)):
            for j in range(k + 1, len(rows)):
                cross = poly.add(
                    poly.multiply(rows[i][j], rows[k][k]),
                    poly.scale(poly.multiply(rows[i][k], rows[k][j]), -1),
                )
                rows[i][j] = poly.divide(cross, last)[0]
        last = rows[k][k]
    return poly.scale(rows[-1][-1], sign) if rows else (Fraction(1),)
