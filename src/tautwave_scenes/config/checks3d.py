"""Cross-checks for a three-dimensional `scene`: names, directions, schemes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document, nearest, show_path
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError
from tautwave_scenes.config.checks import check_between, named_ends
from tautwave_scenes.config.keys3d import Scene3d, Vector, mesh_of, surface_keys
from tautwave_scenes.config.sounds import check_sound
from tautwave_scenes.models.solid import solid_size
from tautwave_scenes.models.tissue.mesh import FACES, Mesh, on_faces, shape_of

GROUND = "ground"
SPACE_ONLY = (
    *("directions", "axes", "turns", "points"),
    *("normal", "direction", "rows", "row_spacing", "clamped"),
)


def check_dimension(document: Document) -> None:
    """Note 3D keys in a one-dimensional scene, and a dimension other than 1 or 3."""
    scene = document.get(("scene",))
    if not isinstance(scene, dict) or scene.get("dimension") == 3:
        return
    if scene.get("dimension", 1) != 1:
        document.report(("scene", "dimension"), "a scene has dimension 1 or 3")
        return
    for path in _spatial(scene):
        document.report(
            ("scene",),
            f"{show_path(path)} belongs to a scene of points: add dimension: 3, or remove it",
        )
        return


def _spatial(scene: dict[str, Any]) -> Iterator[KeyPath]:
    """Yield the places of vectors and of keys that exist only in three dimensions."""
    if isinstance(scene.get("gravity"), list):
        yield ("gravity",)
    for kind in ("masses", "grounds", "links", "ports", "forces"):
        blocks = scene.get(kind)
        for name, block in blocks.items() if isinstance(blocks, dict) else ():
            if isinstance(block, list):
                yield (kind, name)
            for key in block if isinstance(block, dict) else ():
                vector = key in ("position", "velocity", "spacing", "offset")
                if key in SPACE_ONLY or (vector and isinstance(block[key], list)):
                    yield (kind, name, key)


def check_scene3d(document: Document, parts: Parts, scene: Scene3d) -> None:
    """Note mistakes between the blocks of a 3D scene, each of which is valid on its own."""
    if not _check_tissues(document, scene) or not _check_solids(document, scene):
        return
    known = [*scene.masses, *scene.tissues, *scene.ports, GROUND, *scene.grounds, *scene.solids]
    _check_names(document, scene)
    touched: set[str] = set()
    for path, name in named_ends(scene):
        touched.add(scene.group_of(name))
        if scene.group_of(name) not in known:
            hint = nearest(name, known) or "."
            document.report(path, f"unknown node {name!r}{hint} Nodes: {', '.join(known)}")
    for kind, block in (
        ("masses", scene.masses),
        ("tissues", scene.tissues),
        ("solids", scene.solids),
        ("ports", scene.ports),
    ):
        for name in block:
            if name not in touched:
                document.report(("scene", kind, name), "no link ends at it; add one, or remove it")
    _check_links(document, scene)
    _check_ports(document, parts, scene)
    _check_forces(document, parts, scene)
    for bus, keys in parts.buses.items():
        if keys is not None and keys.divisor > 1:
            document.report(("buses", bus, "divisor"), "a scene runs at a single rate; remove it")


def _check_tissues(document: Document, scene: Scene3d) -> bool:
    """Return whether every tissue has a mesh; note those that have none, or a bad one."""
    good = True
    for name, keys in scene.tissues.items():
        path: KeyPath = ("scene", "tissues", name)
        if (keys.block is None) == (keys.mesh is None):
            document.report(path, "give either block or mesh")
            good = False
            continue
        try:
            mesh = mesh_of(keys)
            for number, corners in enumerate(mesh.tetrahedra):
                shape_of([mesh.nodes[node] for node in corners], f"tetrahedron {number + 1}")
        except (ConfigError, ValueError) as err:
            document.report((*path, "block" if keys.mesh is None else "mesh"), str(err))
            good = False
            continue
        if why := _wrong_inclusion(mesh, list(keys.inclusions)):
            document.report((*path, "inclusions"), why)
            good = False
            continue
        known = (*FACES, *(group for group, _ in mesh.groups))
        if wrong := next((one for one in keys.clamped if one not in known), None):
            document.report(
                (*path, "clamped"),
                f"{wrong!r} is neither a face nor a physical group of the mesh: {', '.join(known)}",
            )
            good = False
            continue
        if len(on_faces(mesh, keys.clamped)) == len(mesh.nodes):
            document.report((*path, "clamped"), "every node is fixed; clamp fewer faces")
            good = False
    if scene.tissues and scene.scheme == "symplectic":
        document.report(
            ("scene", "scheme"),
            "symplectic does not run tissues; use discrete_gradient or linearly_implicit",
        )
    return good


LONG_M, SHORT_M = 5.0, 1e-3
"""A solid longer or shorter than these has another unit of length than is stated."""


def _check_solids(document: Document, scene: Scene3d) -> bool:
    """Return whether every solid has a surface; note those that have none, or another unit."""
    good = True
    for name, keys in scene.solids.items():
        path: KeyPath = ("scene", "solids", name)
        try:
            size = solid_size(surface_keys(keys))
        except ConfigError as err:
            document.report((*path, "mesh"), str(err))
            good = False
            continue
        if not SHORT_M <= max(size) <= LONG_M:
            unit = 0.001 if max(size) > LONG_M else 1.0
            document.report(
                (*path, "scale"),
                f"with {keys.scale:g} m for the file's unit it is {max(size):.4g} m long, and a "
                f"hand reaches {SHORT_M:g} to {LONG_M:g} m; give the length of the unit, such as "
                f"{unit:g} (got {keys.scale:g})",
            )
            good = False
    return good


def _check_touch(document: Document, scene: Scene3d, name: str) -> None:
    """Note a link with a solid that is no contact of a point with it."""
    link, path = scene.links[name], ("scene", "links", name)
    solid = next(end for end in link.between if end in scene.solids)
    if link.type != "contact":
        document.report((*path, "type"), f"{solid} is a solid: only a contact ends at it")
    elif link.between[1] != solid or link.between[0] in scene.solids:
        document.report((*path, "between"), f"name what touches first, then the solid {solid}")
    elif link.between[0] in (GROUND, *scene.grounds):
        document.report((*path, "between"), "neither end can move")
    elif link.gap != 0.0 or link.normal is not None:
        key = "normal" if link.normal is not None else "gap"
        document.report(
            (*path, key), f"a contact with a solid begins at its surface, along it; remove {key}"
        )


def _wrong_inclusion(mesh: Mesh, inclusions: Sequence[str]) -> str:
    """Say which inclusion is no body of the mesh, or which two share a tetrahedron; '' if none."""
    bodies = dict(mesh.bodies)
    known = ", ".join(bodies) or "none"
    taken: dict[int, str] = {}
    for name in inclusions:
        if name not in bodies:
            surface = name in dict(mesh.groups)
            what = "a physical group without tetrahedra" if surface else "no physical group"
            return f"{name!r} is {what} of the mesh; groups of tetrahedra: {known}"
        for at in bodies[name]:
            if at in taken:
                return (
                    f"{taken[at]!r} and {name!r} both have tetrahedron {at + 1}: give one of "
                    "them, or part the groups in the mesh"
                )
            taken[at] = name
    return ""


def _check_names(document: Document, scene: Scene3d) -> None:
    seen = {GROUND}
    for kind, block in (
        ("masses", scene.masses),
        ("tissues", scene.tissues),
        ("ports", scene.ports),
        ("grounds", scene.grounds),
        ("solids", scene.solids),
    ):
        for name in block:
            grouped = kind not in ("grounds", "solids")
            nodes = {name, *scene.nodes_of(name)} if grouped else {name}
            for node in sorted(nodes & seen)[:1]:
                document.report(("scene", kind, name), f"another node is already named {node!r}")
            seen |= nodes


def _check_links(document: Document, scene: Scene3d) -> None:
    fixed = {GROUND, *scene.grounds, *scene.solids}
    for name, link in scene.links.items():
        check_between(document, scene, name)
        if scene.solids.keys() & set(link.between):
            _check_touch(document, scene, name)
            continue
        one, two = link.between
        if link.chain and one in scene.tissues:
            document.report(("scene", "links", name, "chain"), "only masses can be linked in a row")
        still = {end for end in (one, two) if end in fixed or end in scene.rim_of(end)}
        if still == {one, two}:
            document.report(("scene", "links", name, "between"), "neither end can move")
        if link.type == "contact":
            if link.normal is not None:
                _check_length(document, ("scene", "links", name, "normal"), link.normal)
            elif not link.gap > 0.0:
                document.report(
                    ("scene", "links", name, "gap"),
                    "should be greater than 0, the sum of both radii; or give a plane its normal",
                )


def _check_length(document: Document, path: KeyPath, vector: tuple[float, float, float]) -> None:
    if not math.hypot(*vector) > 0.0:
        document.report(path, "a direction must not be zero")


def _check_ports(document: Document, parts: Parts, scene: Scene3d) -> None:
    axes = parts.sides.get("master", {})
    used: set[str] = set()
    for name, port in scene.ports.items():
        path: KeyPath = ("scene", "ports", name)
        for axis_name in scene.axes_of(name):
            where = path if port.axes is None else (*path, "axes")
            if axis_name not in axes:
                document.report(
                    where,
                    f"there is no master axis {axis_name!r}{nearest(axis_name, list(axes)) or '.'} "
                    f"Axes: {', '.join(axes) or 'none'}",
                )
            if axis_name in used:
                document.report(where, f"axis {axis_name!r} is already used by another port")
            used.add(axis_name)
            axis = axes.get(axis_name)
            if axis is not None and axis.causality == "admittance":
                document.report(
                    where, "a scene outputs effort, so its axis must be an impedance axis"
                )
        _check_directions(document, scene, name)
        _check_tool(document, parts, scene, name)
        if port.to is not None and port.stiffness is None:
            document.report((*path, "stiffness"), "required key is missing (coupling spring k_c)")
        if port.to is None and (port.stiffness is not None or port.damping > 0.0):
            document.report((*path, "to"), "required key is missing: where the spring ends")
    for axis_name in axes:
        if axis_name not in used:
            document.report(
                ("master", "axes", axis_name),
                "not used by the scene; add it to the axes of a port, or remove it",
            )
    heard = scene.output.port
    if heard is not None and heard not in used:
        document.report(
            ("scene", "output", "port"),
            f"no port has an axis {heard!r}. Axes: {', '.join(scene.axes())}",
        )
    for name in parts.hands:
        if name not in used:
            hint = nearest(name, scene.axes()) or "."
            document.report(
                ("simulation", "hand", name),
                f"unknown axis {name!r}{hint} Axes: {', '.join(scene.axes())}",
            )
    for name in parts.environments:
        document.report(("simulation", "environment", name), "a scene has no slave; remove it")
    for full in parts.truths:
        if full not in [f"master.{name}" for name in axes]:
            document.report(
                ("simulation", "axes", full),
                f"unknown axis {full!r}. Axes: {', '.join(f'master.{name}' for name in axes)}",
            )


def _check_directions(document: Document, scene: Scene3d, name: str) -> None:
    given = scene.ports[name].directions
    path: KeyPath = ("scene", "ports", name, "directions")
    if given is None:
        return
    if len(given) != len(scene.movers_of(name)):
        document.report(
            path, f"one for each of its axes: {len(scene.movers_of(name))} (got {len(given)})"
        )
        return
    _check_apart(document, path, given)


def _check_tool(document: Document, parts: Parts, scene: Scene3d, name: str) -> None:
    """Note mistakes of a rigid tool."""
    port, path = scene.ports[name], ("scene", "ports", name)
    if port.turns is not None and port.points is None:
        document.report((*path, "points"), "required key is missing: a rotating tool needs points")
    if port.points is not None and port.to is not None:
        document.report(
            (*path, "to"), "a tool is coupled through its points: define springs under links"
        )
    for axis_name in port.turns or {}:
        axis = parts.sides.get("master", {}).get(axis_name)
        if axis is not None and axis.kind != "rotary":
            document.report((*path, "turns", axis_name), f"a {axis.kind} axis cannot rotate a tool")
    _check_apart(document, (*path, "turns"), list((port.turns or {}).values()))


def _check_apart(document: Document, path: KeyPath, given: list[Vector]) -> None:
    """Note directions that do not span as many dimensions as they are."""
    kept: list[list[float]] = []
    for vector in given:
        size = math.hypot(*vector)
        rest = [part / size for part in vector] if size > 0.0 else [0.0, 0.0, 0.0]
        for other in kept:
            along = sum(one * two for one, two in zip(rest, other, strict=True))
            rest = [one - along * two for one, two in zip(rest, other, strict=True)]
        size = math.hypot(*rest)
        if size < 1e-6:
            document.report(path, "directions must be nonzero and linearly independent")
            return
        kept.append([part / size for part in rest])


def _check_forces(document: Document, parts: Parts, scene: Scene3d) -> None:
    bodies = [*scene.masses, *scene.tissues]
    listed = f"Masses: {', '.join(bodies) or 'none'}"
    for name, force in scene.forces.items():
        path: KeyPath = ("scene", "forces", name)
        if scene.group_of(force.on) not in bodies:
            hint = nearest(force.on, bodies) or "."
            document.report((*path, "on"), f"no mass is named {force.on!r}{hint} {listed}")
        _check_length(document, (*path, "direction"), force.direction)
        if force.type == "sound" and parts.rate_hz is not None:
            check_sound(document, path, force, parts.rate_hz)
    for at, name in enumerate(scene.record):
        if scene.group_of(name) not in bodies:
            hint = nearest(name, bodies) or "."
            document.report(("scene", "record", at), f"no mass is named {name!r}{hint} {listed}")
