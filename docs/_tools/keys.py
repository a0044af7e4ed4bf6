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

README = Path(__file__).parents[2] / "configs" / "README.md"
TITLES = {
    "canopen": "driver `canopen`",
    "dynamixel": "driver `dynamixel`",
    "feetech": "driver `feetech`",
    "mit": "driver `mit`",
}
Node = Mapping[str, Any]


def keys_page() -> str:
    """Return the page: one section a block, one row a key."""
    schema = rig_schema()
    blocks = schema["$defs"]
    parts = [
        "# Rig keys\n",
        "Made from the schema at the build: `tautwave check --schema` prints the same for an"
        " editor. [Rig files](../rig-file.md) explains them in context; units that follow the axis"
        " are written `rotary | linear`.\n",
        "## Top level\n",
        _rows(schema, "", blocks),
    ]
    for name in sorted(blocks, key=_order):
        if not blocks[name].get("properties") or name == "Coupling":
            continue
        parts += [f"({_anchor(name)})=\n## {_title(name)}\n", _first(blocks[name], name)]
        parts.append(_rows(blocks[name], name, blocks))
    return "\n".join(parts)


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
    text = value.get("description") or _attribute_docs(block).get(key) or _readme(block).get(key)
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
def _readme(block: str) -> dict[str, str]:
    """Meanings of a driver's keys in configs/README.md."""
    owner = block.partition(".")[0]
    text = README.read_text(encoding="utf-8")
    section = re.search(rf"^#### `driver: {owner}`.*?(?=^###? |^#### )", text, re.M | re.S)
    found: dict[str, str] = {}
    for line in section[0].splitlines() if section else ():
        cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
        if len(cells) == 3:
            for key in re.findall(r"`(\w+)`", cells[0]):
                found.setdefault(key, cells[2].replace(r"\|", "|"))
    return found
