"""Cross-checks between a rig's `scene` and its other keys: names, ends, schemes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from tautwave.config.pieces import Parts
from tautwave.config.text.document import Document, nearest
from tautwave.config.text.yaml12 import KeyPath
from tautwave_scenes.config.keys import Scene, ScenePort
from tautwave_scenes.config.keys3d import Scene3d
from tautwave_scenes.config.sounds import check_sound
from tautwave_scenes.models.link_kinds import LINK_KINDS, is_linear

if TYPE_CHECKING:
    from tautwave_scenes.config.keys3d import Scene3d

GROUND = "ground"


def check_scene(document: Document, parts: Parts, scene: Scene) -> None:
    """Note mistakes between the blocks of a scene, each of which is valid on its own."""
    fixed = [GROUND, *scene.grounds]
    known = [*scene.masses, *scene.strings, *scene.ports, *fixed]
    _check_twice(document, scene, known)
    touched: set[str] = set()
    for path, name in named_ends(scene):
        touched.add(name)
        if name not in known:
            hint = nearest(name, known) or "."
            document.report(path, f"unknown node {name!r}{hint} Nodes: {', '.join(known)}")
    for name in (*scene.masses, *scene.strings, *scene.ports):
        if name not in touched:
            kind = "masses" if name in scene.masses else "strings"
            kind = "ports" if name in scene.ports else kind
            document.report(("scene", kind, name), "no link ends at it; add one, or remove it")
    _check_links(document, scene)
    _check_ports(document, parts, scene)
    for name, force in scene.forces.items():
        if force.on not in scene.masses:
            document.report(
                ("scene", "forces", name, "on"),
                f"no mass is named {force.on!r}{nearest(force.on, list(scene.masses)) or '.'} "
                f"Masses: {', '.join(scene.masses) or 'none'}",
            )
        if force.type == "sound" and parts.rate_hz is not None:
            check_sound(document, ("scene", "forces", name), force, parts.rate_hz)
    for at, name in enumerate(scene.record):
        if name not in scene.masses:
            document.report(
                ("scene", "record", at),
                f"no mass is named {name!r}{nearest(name, list(scene.masses)) or '.'} "
                f"Masses: {', '.join(scene.masses) or 'none'}",
            )
    _check_scheme(document, parts, scene)
    _check_simulation(document, parts, scene)


def named_ends(scene: Scene | Scene3d) -> Iterator[tuple[KeyPath, str]]:
    """Yield every node that a link or a port's coupling spring names, with its place."""
    for name, link in scene.links.items():
        for at, end in enumerate(link.between):
            yield ("scene", "links", name, "between", at), end
    for name, port in scene.ports.items():
        if port.to is not None:
            yield ("scene", "ports", name, "to"), port.to
            if port.stiffness is not None:
                yield ("scene", "ports", name), name


def _check_twice(document: Document, scene: Scene, known: list[str]) -> None:
    for kind, block in (("strings", scene.strings), ("ports", scene.ports)):
        for name in block:
            if known.count(name) > 1:
                document.report(("scene", kind, name), f"another node is already named {name!r}")
    for name in scene.grounds:
        if known.count(name) > 1:
            document.report(("scene", "grounds", name), f"another node is already named {name!r}")


def check_between(document: Document, scene: Scene | Scene3d, name: str) -> None:
    """Report ends of a link that cannot be paired, in one dimension and in space."""
    link = scene.links[name]
    path: KeyPath = ("scene", "links", name, "between")
    one, two = link.between
    sizes = {scene.size_of(one), scene.size_of(two)} - {1}
    if link.chain:
        if one != two or scene.size_of(one) < 2:
            document.report(path, "a chain links one group of masses: name the same group twice")
    elif one == two:
        document.report(path, f"both ends are at {one!r}; for a chain write chain: true")
    elif len(sizes) > 1:
        document.report(
            path,
            f"groups of {scene.size_of(one)} and {scene.size_of(two)} cannot be linked one to one",
        )


def _check_links(document: Document, scene: Scene) -> None:
    for name, link in scene.links.items():
        check_between(document, scene, name)
        one, two = link.between
        fixed = {GROUND, *scene.grounds}
        if one in fixed and two in fixed:
            document.report(("scene", "links", name, "between"), "neither end can move")


def _check_ports(document: Document, parts: Parts, scene: Scene) -> None:
    axes = parts.sides.get("master", {})
    for name, port in scene.ports.items():
        path: KeyPath = ("scene", "ports", name)
        if name not in axes:
            document.report(
                path,
                f"there is no master axis {name!r}{nearest(name, list(axes)) or '.'} "
                f"Axes: {', '.join(axes) or 'none'}",
            )
        _check_spring(document, path, port)
        axis = axes.get(name)
        if axis is not None and axis.causality == "admittance":
            document.report(path, "a scene outputs effort, so its axis must be an impedance axis")
    for name in axes:
        if name not in scene.ports:
            document.report(
                ("master", "axes", name),
                f"not used by the scene; add scene.ports.{name}, or remove it",
            )
    heard = scene.output.port
    if heard is not None and heard not in scene.ports:
        document.report(("scene", "output", "port"), f"there is no port {heard!r}")


def _check_spring(document: Document, path: KeyPath, port: ScenePort) -> None:
    if port.to is not None and port.stiffness is None:
        document.report((*path, "stiffness"), "required key is missing (coupling spring k_c)")
    if port.to is None and (port.stiffness is not None or port.damping > 0.0):
        document.report((*path, "to"), "required key is missing: where the spring ends")


def _check_with_device(document: Document, scene: Scene, curved: list[str]) -> None:
    path: KeyPath = ("scene", "discretise")
    if scene.scheme == "auto":
        document.report(
            path, "with_device needs an explicit scheme, because its parameters depend on it"
        )
    if len(scene.ports) > 1:
        document.report(path, f"with_device is for one port (there are {len(scene.ports)})")
    others = [f"links.{name}" for name in curved] + [f"strings.{name}" for name in scene.strings]
    if others:
        document.report(path, f"with_device is for springs and dampers; {others[0]} is neither")


def _check_scheme(document: Document, parts: Parts, scene: Scene) -> None:
    path: KeyPath = ("scene", "scheme")
    if scene.strings and scene.scheme not in ("auto", "discrete_gradient"):
        document.report(path, f"strings need discrete_gradient (got {scene.scheme})")
    curved = [name for name, link in scene.links.items() if not is_linear(link.type)]
    if scene.scheme == "exact" and curved:
        document.report(
            path, f"exact is for springs and dampers; links.{curved[0]} needs discrete_gradient"
        )
    keeps = [
        (name, link.type)
        for name, link in scene.links.items()
        if not LINK_KINDS[link.type].potential
    ]
    if scene.scheme == "rk4" and keeps:
        name, kind = keeps[0]
        document.report(
            path, f"rk4 does not support {kind} links; links.{name} needs discrete_gradient"
        )
    if scene.discretise == "with_device":
        _check_with_device(document, scene, curved)
    rate = parts.rate_hz
    for name, string in scene.strings.items():
        if rate is not None and string.frequency_hz > rate / 12.0:
            document.report(
                ("scene", "strings", name, "frequency_hz"),
                f"should be at most a 12th of the rate, {rate / 12.0:g} Hz "
                f"(got {string.frequency_hz:g})",
            )
    for bus, block in parts.buses.items():
        if block is not None and block.divisor > 1:
            document.report(("buses", bus, "divisor"), "a scene runs at a single rate; remove it")


def _check_simulation(document: Document, parts: Parts, scene: Scene) -> None:
    for name in parts.environments:
        document.report(("simulation", "environment", name), "a scene has no slave; remove it")
    for name in parts.hands:
        if name not in scene.ports:
            known = list(scene.ports)
            document.report(
                ("simulation", "hand", name),
                f"unknown port {name!r}{nearest(name, known) or '.'} Ports: {', '.join(known)}",
            )
    known_axes = [f"master.{name}" for name in parts.sides.get("master", {})]
    for full in parts.truths:
        if full not in known_axes:
            listed: Any = ", ".join(known_axes)
            document.report(("simulation", "axes", full), f"unknown axis {full!r}. Axes: {listed}")
