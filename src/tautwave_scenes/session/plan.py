"""Elements that a scene uses and leaves out, with the reason."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from tautwave.config import Rig
from tautwave.session.plan import NOT_IN_RIG
from tautwave_scenes.config.keys import Scene
from tautwave_scenes.config.keys3d import Scene3d


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
        yield Line(f"tissue {name}", count > 0, what, "no port feels it")
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
