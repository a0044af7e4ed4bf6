"""One object of a drive's dictionary as data, and its bytes."""

from __future__ import annotations

import struct
from dataclasses import dataclass, replace

FORMATS = {
    "BOOL": "<?",
    "I8": "<b",
    "U8": "<B",
    "I16": "<h",
    "U16": "<H",
    "I32": "<i",
    "U32": "<I",
    "I64": "<q",
    "U64": "<Q",
}
"""`struct` format of every numeric type, little endian (CiA 301, 7.1.4); `STR` has none."""

_STRUCTS = {name: struct.Struct(text) for name, text in FORMATS.items()}
_AXIS_STRIDE = 0x800  # the objects of axis n of a multi-axis drive lie at 6000h + n * 800h


@dataclass(frozen=True, slots=True)
class Entry:
    """One object: `type` is a key of `FORMATS` or `STR`, `source` the standard it is from."""

    name: str
    index: int
    sub: int
    type: str
    unit: str
    meaning: str
    source: str

    @property
    def bits(self) -> int:
        """Length in a PDO mapping entry [bit]; 0 for a text."""
        return 8 * _STRUCTS[self.type].size if self.type in _STRUCTS else 0

    @property
    def mapping(self) -> int:
        """Value of a PDO mapping entry: index, sub-index, length (CiA 301, 7.5.2.36)."""
        return self.index << 16 | self.sub << 8 | self.bits

    @property
    def address(self) -> str:
        """Index and sub-index as text: `6040:00`."""
        return f"{self.index:04X}:{self.sub:02X}"

    def on_axis(self, axis: int) -> Entry:
        """Return the same object of axis `axis` (0 to 7) of a multi-axis drive (CiA 402-2, 6)."""
        return replace(self, index=self.index + _AXIS_STRIDE * axis)


def limits(kind: str) -> tuple[int, int]:
    """Return the least and the greatest integer of the type `kind`."""
    bits = 8 * _STRUCTS[kind].size
    if kind.startswith("I"):
        return -(1 << (bits - 1)), (1 << (bits - 1)) - 1
    return 0, (1 << bits) - 1


def pack(entry: Entry, value: int) -> bytes:
    """Return the bytes of `value`, saturated to the range of the entry's type."""
    least, greatest = limits(entry.type)
    return _STRUCTS[entry.type].pack(min(max(value, least), greatest))


def unpack(entry: Entry, data: bytes) -> int | str | None:
    """Return the value in `data`; None where there are too few bytes. Bytes never raise.

    More bytes than the type has are allowed: an expedited SDO response need not state its length.
    """
    if entry.type not in _STRUCTS:
        return bytes(data).split(b"\0", 1)[0].decode("ascii", "replace")
    codec = _STRUCTS[entry.type]
    if len(data) < codec.size:
        return None
    return int(codec.unpack_from(data)[0])
