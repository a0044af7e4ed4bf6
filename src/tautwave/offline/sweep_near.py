"""Keys that reach no further than their own block: what they change in a rig, and in its tables.

Most of what a sweep varies is a number that nothing else in the file is checked against, and that
one device or one side of the controller is made from. Two points that differ in such keys alone
share everything else, so that only this is made anew. Every other key reaches further: its points
are read, checked and packed as a whole.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from tautwave.config import Rig
from tautwave.config.yaml12 import read_scalar

DEVICE, SIDE, PAIR = "device", "side", "pair"

EXACT_INTEGERS = 2**53
"""Whole numbers below are the same as a float; what is beyond is left to the reader of files."""

_NAME = r"(?P<name>[A-Za-z_][A-Za-z0-9_-]*)"
_SIDE = r"(?P<side>master|slave)"
_REACH: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (r"(?P<field>seed)", ()),  # only what is drawn for the point
    (
        rf"simulation\.environment\.{_NAME}\.(?P<field>stiffness|damping|position|exponent|loss)",
        ((DEVICE, "slave.{name}"),),
    ),
    (
        rf"simulation\.hand\.{_NAME}\.(?P<field>mass|damping|stiffness)",
        ((DEVICE, "master.{name}"),),
    ),
    (
        rf"simulation\.axes\.{_SIDE}\.{_NAME}\."
        r"(?P<field>inertia|damping|coulomb|encoder_quantum|effort_limit)",
        ((DEVICE, "{side}.{name}"),),
    ),
    (
        rf"coupling\.pairs\.{_NAME}\.(?P<field>wave_impedance|stiffness|damping|drift_time_s)",
        ((SIDE, "master.{name}"), (SIDE, "slave.{name}"), (PAIR, "{name}")),
    ),
    (
        rf"coupling\.pairs\.{_NAME}\.wall_{_SIDE}\.(?P<field>stiffness|damping)",
        ((SIDE, "{side}.{name}"),),
    ),
)
_PLAIN = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


class Part(NamedTuple):
    """One record of the packed tables: a device's, a side's or a pair's, and whose."""

    kind: str
    name: str


class Near(NamedTuple):
    """A key that reaches no further than its block, and the parts that are made from it."""

    key: str
    block: tuple[str, ...]
    field: str
    parts: tuple[Part, ...]


def near_key(key: str) -> Near | None:
    """Return what a key reaches, None if that is more than its own block."""
    for pattern, reached in _REACH:
        match = re.fullmatch(pattern, key)
        if match is not None:
            names = match.groupdict()
            words = key.split(".")[:-1]
            if words[:2] == ["simulation", "axes"]:
                words[2:] = [".".join(words[2:])]
            parts = tuple(Part(kind, whose.format(**names)) for kind, whose in reached)
            return Near(key, tuple(words), names["field"], parts)
    return None


def near_keys(keys: Iterable[str]) -> dict[str, Near]:
    """Return those keys of one case that reach no further than their block.

    None does where one is written in quotes, and a key does not that stands in another one.
    """
    listed = list(keys)
    if not all(_PLAIN.fullmatch(key) for key in listed):
        return {}
    found = {}
    for key in listed:
        near = near_key(key)
        others = (other for other in listed if other != key)
        if near and not any(_nested(key, other) for other in others):
            found[key] = near
    return found


def _nested(one: str, other: str) -> bool:
    return f"{one}.".startswith(f"{other}.") or f"{other}.".startswith(f"{one}.")


def read_value(rig: Rig, near: Near, value: Any) -> float | int | None:
    """Return the value of a key as it would stand in a rig that was read with it.

    The block's own model judges it, as it judges the file's. None if it is not right, or is no
    plain number: whoever reads the rig as a whole finds out what there is to say.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if abs(value) >= EXACT_INTEGERS and isinstance(value, int):
        return None
    if value == 0 and math.copysign(1.0, value) < 0.0:
        return None  # equal to another value, but not the same
    read = read_scalar(json.dumps(value))
    if type(read) is not type(value) or read != value:
        return None
    if near.field == "seed":
        return value if isinstance(value, int) else None
    block = block_at(rig, near.block)
    if block is None or near.field not in type(block).model_fields:
        return None
    text = json.dumps({**block.model_dump(mode="json"), near.field: value})
    try:
        found = getattr(type(block).model_validate_json(text, strict=True), near.field)
    except ValidationError:
        return None
    return found if isinstance(found, float) else None


def block_at(rig: Rig, path: tuple[str, ...]) -> BaseModel | None:
    """Return the block of a rig at a path, None if there is none."""
    node: Any = rig
    for word in path:
        node = node.get(word) if isinstance(node, dict) else getattr(node, word, None)
    return node if isinstance(node, BaseModel) else None


def with_values(rig: Rig, values: Mapping[Near, float | int]) -> Rig:
    """Return a rig with other values at near keys, as `read_value` gave them."""
    changed: Any = rig
    blocks: dict[tuple[str, ...], dict[str, float | int]] = {}
    for near, value in values.items():
        blocks.setdefault(near.block, {})[near.field] = value
    for path in sorted(blocks, key=len):  # a pair's own values before those of walls in it
        changed = _replaced(changed, path, blocks[path])
    result: Rig = changed
    return result


def _replaced(node: Any, path: tuple[str, ...], update: Mapping[str, Any]) -> Any:
    if not path:
        return node.model_copy(update=update)
    first, rest = path[0], path[1:]
    if isinstance(node, dict):
        return {**node, first: _replaced(node[first], rest, update)}
    below = _replaced(getattr(node, first), rest, update)
    return node.model_copy(update={first: below})
