"""URDF files as trees of nodes with lines: numbers, vectors and bodies, or one clear sentence.

Parsed by expat itself, which knows line numbers; a file that declares a document type is refused
before any entity is expanded. Units are URDF's: SI.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.parsers import expat

from tautwave.config.guard import read_guarded
from tautwave.errors import ConfigError
from tautwave.models.chain.build import Body, Matrix, Vector, is_inertia, placed, roll_pitch_yaw

MAX_FILE = 1 << 24  # bytes
DEEPEST = 32
LEFT_BY_XACRO = ("xacro:property", "xacro:arg", "xacro:macro")
"""Definitions, which files keep that need none of them any more."""
UNEXPANDED = "is xacro's, not URDF: `xacro FILE -o arm.urdf` makes URDF of it"


class Node:
    """An element: its name, line, attributes and children."""

    def __init__(self, tag: str, line: int, given: Mapping[str, str]) -> None:
        self.tag, self.line, self.given = tag, line, given
        self.children: list[Node] = []

    def all(self, tag: str) -> list[Node]:
        """Return the children of a name."""
        return [child for child in self.children if child.tag == tag]


class UrdfReader:
    """Reads one file; every sentence of its begins with file and line."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def wrong(self, line: int, text: str) -> ConfigError:
        """Return the error for a line."""
        return ConfigError(f"{self.path}:{line}: {text}")

    def tree(self) -> Node:
        """Return the `<robot>` of the file."""
        text = read_guarded(self.path, "URDF file", MAX_FILE)
        parser = expat.ParserCreate()
        top = Node("", 0, {})
        open_nodes = [top]

        def start(tag: str, given: dict[str, str]) -> None:
            node = Node(tag, parser.CurrentLineNumber, given)
            if len(open_nodes) > DEEPEST:
                raise self.wrong(node.line, f"nested deeper than {DEEPEST} levels")
            open_nodes[-1].children.append(node)
            open_nodes.append(node)

        def doctype(*_: Any) -> None:
            raise self.wrong(
                parser.CurrentLineNumber,
                "declares a document type, which URDF does not have; remove it",
            )

        parser.StartElementHandler = start
        parser.EndElementHandler = lambda _: open_nodes.pop()
        parser.StartDoctypeDeclHandler = doctype
        try:
            parser.Parse(text, True)
        except expat.ExpatError as err:
            words = expat.ErrorString(err.code)
            raise self.wrong(err.lineno, f"is not XML: {words}") from err
        robots = top.all("robot")
        if not robots:
            raise self.wrong(1, "has no <robot>; a URDF file is required (run xacro first)")
        self._expanded(robots[0])
        return robots[0]

    def _expanded(self, robot: Node) -> None:
        """Refuse what xacro has yet to expand; what it leaves behind, and meshes, say nothing."""
        for node in robot.children:
            if node.tag.startswith("xacro:") and node.tag not in LEFT_BY_XACRO:
                raise self.wrong(node.line, f"<{node.tag}> {UNEXPANDED}")
            name = node.given.get("name", "")
            if node.tag in ("link", "joint") and _unexpanded(name):
                raise self.wrong(node.line, f"{node.tag} {name!r} {UNEXPANDED}")

    def one(self, node: Node, tag: str) -> Node | None:
        """Return the only child of a name, None without one."""
        children = node.all(tag)
        if len(children) > 1:
            raise self.wrong(children[1].line, f"a second <{tag}> in <{node.tag}>")
        return children[0] if children else None

    def word(self, node: Node, key: str) -> str:
        """Return an attribute."""
        if key not in node.given:
            raise self.wrong(node.line, f"<{node.tag}> has no {key}")
        return node.given[key]

    def number(self, node: Node, key: str, otherwise: float | None = None) -> float:
        """Return an attribute that is one finite number."""
        if key not in node.given and otherwise is not None:
            return otherwise
        return self.numbers(node, key, 1)[0]

    def bound(self, node: Node, key: str, otherwise: float) -> float:
        """Return an attribute that is one number, or infinite."""
        text = node.given.get(key, "").strip().lower()
        if text.lstrip("+-") in ("inf", "infinity"):
            return float(text)
        return self.number(node, key, otherwise)

    def numbers(self, node: Node, key: str, count: int) -> list[float]:
        """Return an attribute of finite numbers."""
        text = self.word(node, key)
        if _unexpanded(text):
            raise self.wrong(node.line, f"{key} of <{node.tag}>, {text!r}, {UNEXPANDED}")
        try:
            numbers = [] if "_" in text else [float(part) for part in text.split()]
        except ValueError:
            numbers = []
        if len(numbers) != count or not all(math.isfinite(value) for value in numbers):
            wanted = "a finite number" if count == 1 else f"{count} finite numbers"
            raise self.wrong(node.line, f"{key} of <{node.tag}> should be {wanted} (got {text!r})")
        return numbers

    def vector(self, node: Node | None, key: str, otherwise: Vector) -> Vector:
        """Return an attribute of three numbers."""
        if node is None or key not in node.given:
            return otherwise
        x, y, z = self.numbers(node, key, 3)
        return x, y, z

    def origin(self, node: Node) -> tuple[Vector, Matrix]:
        """Return place [m] and rotation of a node's `<origin>`."""
        at = self.one(node, "origin")
        zero = (0.0, 0.0, 0.0)
        return self.vector(at, "xyz", zero), roll_pitch_yaw(*self.vector(at, "rpy", zero))

    def body(self, link: Node, notes: list[str] | None = None) -> Body:
        """Return the body of a `<link>`, massless without `<inertial>`.

        What is impossible is refused, or left out where `notes` gets a sentence on it: first the
        inertia, then the mass.
        """
        try:
            return self._body(link)
        except ConfigError as err:
            if notes is None:
                raise
            wrong = str(err)
        try:
            body, taken = self._body(link, point=True), "a point at its centre of mass"
        except ConfigError:
            body, taken = Body(), "massless"
        notes.append(f"{wrong}; it is beside the chain and taken as {taken}")
        return body

    def _body(self, link: Node, *, point: bool = False) -> Body:
        inertial = self.one(link, "inertial")
        if inertial is None:
            return Body()
        mass, inertia = self.one(inertial, "mass"), self.one(inertial, "inertia")
        name = link.given.get("name", "")
        if mass is None:
            raise self.wrong(inertial.line, f"link {name!r}: <inertial> has no <mass>")
        m = self.number(mass, "value")
        if m < 0.0:
            raise self.wrong(mass.line, f"link {name!r}: its mass is negative (got {m:g})")
        about: tuple[float, ...] = (0.0,) * 6
        if inertia is not None and not point:
            keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
            about = tuple(self.number(inertia, key, 0.0) for key in keys)
            if not is_inertia(*about):
                raise self.wrong(
                    inertia.line, f"link {name!r}: not physically possible for a rigid body"
                )
        xx, yy, zz, xy, xz, yz = about
        place, turn = self.origin(inertial)
        matrix = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        return placed(Body(m, inertia=matrix), turn, place)

    def by_name(self, nodes: Sequence[Node]) -> dict[str, Node]:
        """Return nodes by their names, which have to differ."""
        named: dict[str, Node] = {}
        for node in nodes:
            name = self.word(node, "name")
            if name in named:
                first = named[name].line
                raise self.wrong(node.line, f"a second {node.tag} {name!r} (line {first})")
            named[name] = node
        return named


def _unexpanded(text: str) -> bool:
    return "${" in text or "$(" in text
