"""From the recording's column names to a ROS 2 message definition.

Foxglove, PlotJuggler (its ROS parser), rerun and `ros2 bag` read it. Dots become nested
messages, so `master.wrist.position` shows as a tree. All fields are float64: the CDR
encoding of such a message, nested or not, is its floats in a row after a header of four bytes,
which is exactly a row of the ring.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

PACKAGE = "tautwave"
MESSAGE = "Cycle"
SCHEMA_NAME = f"{PACKAGE}/msg/{MESSAGE}"
TOPIC = "/tautwave/cycle"
CDR_HEADER = b"\x00\x01\x00\x00"  # little-endian XCDR1, no options (DDS-XTypes 1.3, 7.6.3.1.2)

_DEEPEST = 8
# `true` is a legal ROS field name but a literal in Foxglove's message paths and in C++.
_RENAMED = {"true": "truth", "false": "untruth"}


class MessageLayout(NamedTuple):
    """`definition` is ros2msg text; field k of the message is column `order[k]` of the row.

    `fields` are the paths a viewer shows, in the order of the message.
    """

    definition: str
    order: tuple[int, ...]
    fields: tuple[str, ...]


class _Group:
    """A message under construction: its fields by name, columns or groups."""

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self.fields: dict[str, int | _Group] = {}
        self.groups: dict[str, _Group] = {}


def message_layout(columns: Sequence[str]) -> MessageLayout:
    """Nested definitions for dotted column names.

    Names that ROS does not allow are made legal (lower case, `[a-z][a-z0-9_]*`) and unique; the
    original names are in the file's metadata.
    """
    used_types = {MESSAGE, "Time", "Duration"}
    root = _Group(MESSAGE)
    for index, column in enumerate(columns):
        *path, leaf = column.split(".", _DEEPEST)
        group = root
        for part in path:
            if part not in group.groups:
                prefix = "" if group is root else group.type_name
                new = _Group(_unique(prefix + _camel_case(part), used_types))
                used_types.add(new.type_name)
                group.fields[_unique(_field_name(part), group.fields, "_")] = new
                group.groups[part] = new
            group = group.groups[part]
        group.fields[_unique(_field_name(leaf), group.fields, "_")] = index
    texts: list[str] = []
    order: list[int] = []
    fields: list[str] = []
    _walk(root, "", texts, order, fields)
    return MessageLayout("".join(texts), tuple(order), tuple(fields))


def _walk(group: _Group, path: str, texts: list[str], order: list[int], fields: list[str]) -> None:
    lines = []
    if group.type_name != MESSAGE:
        lines += ["=" * 80, f"MSG: {PACKAGE}/{group.type_name}"]
    position = len(texts)
    texts.append("")
    for name, field in group.fields.items():
        if isinstance(field, int):
            lines.append(f"float64 {name}")
            order.append(field)
            fields.append(path + name)
        else:
            lines.append(f"{PACKAGE}/{field.type_name} {name}")
            _walk(field, f"{path}{name}.", texts, order, fields)
    texts[position] = "\n".join(lines) + "\n"


def _field_name(part: str) -> str:
    name = re.sub(r"[^a-z0-9]+", "_", part.lower()).strip("_")
    if not name or not name[0].isalpha():
        name = f"x_{name}".rstrip("_")
    return _RENAMED.get(name, name)


def _camel_case(part: str) -> str:
    return "".join(word.capitalize() for word in _field_name(part).split("_"))


def _unique(name: str, taken: set[str] | dict[str, int | _Group], joint: str = "") -> str:
    candidate, number = name, 2
    while candidate in taken:
        candidate = f"{name}{joint}{number}"
        number += 1
    return candidate
