"""The keys of a rig file, from the schema that `tautwave check --schema` prints."""

from __future__ import annotations

import ast
import inspect
import json
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from _tools.markdown import table
from tautwave import registry
from tautwave.config import rig_schema

PAGES = Path(__file__).parents[1] / "reference" / "rig"
TITLES = {
    "canopen": "driver `canopen`",
    "dynamixel": "driver `dynamixel`",
    "feetech": "driver `feetech`",
    "mit": "driver `mit`",
}
Node = Mapping[str, Any]


ROOTS = {
    "top": ("",),
    "buses": ("Bus", "loopback", "replay"),
    "axes": (
        "Side",
        "Axis",
        "Inertia",
        "Damping",
        "Coulomb",
        "EffortSensor",
        "Compensation",
        "Load",
        "Follower",
    ),
    "arms": ("Arm", "Chain", "Branch", "Payload"),
    "coupling": ("Account", "Wall", *registry.coupling_names()),
    "link": ("Link",),
    "cameras": ("Camera",),
    "sites": ("Sites",),
    "scene": ("Scene",),
    "scene3d": ("Scene3d",),
    "operate": ("Operate",),
    "calibration": ("Calibration",),
    "loop": ("Loop",),
    "simulation": ("Simulation",),
}
"""Blocks whose keys a page explains, with what only they lead to; a driver or law by its name."""


def keys_pages() -> dict[str, str]:
    """Return the tables of each page of the reference: a section a block, a row a key."""
    schema = rig_schema()
    blocks = schema["$defs"]
    pages = {}
    for page, names in assigned().items():
        parts = []
        for name in names:
            node = blocks[name] if name else schema
            parts += [f"({_anchor(name)})=\n## Keys: {_title(name) or 'top level'}\n"]
            parts += [_first(node, name) if name else "", _rows(node, name, blocks)]
        pages[page] = "\n".join(part for part in parts if part)
    return pages


def assigned() -> dict[str, list[str]]:
    """Return the blocks of each page, in the order in which its keys lead to them."""
    schema = rig_schema()
    blocks = schema["$defs"]
    shown = {name for name in blocks if blocks[name].get("properties") and name != "Coupling"}
    drivers = {f"driver-{name}": (name,) for name in registry.driver_names()}
    drivers = {page: names for page, names in drivers.items() if names[0] not in ROOTS["buses"]}
    roots = ROOTS | drivers
    taken = {name for names in roots.values() for name in names}
    pages = {}
    for page, names in roots.items():
        waiting = [
            block
            for name in names
            for block in ([name] if name in {"", *shown} else sorted(shown, key=_order))
            if block == name or block.startswith(f"{name}.")
        ]
        found: list[str] = []
        while waiting:
            block = waiting.pop(0)
            if block in found:
                continue
            found.append(block)
            node = blocks[block] if block else schema
            for other in _references(node["properties"]):
                if other in shown and other not in taken and "." not in other and block:
                    taken.add(other)
                    waiting.append(other)
        pages[page] = found
    return pages


def _references(node: Any) -> Iterator[str]:
    """Yield the blocks that part of a schema refers to."""
    if isinstance(node, Mapping):
        if "$ref" in node:
            yield node["$ref"].rpartition("/")[2]
        for value in node.values():
            yield from _references(value)
    elif isinstance(node, list):
        for value in node:
            yield from _references(value)


def described() -> Iterator[tuple[str, str, str]]:
    """Yield block, key and description of every key, '' where it is not described."""
    schema = rig_schema()
    for block, node in [("", schema), *schema["$defs"].items()]:
        for key, value in node.get("properties", {}).items():
            yield block, key, _meaning(block, key, value)


def _order(name: str) -> tuple[bool, str]:
    return "." in name, name.lower()


def _title(name: str) -> str:
    owner, dot, block = name.partition(".")
    if not dot:
        return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", owner)
    kind = "driver" if owner in registry.driver_names() else "law"
    return f"`{owner}` ({kind}): {block}"


def _anchor(name: str) -> str:
    return "key-" + name.replace(".", "-").lower()


def _first(node: Node, name: str) -> str:
    text = str(node.get("description", "")).split("\n\n")[0].replace("\n", " ")
    return text + "\n" if text else ""


def _rows(node: Node, name: str, blocks: Node) -> str:
    required = set(node.get("required", ()))
    return table(
        ("key", "takes", "default", "meaning"),
        [
            (
                f"`{key}`",
                _takes(value, blocks),
                "required" if key in required else _default(value),
                _meaning(name, key, value) + _tuning(value),
            )
            for key, value in node["properties"].items()
        ],
    )


def _tuning(value: Node) -> str:
    return f" *Tunable: {value['tuning']}.*" if "tuning" in value else ""


def _default(value: Node) -> str:
    if "default" not in value or value["default"] is None:
        return "–"
    given = value["default"]
    if isinstance(given, dict) and "value" in given:
        given = given["value"]  # a belief may be written as one number
    if given == "":
        return "empty"
    return f"`{given if isinstance(given, str) else json.dumps(given, ensure_ascii=False)}`"


def _takes(value: Node, blocks: Node) -> str:
    if "$ref" in value:
        name = value["$ref"].rpartition("/")[2]
        if blocks[name].get("properties") and name != "Coupling":
            return f"[{_title(name)}](#{_anchor(name)})"
        return "a block"
    if "const" in value:
        return f"`{value['const']}`"
    if "enum" in value:
        return ", ".join(f"`{choice}`" for choice in value["enum"])
    for several in ("anyOf", "oneOf"):
        if several in value:
            found = [_takes(option, blocks) for option in value[several]]
            return " or ".join(dict.fromkeys(text for text in found if text != "nothing"))
    kind = value.get("type")
    if kind == "array":
        if "prefixItems" in value:
            return f"[{', '.join(_takes(item, blocks) for item in value['prefixItems'])}]"
        return f"list of {_takes(value.get('items', {}), blocks)}"
    if kind == "object":
        named = next(iter(value.get("patternProperties", {}).values()), None)
        named = named or value.get("additionalProperties")
        return f"by name: {_takes(named, blocks)}" if isinstance(named, dict) else "a block"
    if kind == "null":
        return "nothing"
    words = {"number": "number", "integer": "whole number", "string": "text", "boolean": "truth"}
    bounds = [
        f"{sign} {value[bound]:g}"
        for bound, sign in (
            ("minimum", "≥"),
            ("exclusiveMinimum", ">"),
            ("maximum", "≤"),
            ("exclusiveMaximum", "<"),
        )
        if bound in value
    ]
    return " ".join([words.get(str(kind), "any value"), *bounds])


def _meaning(block: str, key: str, value: Node) -> str:
    text = value.get("description") or _attribute_docs(block).get(key) or _stated(block).get(key)
    if text is None:
        return ""
    # Schema texts hold no markup: what looks like a link or emphasis is a unit or a product.
    return str(text).replace("\n", " ").replace("*", r"\*").replace("[", r"\[")


@cache
def _attribute_docs(block: str) -> dict[str, str]:
    """Docstrings below the attributes of a driver's model: they cost the driver no import time."""
    owner, dot, name = block.partition(".")
    if not dot or owner not in registry.driver_names():
        return {}
    options = registry.load_driver(owner).options
    model = options if name == "options" else getattr(inspect.getmodule(options), name)
    found: dict[str, str] = {}
    for kind in reversed(model.__mro__):
        if not (issubclass(kind, BaseModel) and kind.__module__.startswith("tautwave")):
            continue
        (body,) = ast.parse(inspect.getsource(kind)).body
        assert isinstance(body, ast.ClassDef)
        for node, below in zip(body.body, body.body[1:], strict=False):
            if isinstance(node, ast.AnnAssign) and isinstance(below, ast.Expr):
                assert isinstance(node.target, ast.Name)
                if isinstance(below.value, ast.Constant) and isinstance(below.value.value, str):
                    found[node.target.id] = inspect.cleandoc(below.value.value)
    return found


@cache
def _stated(block: str) -> dict[str, str]:
    """Meanings of a driver's keys on its page."""
    page = PAGES / f"driver-{block.partition('.')[0]}.md"
    found: dict[str, str] = {}
    for line in page.read_text(encoding="utf-8").splitlines() if page.exists() else ():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == 3:
            for key in re.findall(r"`(\w+)`", cells[0]):
                found.setdefault(key, cells[2].replace(r"\|", "|"))
    return found
