"""An object dictionary: typed values with access rights, and the abort codes of a wrong access.

Source of types, access and abort codes: CiA 301 v4.2.0, 7.4 and 7.2.4.3.17.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

TOGGLE = 0x05030000
COMMAND = 0x05040001
WRITE_ONLY = 0x06010001
READ_ONLY = 0x06010002
COUNT_FIRST = 0x06010003
NO_OBJECT = 0x06020000
NOT_MAPPABLE = 0x06040041
MAPPING_TOO_LONG = 0x06040042
TOO_LONG = 0x06070012
TOO_SHORT = 0x06070013
NO_SUBINDEX = 0x06090011
WRONG_VALUE = 0x06090030
TOO_HIGH = 0x06090031
TOO_LOW = 0x06090032
NOT_STORED = 0x08000020
WRONG_STATE = 0x08000022

SIZES = {"U8": 1, "U16": 2, "U32": 4, "I8": 1, "I16": 2, "I32": 4}
Value = int | bytes


class SdoAbort(Exception):
    """An access is refused, for the reason `code`."""

    def __init__(self, code: int) -> None:
        super().__init__(f"{code:08X}")
        self.code = code


class Entry(NamedTuple):
    """One object: `kind` U8 to I32 or STR, `access` ro, wo, rw or const, and where it may go.

    `pdo` holds `r` where a RPDO, `t` where a TPDO may carry it; `low` and `high` bound its value.
    """

    kind: str
    access: str
    default: Value
    pdo: str = ""
    low: int | None = None
    high: int | None = None

    @property
    def size(self) -> int:
        """Bytes of the value; 0 where that depends."""
        return SIZES.get(self.kind, 0)

    def bounds(self) -> tuple[int, int]:
        """Return the least and the greatest value of its type."""
        bits = 8 * self.size
        if self.kind.startswith("I"):
            return -(1 << bits - 1), (1 << bits - 1) - 1
        return 0, (1 << bits) - 1

    def encode(self, value: Value) -> bytes:
        """Return the bytes of a value; a number beyond its type is held at its end."""
        if isinstance(value, bytes):
            return value
        low, high = self.bounds()
        held = min(max(value, low), high)
        return held.to_bytes(self.size, "little", signed=low < 0)

    def decode(self, data: bytes) -> Value:
        """Return the value of bytes as long as the type."""
        if self.size == 0:
            return data
        return int.from_bytes(data, "little", signed=self.kind.startswith("I"))


class ObjectDictionary:
    """Values by index and sub-index, with callbacks on reading and writing."""

    def __init__(self) -> None:
        self.entries: dict[int, dict[int, Entry]] = {}
        self.values: dict[tuple[int, int], Value] = {}
        self.readers: dict[tuple[int, int], Callable[[], int]] = {}
        """Called for a value that is measured or computed."""
        self.writers: dict[tuple[int, int], Callable[[int], None]] = {}
        """Called with a value before it is stored; refuses with `SdoAbort`."""
        self.refusals: dict[tuple[int, int], int] = {}
        """Abort codes of a drive that has its own idea of what is missing."""
        self._saved: dict[tuple[int, int], Value] = {}

    def add(self, index: int, sub: int, entry: Entry) -> None:
        """Add an object, at its default."""
        self.entries.setdefault(index, {})[sub] = entry
        self.values[index, sub] = entry.default

    def remove(self, index: int, sub: int | None = None) -> None:
        """Remove an object, or one of its sub-indices."""
        subs = list(self.entries.get(index, ())) if sub is None else [sub]
        for each in subs:
            self.entries[index].pop(each, None)
            self.values.pop((index, each), None)
        if not self.entries.get(index):
            self.entries.pop(index, None)

    def restore(self, first: int = 0, last: int = 0xFFFF) -> None:
        """Set all objects from index `first` to `last` to what was saved, or their defaults."""
        for index, subs in self.entries.items():
            if first <= index <= last:
                for sub, entry in subs.items():
                    self.values[index, sub] = self._saved.get((index, sub), entry.default)

    def save(self, but: tuple[int, ...]) -> None:
        """Keep all writable values for the next `restore`, `but` for some objects."""
        self._saved = {
            (index, sub): value
            for (index, sub), value in self.values.items()
            if index not in but and self.entries[index][sub].access == "rw"
        }

    def forget(self) -> None:
        """Let the next `restore` bring the defaults back."""
        self._saved.clear()

    def entry(self, index: int, sub: int) -> Entry:
        """Return an object, or refuse if there is none."""
        if (index, sub) in self.refusals:
            raise SdoAbort(self.refusals[index, sub])
        subs = self.entries.get(index)
        if subs is None:
            raise SdoAbort(NO_OBJECT)
        if sub not in subs:
            raise SdoAbort(NO_SUBINDEX)
        return subs[sub]

    def __contains__(self, at: tuple[int, int]) -> bool:
        return at in self.values

    def number(self, index: int, sub: int = 0) -> int:
        """Return a value that is a number, as it is stored or measured; 0 where there is none."""
        reader = self.readers.get((index, sub))
        if reader is not None:
            return reader()
        value = self.values.get((index, sub), 0)
        return value if isinstance(value, int) else 0

    def set(self, index: int, sub: int, value: Value) -> None:
        """Store a value, whatever its access; unknown objects are left out."""
        if (index, sub) in self.values:
            self.values[index, sub] = value

    def upload(self, index: int, sub: int) -> bytes:
        """Return the bytes that a client reads."""
        entry = self.entry(index, sub)
        if entry.access == "wo":
            raise SdoAbort(WRITE_ONLY)
        if entry.size:
            return entry.encode(self.number(index, sub))
        return entry.encode(self.values[index, sub])

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Take the bytes that a client writes."""
        entry = self.entry(index, sub)
        if entry.access in ("ro", "const"):
            raise SdoAbort(READ_ONLY)
        if entry.size and len(data) != entry.size:
            raise SdoAbort(TOO_LONG if len(data) > entry.size else TOO_SHORT)
        self.write(index, sub, entry, entry.decode(data))

    def write(self, index: int, sub: int, entry: Entry, value: Value) -> None:
        """Check a value, call its callback, and store it."""
        if isinstance(value, int):
            if entry.high is not None and value > entry.high:
                raise SdoAbort(TOO_HIGH)
            if entry.low is not None and value < entry.low:
                raise SdoAbort(TOO_LOW)
            writer = self.writers.get((index, sub))
            if writer is not None:
                writer(value)
        self.values[index, sub] = value
