"""From a mesh and a material to the masses, grounds and elements of a network."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from tautwave_scenes.models.tissue.mesh import Mesh, shape_of
from tautwave_scenes.networks3d.elements import Element
from tautwave_scenes.networks3d.network import ORIGIN, Mass3d, Vector


class Material(NamedTuple):
    """Tissue that is alike in all directions.

    `young` [Pa] and `poisson` once all branches have relaxed; `density` [kg/m^3]; `viscous`:
    damping as a share of the stiffness [s]; `branches`: (share of the moduli, time [s]) each;
    `drag`: damping to ground as a share of the mass [1/s].
    """

    young: float
    poisson: float
    density: float
    viscous: float = 0.0
    branches: tuple[tuple[float, float], ...] = ()
    drag: float = 0.0

    @property
    def lame(self) -> tuple[float, float]:
        """Lame's moduli mu and lam [Pa]."""
        mu = 0.5 * self.young / (1.0 + self.poisson)
        return mu, 2.0 * mu * self.poisson / (1.0 - 2.0 * self.poisson)


class Tissue(NamedTuple):
    """The parts of a network that are a tissue; node i of the mesh has the name NAMEi+1."""

    masses: tuple[Mass3d, ...]
    grounds: tuple[tuple[str, Vector], ...]
    elements: tuple[Element, ...]


def tissue_of(
    name: str,
    mesh: Mesh,
    material: Material | Sequence[Material],
    clamped: Collection[int] = (),
) -> Tissue:
    """Return a tissue at rest: a quarter of each tetrahedron's mass at each of its corners.

    Parameters
    ----------
    name : str
        Of the tissue.
    mesh : Mesh
        Its nodes and tetrahedra.
    material : Material or sequence of Material
        The same everywhere, or that of each tetrahedron.
    clamped : collection of int
        Numbers of the nodes that cannot move.

    Raises
    ------
    ValueError
        A tetrahedron is flat or inverted, a node belongs to none, or a number is not finite.
    """
    masses = [0.0] * len(mesh.nodes)
    drags = [0.0] * len(mesh.nodes)
    elements = []
    each = [material] * len(mesh.tetrahedra) if isinstance(material, Material) else material
    for number, (corners, own) in enumerate(zip(mesh.tetrahedra, each, strict=True)):
        mu, lam = own.lame
        rest = tuple(mesh.nodes[node] for node in corners)
        _, volume = shape_of(rest, f"tetrahedron {number + 1} of {name}")
        for node in corners:
            share = 0.25 * own.density * volume
            masses[node] += share
            drags[node] += own.drag * share
        names = [f"{name}{node + 1}" for node in corners]
        elements.append(
            Element(
                name,
                (names[0], names[1], names[2], names[3]),
                (rest[0], rest[1], rest[2], rest[3]),
                mu,
                lam,
                own.viscous,
                own.branches,
            )
        )
    for node, mass in enumerate(masses):
        if mass == 0.0:
            raise ValueError(f"node {node + 1} of {name} belongs to no tetrahedron; remove it")
    return Tissue(
        tuple(
            Mass3d(f"{name}{node + 1}", mass, place, ORIGIN, drags[node])
            for node, (mass, place) in enumerate(zip(masses, mesh.nodes, strict=True))
            if node not in clamped
        ),
        tuple((f"{name}{node + 1}", mesh.nodes[node]) for node in sorted(clamped)),
        tuple(elements),
    )
