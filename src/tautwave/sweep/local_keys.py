"""Local keys: rig keys that affect only their own block, and the packed records made from them.

Most keys that a sweep varies are numbers with no cross-checks, which determine one device or one
axis of the controller. Points that differ in local keys only share everything else, so only those
records are rebuilt. Points that differ in any other key are read, checked and packed as a whole.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from pydantic import BaseModel, ValidationError

from tautwave.config import Intent, Rig
from tautwave.config.text.yaml12 import read_scalar

DEVICE, AXIS, PAIR = "device", "axis", "pair"

EXACT_INTEGERS = 2**53
"""Integers below convert to float exactly; larger ones are left to the file reader."""

_NAME = r"(?P<name>[A-Za-z_][A-Za-z0-9_-]*)"
_SIDE = r"(?P<side>master|slave)"
_REACH: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    (r"(?P<field>seed)", ()),  # only the point's random draws
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
        rf"coupling\.pairs\.{_NAME}\.(?P<field>wave_impedance|stiffness|damping)",
        ((AXIS, "master.{name}"), (AXIS, "slave.{name}"), (PAIR, "{name}")),
    ),
    (
        rf"coupling\.pairs\.{_NAME}\.wall_{_SIDE}\.(?P<field>stiffness|damping)",
        ((AXIS, "{side}.{name}"),),
    ),
)
_PLAIN = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


class Part(NamedTuple):
    """One record of the packed tables: of a device, an axis or a pair, and its owner."""

    kind: str
    name: str


class LocalKey(NamedTuple):
    """A key that affects only its block, and the packed records made from it."""

    key: str
    block: tuple[str, ...]
    field: str
    parts: tuple[Part, ...]


def local_key(key: str) -> LocalKey | None:
    """Return a key with the records it affects; None if it affects more than its own block."""
    for pattern, reached in _REACH:
        match = re.fullmatch(pattern, key)
        if match is not None:
            names = match.groupdict()
            path = key.split(".")[:-1]
            if path[:2] == ["simulation", "axes"]:
                path[2:] = [".".join(path[2:])]
            parts = tuple(Part(kind, whose.format(**names)) for kind, whose in reached)
            return LocalKey(key, tuple(path), names["field"], parts)
    return None


def local_keys(keys: Iterable[str]) -> dict[str, LocalKey]:
    """Return the local keys among those of one case.

    There are none if any key is quoted; a key nested in another one is not local.
    """
    listed = list(keys)
    if not all(_PLAIN.fullmatch(key) for key in listed):
        return {}
    by_key = {}
    for key in listed:
        local = local_key(key)
        others = (other for other in listed if other != key)
        if local and not any(_nested(key, other) for other in others):
            by_key[key] = local
    return by_key


def _nested(one: str, other: str) -> bool:
    return f"{one}.".startswith(f"{other}.") or f"{other}.".startswith(f"{one}.")


def read_value(rig: Rig, local: LocalKey, value: Any) -> float | int | None:
    """Return the value of a key as it would be in a rig read with it.

    The block's model validates it, as for the file. None if it is invalid or not a plain number:
    reading the whole rig then reports the error.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    if abs(value) >= EXACT_INTEGERS and isinstance(value, int):
        return None
    if value == 0 and math.copysign(1.0, value) < 0.0:
        return None  # equal to another value, but of another type
    read = read_scalar(json.dumps(value))
    if type(read) is not type(value) or read != value:
        return None
    if local.field == "seed":
        return value if isinstance(value, int) else None
    block = block_at(rig, local.block)
    if block is None or local.field not in type(block).model_fields:
        return None
    if isinstance(getattr(block, "reference", None), Intent):
        return None  # what was wanted depends on the grip
    text = json.dumps({**block.model_dump(mode="json"), local.field: value})
    try:
        validated = getattr(type(block).model_validate_json(text, strict=True), local.field)
    except ValidationError:
        return None
    return validated if isinstance(validated, float) else None


def block_at(rig: Rig, path: tuple[str, ...]) -> BaseModel | None:
    """Return the block of a rig at a path, None if there is none."""
    node: Any = rig
    for word in path:
        node = node.get(word) if isinstance(node, dict) else getattr(node, word, None)
    return node if isinstance(node, BaseModel) else None


def with_values(rig: Rig, values: Mapping[LocalKey, float | int]) -> Rig:
    """Return a rig with new values, as returned by `read_value`, at local keys."""
    changed: Any = rig
    blocks: dict[tuple[str, ...], dict[str, float | int]] = {}
    for local, value in values.items():
        blocks.setdefault(local.block, {})[local.field] = value
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
