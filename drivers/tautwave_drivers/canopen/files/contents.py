"""What an EDS or DCF describes, for a simulator of the drive."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import DescribedObject
from tautwave_drivers.canopen.files.reading import FileObject, read_device_file
from tautwave_drivers.canopen.files.values import (
    BOOLEAN,
    REAL32,
    REAL64,
    SIGNED,
    TEXTS,
    UNSIGNED,
    UnreadableError,
    encode,
)


def contents(path: str, node_id: int) -> Sequence[DescribedObject]:
    """Return all objects of a file, with their defaults for a node.

    Raises
    ------
    ConfigError
        It cannot be read, or is no such file.
    """
    file = read_device_file(path)
    return [
        DescribedObject(
            one.index, one.sub, _kind(one.kind), _access(one.access), _default(one, node_id),
            one.mappable,
        )
        for one in file.objects.values()
    ]  # fmt: skip


def _kind(kind: int | None) -> str:
    if kind in SIGNED:
        return f"I{SIGNED[kind]}"
    if kind in UNSIGNED:
        return f"U{UNSIGNED[kind]}"
    if kind == BOOLEAN:
        return "U8"  # one byte by SDO
    return "REAL" if kind in (REAL32, REAL64) else "STR"


def _access(access: str) -> str:
    return access if access in ("ro", "wo", "const") else "rw"


def _default(one: FileObject, node_id: int) -> int | bytes | None:
    if not one.default:
        return None
    try:
        data = encode(one.default, one.kind, node_id)
    except UnreadableError:  # of a field that is not used
        return None
    if one.kind in TEXTS or one.kind in (REAL32, REAL64):
        return data
    return int.from_bytes(data, "little", signed=one.kind in SIGNED)
