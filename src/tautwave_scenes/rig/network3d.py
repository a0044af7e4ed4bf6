"""From the keys of a rig's 3D `scene` to its network and its controller."""

from __future__ import annotations

import zlib
from array import array
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.config import Rig
from tautwave.streams import SEED_WORD
from tautwave.types import CommandDelay
from tautwave_scenes.config.keys3d import Link3d, Scene3d, Tissue3d, Vector, mesh_of, surface_keys
from tautwave_scenes.models.tissue.mesh import Mesh, on_faces
from tautwave_scenes.networks.network import GROUND, Link
from tautwave_scenes.networks.signals import force_signal
from tautwave_scenes.networks3d.elements import Element
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.network import (
    ORIGIN,
    WAYS,
    Mass3d,
    Network3d,
    Port3d,
    Pruned3d,
    prune_network3d,
    unit,
)
from tautwave_scenes.networks3d.tissue import Material, tissue_of
from tautwave_scenes.networks3d.tool import Tool3d
from tautwave_scenes.rig.network import (
    coupling_springs,
    hold_account,
    scene_control,
    scene_run,
    sound_force,
)
from tautwave_scenes.runtime.axes import MAX_NODES, SceneControl


def scene3d_of(rig: Rig) -> Scene3d:
    """Return the scene of a rig with a 3D scene."""
    assert isinstance(rig.scene, Scene3d)
    return rig.scene


def whole_network3d(rig: Rig) -> Network3d:
    """Return a rig's network with every group expanded, nothing left out."""
    scene = scene3d_of(rig)
    masses: list[Mass3d] = []
    grounds: list[tuple[str, Vector]] = [(GROUND, ORIGIN), *scene.grounds.items()]
    for name, keys in scene.masses.items():
        rim = scene.rim_of(name)
        for at, node in enumerate(scene.nodes_of(name)):
            row, column = divmod(at, keys.count)
            place = _sum(keys.position, (column, keys.spacing), (row, keys.row_spacing))
            if node in rim:
                grounds.append((node, place))
            else:
                masses.append(Mass3d(node, keys.mass, place, keys.velocity, keys.damping))
    solids = [(name, surface_keys(keys)) for name, keys in scene.solids.items()]
    grounds += [(name, keys.position) for name, keys in scene.solids.items()]
    elements: list[Element] = []
    for name, body in scene.tissues.items():
        mesh = mesh_of(body)
        made = tissue_of(name, mesh, materials_of(body, mesh), on_faces(mesh, body.clamped))
        masses += made.masses
        grounds += made.grounds
        elements += made.elements
    links = [link for name, keys in scene.links.items() for link in _links(scene, name, keys)]
    links += coupling_springs(scene)
    moving = {mass.name for mass in masses}
    forced = dict.fromkeys(
        (node, unit(force.direction))
        for force in scene.forces.values()
        for node in scene.nodes_of(force.on)
        if node in moving
    )
    down = scene.gravity
    return Network3d(
        masses=tuple(masses),
        links=tuple(links),
        ports=tuple(port for name in scene.ports for port in _ports(scene, name)),
        grounds=tuple(grounds),
        forced=tuple(forced),
        recorded=tuple(
            node for name in scene.record for node in scene.nodes_of(name) if node in moving
        ),
        gravity=down if isinstance(down, tuple) else (0.0, 0.0, -down),
        elements=tuple(elements),
        solids=tuple(solids),
        tools=tuple(
            _tool(scene, name) for name, port in scene.ports.items() if port.points is not None
        ),
    )


def _ports(scene: Scene3d, name: str) -> list[Port3d]:
    """Return a port, or the points of a tool."""
    port = scene.ports[name]
    if port.points is None:
        ways = tuple(unit(way) for way in (port.directions or WAYS))
        return [Port3d(name, tuple(scene.movers_of(name)), ways, port.offset)]
    return [
        Port3d(node, (f"{node}.x", f"{node}.y", f"{node}.z"), WAYS, _sum(port.offset, (1, where)))
        for node, where in zip(scene.nodes_of(name), port.points, strict=True)
    ]


def _tool(scene: Scene3d, name: str) -> Tool3d:
    """Return a rigid tool."""
    port = scene.ports[name]
    movers, turns = scene.movers_of(name), port.turns or {}
    ways = tuple(unit(way) for way in (port.directions or WAYS))
    return Tool3d(
        name,
        tuple(movers),
        ways[: len(movers)],
        tuple(turns),
        tuple(unit(way) for way in turns.values()),
        tuple(zip(scene.nodes_of(name), port.points or [], strict=True)),
    )


def materials_of(keys: Tissue3d, mesh: Mesh) -> list[Material]:
    """Return the material of each tetrahedron of a tissue: that of its inclusion, else its own."""
    branches = tuple((branch.share, branch.time_s) for branch in keys.branches)
    own = Material(keys.young, keys.poisson, keys.density, keys.viscous_s, branches, keys.damping)
    materials = [own] * len(mesh.tetrahedra)
    bodies = dict(mesh.bodies)
    for group, other in keys.inclusions.items():
        inside = own._replace(
            young=other.young,
            poisson=own.poisson if other.poisson is None else other.poisson,
            density=own.density if other.density is None else other.density,
        )
        for at in bodies[group]:
            materials[at] = inside
    return materials


def pruned_network3d(rig: Rig) -> Pruned3d:
    """Return the network as it runs, and the elements left out."""
    return prune_network3d(whole_network3d(rig))


def _sum(start: Vector, *steps: tuple[int, Vector]) -> Vector:
    x, y, z = (start[c] + sum(times * step[c] for times, step in steps) for c in range(3))
    return x, y, z


def _links(scene: Scene3d, name: str, keys: Link3d) -> list[Link]:
    one, two = (scene.nodes_of(end) for end in keys.between)
    if keys.chain:
        across = scene.masses[keys.between[0]].count
        pairs = [(one[at + 1], one[at]) for at in range(len(one) - 1) if (at + 1) % across]
        pairs += list(zip(one[across:], one[:-across], strict=True))
    else:
        count = max(len(one), len(two))
        pairs = list(zip(one * (count // len(one)), two * (count // len(two)), strict=True))
    fixed = scene.rim_of(keys.between[0]) | scene.rim_of(keys.between[1])
    fixed |= {GROUND, *scene.grounds, *scene.solids}
    laws = _law(keys) | {"solid": keys.between[1] in scene.solids}
    return [
        Link(name if len(pairs) == 1 else f"{name}{at + 1}", keys.type, a, b, **laws)
        for at, (a, b) in enumerate(pairs)
        if not (a in fixed and b in fixed)  # along a clamped rim
    ]


def _law(keys: Link3d) -> dict[str, Any]:
    """Return the constants of a link by the names of `networks.network.Link`."""
    renamed = {"yield_force": "limit", "force": "limit", "power": "limit", "speed": "scale"}
    renamed |= {"gap": "rest"}
    values = keys.model_dump(exclude={"type", "between", "chain"})
    return {renamed.get(name, name): value for name, value in values.items()}


def forces3d(rig: Rig, network: Network3d, cycles: int) -> list[Sequence[float]]:
    """Return each external force of `network.forced` over a run [N], packed."""
    scene = scene3d_of(rig)
    total: dict[tuple[str, Vector], Any] = {}
    for name, keys in scene.forces.items():
        sound = sound_force(keys, rig.rate_hz, cycles) if keys.type == "sound" else None
        for node in scene.nodes_of(keys.on):
            force = (node, unit(keys.direction))
            if force not in network.forced:
                continue
            signal = sound
            if signal is None:
                # Seeded by name, not position: adding a force does not shift other streams.
                seed = (rig.seed % SEED_WORD, zlib.crc32(f"{name} on {node}".encode()))
                signal = force_signal(keys.model_dump(), rig.rate_hz, cycles, seed)
            total[force] = total[force] + signal if force in total else signal
    return [array("d", total[force].tobytes()) for force in network.forced]


def columns3d(network: Network3d) -> list[str]:
    """Return the names of the first coordinates of the network's masses, `NAME.x` and so on."""
    return [f"{mass.name}.{c}" for mass in network.masses[:MAX_NODES] for c in "xyz"]


def axis_scales(rig: Rig) -> list[float]:
    """Return the scale from each axis to the scene, in the network's order; 1 of turning ones."""
    scene = scene3d_of(rig)
    scales = []
    for name, port in scene.ports.items():
        scales += [port.position_scale] * len(scene.movers_of(name))
        scales += [1.0] * len(port.turns or {})
    return scales


def build_network3d(rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> SceneControl:
    """Build the scene of a rig and the controller of its axes; see `rig.network.build_scene`."""
    network = pruned_network3d(rig).network
    scheme = scene3d_of(rig).scheme
    model = Model3d(network, scheme, rig.period_s, keep_books=True)
    axes = network.axes
    control = scene_control(rig, delays, cycles, axes, columns3d(network))
    return scene_run(
        control,
        model,
        axis_scales(rig),
        [0.0] * len(axes),
        forces3d(rig, network, cycles),
        hold_account(rig, network.links, axes, delays, control, scheme),
    )
