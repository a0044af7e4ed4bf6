"""Elements that a scene uses and leaves out, with the reason."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from tautwave.config import Rig
from tautwave.session.plan import NOT_IN_RIG
from tautwave_scenes.config.keys import Scene
from tautwave_scenes.config.keys3d import Scene3d, mesh_of, surface_keys
from tautwave_scenes.models.solid import solid_size, volume_of
from tautwave_scenes.models.tissue.mesh import shape_of


class Line(NamedTuple):
    """One element: whether it is in, why, and otherwise why not."""

    element: str
    used: bool
    why: str
    why_not: str = NOT_IN_RIG


def plan(rig: Rig) -> Iterator[Line]:
    """Yield the elements of a rig's scene."""
    if isinstance(rig.scene, Scene3d):
        yield from _scene3d(rig)
        return
    from tautwave_scenes.rig.network import pruned_network, scene_of, scheme_choice

    keys = scene_of(rig)
    pruned = pruned_network(rig)
    network = pruned.network
    asked = isinstance(rig.scene, Scene) and rig.scene.scheme == "auto"
    reason = f"of the scene; auto: {scheme_choice(rig).why}" if asked else "of the scene"
    yield Line(f"scheme {keys.scheme}", True, reason)
    size = f"{len(network.masses)} masses, {len(network.links)} links"
    if network.strings:
        size += f", {len(network.strings)} strings"
    yield Line("scene", True, size)
    for name, port in keys.ports.items():
        why = "" if port.stiffness is None else f"k_c {port.stiffness:g} to {port.to}"
        yield Line(f"coupling spring of {name}", port.to is not None, why, "links are at the axis")
    if keys.discretise == "with_device":
        yield Line(
            "discretised with the device", True, "modified parameters that preserve its modes"
        )
    yield Line("gravity", keys.gravity != 0.0, f"{keys.gravity:g} m/s^2", "0")
    yield from _around(keys, pruned.left_out)


def _scene3d(rig: Rig) -> Iterator[Line]:
    from tautwave_scenes.rig.network3d import pruned_network3d, scene3d_of

    keys = scene3d_of(rig)
    pruned = pruned_network3d(rig)
    network = pruned.network
    yield Line(f"scheme {keys.scheme}", True, "of the scene, in three dimensions")
    size = f"{len(network.masses)} masses, {len(network.links)} links"
    yield Line("scene", True, size)
    for name, body in keys.tissues.items():
        count = sum(element.tissue == name for element in network.elements)
        relax = ", ".join(f"{b.share:g} in {b.time_s:g} s" for b in body.branches)
        what = f"{count} tetrahedra of {body.young:g} Pa" + (f", relaxing {relax}" if relax else "")
        what += "".join(
            f", {len(dict(mesh_of(body).bodies)[group])} of them ({group}) of {part.young:g} Pa"
            for group, part in body.inclusions.items()
        )
        yield Line(f"tissue {name}", count > 0, what, "no port feels it")
    for name in keys.solids:
        yield Line(
            f"solid {name}", True, f"of {len(dict(network.solids)[name].triangles)} triangles"
        )
    for name, port in keys.ports.items():
        moved = f"moved by {', '.join(keys.movers_of(name))}"
        moved += f", turned by {', '.join(port.turns)}" if port.turns else ""
        moved += f", {len(port.points)} points" if port.points else ""
        yield Line(f"port {name}", True, moved)
        why = "" if port.stiffness is None else f"k_c {port.stiffness:g} to {port.to}"
        yield Line(f"coupling spring of {name}", port.to is not None, why, "links are at the port")
    pulls = ", ".join(f"{part:g}" for part in network.gravity)
    yield Line("gravity", any(network.gravity), f"[{pulls}] m/s^2", "0")
    yield from _around(keys, pruned.left_out)


LONG_M, HEAVY_KG, SHORT_M = 2.0, 50.0, 1e-3
"""A tissue beyond these is doubted: a wrong unit of length makes 8,000 t of a liver, or 8 mg."""


def tissue_facts(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield each tissue, its size and mass, with a doubt where they are implausible."""
    if not isinstance(rig.scene, Scene3d):
        return
    from tautwave_scenes.rig.network3d import materials_of

    for name, keys in rig.scene.tissues.items():
        mesh = mesh_of(keys)
        size = [max(edge) - min(edge) for edge in zip(*mesh.nodes, strict=True)]
        mass = sum(
            material.density * shape_of([mesh.nodes[node] for node in one], name)[1]
            for one, material in zip(mesh.tetrahedra, materials_of(keys, mesh), strict=True)
        )
        text = " x ".join(f"{edge:.3g}" for edge in size) + f" m, {mass:.3g} kg"
        if max(size) > LONG_M or mass > HEAVY_KG or max(size) < SHORT_M:
            text += (
                "; doubtful: is `scale` the length of the file's unit in m (0.001 for mm)?"
                if keys.mesh is not None
                else "; doubtful: sizes are in m, densities in kg/m^3"
            )
        yield name, text


def solid_facts(rig: Rig) -> Iterator[tuple[str, str]]:
    """Yield each solid, its triangles, size and volume, and what of its file is left out."""
    if not isinstance(rig.scene, Scene3d):
        return
    for name, keys in rig.scene.solids.items():
        solid = surface_keys(keys)
        size = " x ".join(f"{edge:.3g}" for edge in solid_size(solid))
        text = f"{len(solid.triangles)} triangles, {size} m, {1e6 * volume_of(solid):.4g} cm^3"
        for count, what in ((solid.flat, "without an area"), (solid.doubled, "doubled")):
            text += f"; {count} {what} left out" if count else ""
        yield name, text


def _around(keys: Scene | Scene3d, sentences: Iterable[str]) -> Iterator[Line]:
    """Common part of one- and three-dimensional scenes."""
    for name, force in keys.forces.items():
        yield Line(f"force {name}", True, f"{force.type} on {force.on}")
    for sentence in sentences:
        part, _, reason = sentence.partition(": ")
        yield Line(part, False, "", reason)
    yield Line("engage ramp", keys.engage_ramp_s > 0, f"{keys.engage_ramp_s:g} s", "its time is 0")
    yield Line(
        "release ramp", keys.release_ramp_s > 0, f"{keys.release_ramp_s:g} s", "its time is 0"
    )
