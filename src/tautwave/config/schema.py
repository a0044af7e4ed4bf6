"""JSON Schema of a rig file, for editors: completion, hover texts, and red lines while typing."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter

from tautwave import registry
from tautwave.config.hooks import config_hooks
from tautwave.config.keys.chosen import part_keys
from tautwave.config.keys.common import AUTO, Block
from tautwave.config.keys.control import SCENE, ControlKeys
from tautwave.config.keys.coupling import STANDARD_LAW, law_blocks
from tautwave.config.keys.rig import Rig
from tautwave.config.keys.simulation import EnvironmentPart, HandPart
from tautwave.errors import ConfigError


def rig_schema() -> dict[str, Any]:
    """Return the JSON Schema (2020-12) of a rig file.

    The options of every installed driver that loads are part of it. Cross-checks between keys (done
    by `load_rig`) are not.
    """
    schema = Rig.model_json_schema()
    definitions = schema["$defs"]
    for key in ("damping", "coulomb"):
        belief = definitions["Axis"]["properties"][key]
        reference = belief.pop("$ref", None) or belief.pop("allOf")[0]["$ref"]
        belief["anyOf"] = [{"type": "number", "minimum": 0}, {"$ref": reference}]
    _add_scene(schema)
    _add_drivers(definitions)
    _add_laws(definitions)
    for base in (HandPart, EnvironmentPart):
        _add_parts(definitions, base)
    _close_names(schema)
    _add_axis_defaults(schema)
    schema["required"].remove("duration_s")
    operated = {"required": ["operate"]}
    schema["allOf"].append({"if": {"not": operated}, "then": {"required": ["duration_s"]}})
    schema["anyOf"] = [
        {
            "required": ["scene"],
            "not": {"anyOf": [{"required": [k]} for k in ("slave", "coupling")]},
        },
        {"required": ["slave", "coupling"]},
    ]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **schema,
        "title": "tautwave rig",
    }


def _add_axis_defaults(schema: dict[str, Any]) -> None:
    """Let sides and buses hold keys of their axes, which are then not required in each of them."""
    definitions = schema["$defs"]
    axis = definitions["Axis"]
    required, axis["required"] = axis["required"], ["id"]
    for owner in ("Side", "Bus"):
        _partial(definitions[owner]["properties"]["defaults"], axis)
    none = {"not": {"required": ["defaults"]}}
    each = {"properties": {"axes": {"additionalProperties": {"required": required}}}}
    schema["allOf"] = [
        {
            "if": {"properties": {side: none, "buses": {"additionalProperties": none}}},
            "then": {"properties": {side: each}},
        }
        for side in ("master", "slave")
    ]


def _partial(defaults: dict[str, Any], block: dict[str, Any]) -> None:
    """Turn a free mapping into one of some keys of a block."""
    defaults.update(properties=block["properties"], additionalProperties=False)


def _close_names(node: Any) -> None:
    """Refuse names that do not match where names have a pattern."""
    for value in node.values() if isinstance(node, dict) else node:
        if isinstance(value, dict | list):
            _close_names(value)
    if isinstance(node, dict) and "patternProperties" in node:
        node.setdefault("additionalProperties", False)


def _add_scene(schema: dict[str, Any]) -> None:
    """Put the keys of the package in place of the block without keys, if it is installed."""
    definitions = schema["$defs"]
    bare = definitions.pop(ControlKeys.__name__)
    try:
        keys = TypeAdapter(config_hooks().blocks()).json_schema()
    except ConfigError:
        keys = {"type": "object", "description": bare["description"]}
    known = {**definitions, **keys.pop("$defs", {})}
    definitions.clear()
    definitions.update(sorted(known.items()))
    key = schema["properties"][SCENE]
    key["title"] = SCENE.title()
    key["anyOf"][0] = keys


def _add_laws(definitions: dict[str, Any]) -> None:
    """Tie the keys of `coupling` and its pairs to the law."""
    blocks = law_blocks()
    shared = definitions.pop("Coupling")
    definitions.pop("Pair")
    law = {**shared["properties"]["law"], "enum": [AUTO, *blocks]}
    cases = []
    for name, block in blocks.items():
        keys = block.model_json_schema(ref_template=f"#/$defs/{name}.{{model}}")
        for inner, definition in keys.pop("$defs", {}).items():
            definitions[f"{name}.{inner}"] = definition
        definitions[f"{name}.coupling"] = keys
        _add_pair_defaults(keys, definitions)
        named: dict[str, Any] = {"properties": {"law": {"const": name}}}
        if name == STANDARD_LAW:  # the keys that a rig may have beside `auto`
            keys["properties"]["law"] = {**law, "enum": [AUTO, name]}
            named = {"properties": {"law": {"enum": [AUTO, name]}}}
        if name != law["default"]:
            named["required"] = ["law"]
        cases.append({"if": named, "then": {"$ref": f"#/$defs/{name}.coupling"}})
    definitions["Coupling"] = {
        "description": shared["description"],
        "title": "Coupling",
        "type": "object",
        "properties": {
            "law": law,
            "pairs": {
                "type": "object",
                "description": shared["properties"]["pairs"]["description"],
            },
        },
        "required": ["pairs"],
        "allOf": cases,
    }


def _add_pair_defaults(coupling: dict[str, Any], definitions: dict[str, Any]) -> None:
    pairs = coupling["properties"]["pairs"]
    (reference,) = pairs.get("patternProperties", {"": pairs.get("additionalProperties")}).values()
    pair = definitions[reference["$ref"].rpartition("/")[2]]
    _partial(coupling["properties"]["defaults"], pair)
    each = {"required": pair.pop("required", [])}
    coupling["if"] = {"not": {"required": ["defaults"]}}
    coupling["then"] = {"properties": {"pairs": {"additionalProperties": each}}}


def _add_parts(definitions: dict[str, Any], base: type[Block]) -> None:
    """Replace the base of a kind of parts by the keys of the installed ones, and of any file."""
    file: dict[str, Any] = {
        "type": "object",
        "description": definitions[base.__name__]["description"],
        "properties": {"part": {"type": "string", "pattern": r"\.py$"}},
        "required": ["part"],
    }
    cases = [file]
    for name in registry.part_names(base.part_group):
        try:
            block = part_keys(base, name)
        except ConfigError:
            continue  # an editor still helps with the others
        keys = block.model_json_schema(ref_template=f"#/$defs/{name}.{{model}}")
        for inner, definition in keys.pop("$defs", {}).items():
            definitions[f"{name}.{inner}"] = definition
        keys["properties"]["part"] = {**keys["properties"]["part"], "const": name}
        definitions[f"{name}.part"] = keys
        cases.append({"$ref": f"#/$defs/{name}.part"})
    definitions[base.__name__] = {"anyOf": cases}


def _add_drivers(definitions: dict[str, Any]) -> None:
    """Tie the options of a bus to its driver."""
    bus = definitions["Bus"]
    names = registry.driver_names()
    bus["properties"]["driver"]["examples"] = names
    cases = []
    for name in names:
        try:
            plugin = registry.load_driver(name)
        except ConfigError:
            continue  # an editor still helps with the other drivers
        options = plugin.options.model_json_schema(
            ref_template=f"#/$defs/{name}.{{model}}", by_alias=True
        )
        for inner, definition in options.pop("$defs", {}).items():
            definitions[f"{name}.{inner}"] = definition
        required = ["options"] if options.get("required") else []
        definitions[f"{name}.options"] = options
        cases.append(
            {
                "if": {"properties": {"driver": {"const": name}}},
                "then": {
                    "properties": {"options": {"$ref": f"#/$defs/{name}.options"}},
                    "required": required,
                },
            }
        )
    if cases:
        bus["allOf"] = cases
