"""Tetrahedra of tissue laid out as flat arrays, and the pattern of their matrix.

An element is owned by the first of its corners that can move, and lies in the arrays by owner. Its
matrix couples corners; `row` and `column` list the blocks of three by three of every mass, its own
first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from typing import Any, NamedTuple

from tautwave_scenes.models.tissue.algebra import Vector
from tautwave_scenes.models.tissue.mesh import shape_of

Numbers = Any
"""A list of numbers (live) or an array (compiled), as in `networks3d.arrays`."""


class Element(NamedTuple):
    """A tetrahedron between four nodes.

    `rest` are the corners' positions without stress [m]; `mu`, `lam` Lame's moduli [Pa]; `viscous`
    the damping as a share of the stiffness [s]; `branches` its (share of the moduli, time [s]).
    """

    tissue: str
    corners: tuple[str, str, str, str]
    rest: tuple[Vector, Vector, Vector, Vector]
    mu: float
    lam: float
    viscous: float = 0.0
    branches: tuple[tuple[float, float], ...] = ()


class Elements(NamedTuple):
    """All elements of a network and their state; `size` is (elements e, branches b of each).

    Constant: `corner` (4 e) nodes; `owned` (n + 1) the first element of each mass; `row` (n + 1),
    `column` and `place` (16 e) the blocks of the matrix, -1 where no mass is; `grad` (9 e) rows:
    gradients of the shape functions of corners 1 to 3 [1/m]; `volume`, `mu`, `lam`, `viscous`,
    `stiff` (force at a strain of 1 [N]); `share`, `relax` (e b).

    State: `turn` (9 e), `strain` (6 e), `held` (6 e b) before the step, `next_turn` and
    `next_strain` at its end; `tangent` (9 for each block); books `kept`, `dissipated` [J].
    """

    size: Numbers
    corner: Numbers
    owned: Numbers
    row: Numbers
    column: Numbers
    place: Numbers
    grad: Numbers
    volume: Numbers
    mu: Numbers
    lam: Numbers
    viscous: Numbers
    stiff: Numbers
    share: Numbers
    relax: Numbers
    turn: Numbers
    strain: Numbers
    held: Numbers
    next_turn: Numbers
    next_strain: Numbers
    tangent: Numbers
    kept: Numbers
    dissipated: Numbers


ELEMENT_INDICES = ("size", "corner", "owned", "row", "column", "place")


def lay_elements(
    elements: Sequence[Element], at: Mapping[str, int], masses: int
) -> tuple[Elements, tuple[str, ...]]:
    """Return elements as lists, without stress, and the tissue of each.

    Those of which no corner can move are left out.

    Parameters
    ----------
    elements : sequence of Element
        Of all tissues.
    at : mapping of str to int
        Nodes by name: masses first, `masses` of them.
    masses : int
        n.

    Raises
    ------
    ValueError
        An element is flat, inverted or not finite.
    """
    kept = []
    for element in elements:
        nodes = [at[name] for name in element.corners]
        owner = min(nodes)
        if owner < masses:
            kept.append((owner, nodes, element))
    kept.sort(key=lambda one: one[0])
    shapes = [shape_of(element.rest, f"element {element.corners}") for _, _, element in kept]
    near: list[dict[int, None]] = [{m: None} for m in range(masses)]
    if not kept:
        near = [{} for _ in range(masses)]
    for _, nodes, _ in kept:
        moving = [node for node in nodes if node < masses]
        for node in moving:
            near[node].update(dict.fromkeys(moving))
    row = list(accumulate(map(len, near), initial=0))
    block = [
        {other: row[node] + number for number, other in enumerate(others)}
        for node, others in enumerate(near)
    ]
    owners = [owner for owner, _, _ in kept]
    count = len(kept)
    branches = max((len(element.branches) for _, _, element in kept), default=0)
    padded = [
        (*element.branches, *[(0.0, 1.0)] * (branches - len(element.branches)))
        for _, _, element in kept
    ]
    laid = Elements(
        size=[count, branches],
        corner=[node for _, nodes, _ in kept for node in nodes],
        owned=list(accumulate((owners.count(m) if count else 0 for m in range(masses)), initial=0)),
        row=row,
        column=[other for others in near for other in others],
        place=[
            block[one][two] if one < masses and two < masses else -1
            for _, nodes, _ in kept
            for one in nodes
            for two in nodes
        ],
        grad=[part for grad, _ in shapes for part in grad],
        volume=[volume for _, volume in shapes],
        mu=[element.mu for _, _, element in kept],
        lam=[element.lam for _, _, element in kept],
        viscous=[element.viscous for _, _, element in kept],
        stiff=[
            volume * (element.lam + 2.0 * element.mu) * max(abs(part) for part in grad)
            for (grad, volume), (_, _, element) in zip(shapes, kept, strict=True)
        ],
        share=[share for pairs in padded for share, _ in pairs],
        relax=[time for pairs in padded for _, time in pairs],
        turn=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] * count,
        strain=[0.0] * (6 * count),
        held=[0.0] * (6 * branches * count),
        next_turn=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0] * count,
        next_strain=[0.0] * (6 * count),
        tangent=[0.0] * (9 * row[-1]),
        kept=[0.0] * count,
        dissipated=[0.0] * count,
    )
    return laid, tuple(element.tissue for _, _, element in kept)
