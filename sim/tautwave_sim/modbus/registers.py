"""Registers of a drive: typed values in 16-bit words, with access, ranges and their order."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import NamedTuple

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
DEVICE_FAILURE = 4
DEVICE_BUSY = 6
NO_ANSWER_BEHIND = 11
"""Exception codes (MODBUS Application Protocol Specification V1.1b3, 7)."""

TYPES = {"u16": (1, False), "i16": (1, True), "u32": (2, False), "i32": (2, True)}


TABLES = ("holding", "input")


class Refusal(Exception):
    """A request is refused with an exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code:02X}")
        self.code = code


class Register(NamedTuple):
    """One value: `kind` u16, i16, u32 or i32; `access` r, w or rw; `low` and `high` bound it.

    `eeprom`: a write to it wears the drive's EEPROM if storing is on.
    """

    name: str
    address: int
    kind: str
    low_first: bool = False
    access: str = "rw"
    low: int = 0
    high: int = 0xFFFF
    default: int = 0
    eeprom: bool = False
    table: str = ""
    """holding, input, coil or discrete; '': whichever registers are asked for."""

    @property
    def words(self) -> int:
        """Number of 16-bit words."""
        return TYPES[self.kind][0]

    def encode(self, value: int) -> list[int]:
        """Return the words of a value; one beyond its type is held at its end."""
        low, high = bounds(self.kind)
        raw = min(max(value, low), high) & 0xFFFFFFFF
        if self.words == 1:
            return [raw & 0xFFFF]
        pair = [raw >> 16, raw & 0xFFFF]
        return pair[::-1] if self.low_first else pair

    def decode(self, words: Sequence[int]) -> int:
        """Return the value of words."""
        if self.words == 1:
            raw, sign = words[0], 0x8000
        else:
            high, low = reversed(words) if self.low_first else words
            raw, sign = high << 16 | low, 0x80000000
        return raw - 2 * sign if TYPES[self.kind][1] and raw & sign else raw


def bounds(kind: str) -> tuple[int, int]:
    """Return the least and the greatest value of a type."""
    words, signed = TYPES[kind]
    bits = 16 * words
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)


class RegisterBank:
    """The values of one drive and how requests reach them.

    Parameters
    ----------
    registers : mapping
        By name.
    """

    def __init__(self, registers: Mapping[str, Register]) -> None:
        self.registers = dict(registers)
        self.values = {name: one.default for name, one in registers.items()}
        self.readers: dict[str, Callable[[], int]] = {}
        """Called for a value that is measured or computed."""
        self.gaps_read_zero: Collection[str] = ()
        """Tables whose words between registers read as 0, as in some drives, instead of exception
        2."""
        self.objects = False
        """Whether an address is that of an object, which is read and written as a whole."""
        self.most: Mapping[str, int] = {}
        """Most words that one request reads of a table, where that is less than the standard's."""
        self._at: dict[tuple[str, int], tuple[Register, int]] = {}
        self._objects = {(one.table, one.address): one for one in registers.values()}
        for one in registers.values():
            for word in range(one.words):
                self._at.setdefault((one.table, one.address + word), (one, word))

    def _find(self, table: str, address: int) -> tuple[Register, int] | None:
        return self._at.get((table, address)) or self._at.get(("", address))

    def _object(self, table: str, address: int, words: int) -> Register | None:
        register = self._objects.get((table, address)) or self._objects.get(("", address))
        return register if register is not None and register.words == words else None

    def __contains__(self, name: str) -> bool:
        return name in self.registers

    def addresses(self) -> list[int]:
        """Return every address that holds a word, in order."""
        return sorted({address for _, address in self._at})

    def number(self, name: str) -> int:
        """Return a value as it is now."""
        reader = self.readers.get(name)
        return self.values[name] if reader is None else reader()

    def store(self, name: str, value: int) -> None:
        """Set a value, whatever its access."""
        self.values[name] = value

    def holds(self, name: str, address: int, count: int, table: str = "holding") -> bool:
        """Return whether any word of a register is among these of a table."""
        one = self.registers[name]
        if one.table not in ("", table):
            return False
        if self.objects:
            return one.address == address
        return address < one.address + one.words and one.address < address + count

    def read(self, address: int, count: int, table: str = "holding") -> list[int]:
        """Return words; refuses where there is none, or none to be read."""
        if count > self.most.get(table, 125):
            raise Refusal(ILLEGAL_VALUE)
        if self.objects:
            whole = self._object(table, address, count)
            if whole is None or "r" not in whole.access:
                raise Refusal(ILLEGAL_ADDRESS)
            return whole.encode(self.number(whole.name))
        known: dict[str, list[int]] = {}
        words = []
        for at in range(address, address + count):
            register = self._find(table, at)
            if register is None and table in self.gaps_read_zero and at <= 0xFFFF:
                words.append(0)
                continue
            if register is None or "r" not in register[0].access:
                raise Refusal(ILLEGAL_ADDRESS)
            one, word = register
            if one.name not in known:
                known[one.name] = one.encode(self.number(one.name))
            words.append(known[one.name][word])
        return words

    def check(self, address: int, words: Sequence[int], table: str = "holding") -> dict[str, int]:
        """Return the values that a write sets; refuses a wrong address, access or range.

        A 32-bit value of which one word is written keeps its other word.
        """
        places: list[tuple[Register, int]] = []
        whole = self._object(table, address, len(words)) if self.objects else None
        for at in range(address, address + len(words)):
            place = self._find(table, at) if whole is None else (whole, at - address)
            if place is None or "w" not in place[0].access or (self.objects and whole is None):
                raise Refusal(ILLEGAL_ADDRESS)
            places.append(place)
        pieces: dict[str, list[int]] = {}
        for (one, word), value in zip(places, words, strict=True):
            pieces.setdefault(one.name, one.encode(self.values[one.name]))[word] = value
        fresh = {name: self.registers[name].decode(piece) for name, piece in pieces.items()}
        for name, value in fresh.items():
            if not self.registers[name].low <= value <= self.registers[name].high:
                raise Refusal(ILLEGAL_VALUE)
        return fresh
