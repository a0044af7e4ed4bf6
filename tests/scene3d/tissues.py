"""Tissues that several tests use."""

from __future__ import annotations

from tautwave_scenes.models.tissue.mesh import block, on_faces
from tautwave_scenes.networks.network import GROUND
from tautwave_scenes.networks3d.network import ORIGIN, Network3d
from tautwave_scenes.networks3d.tissue import Material, tissue_of

SOFT = Material(2e4, 0.4, 1000.0)
SIZE = (0.06, 0.02, 0.02)


def tissue(cells=(3, 1, 1), size=SIZE, material=SOFT, clamped=("-x",), speed=None, **more):
    """Return a network of one block `b`; `speed` gives a node's velocity [m/s] at its place."""
    mesh = block(size, cells)
    made = tissue_of("b", mesh, material, on_faces(mesh, clamped))
    masses = made.masses
    if speed is not None:
        masses = tuple(one._replace(velocity=speed(one.position)) for one in masses)
    return Network3d(
        masses, (), (), ((GROUND, ORIGIN), *made.grounds), elements=made.elements, **more
    )


def bent(place, top=1.0, size=SIZE):
    """Return the velocity of a beam that is thrown up and aside, most at its free end [m/s]."""
    share = (place[0] / size[0]) ** 2
    return (0.0, 0.4 * top * share, top * share)
