"""Values of a drive as Modbus carries them: 16-bit words, two of them for 32 bits, in either order.

Source: MODBUS Application Protocol Specification V1.1b3, 4.2 (big-endian words); the order of the
two words of a 32-bit value is the drive's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from struct import Struct
from typing import NamedTuple

KINDS = {"u16": (1, False), "i16": (1, True), "u32": (2, False), "i32": (2, True)}
"""Words and sign of each type."""


_FORMATS = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i"}


def bounds(kind: str) -> tuple[int, int]:
    """Return the least and the greatest value of a type."""
    words, signed = KINDS[kind]
    bits = 16 * words
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)


def to_words(value: int, kind: str, low_first: bool = False) -> tuple[int, ...]:
    """Return the words of a value; one beyond its type is held at its end."""
    low, high = bounds(kind)
    raw = min(max(value, low), high)
    if KINDS[kind][0] == 1:
        return (raw & 0xFFFF,)
    pair = (raw >> 16 & 0xFFFF, raw & 0xFFFF)
    return pair[::-1] if low_first else pair


def from_words(words: Sequence[int], kind: str, low_first: bool = False) -> int:
    """Return the value of as many words as its type has."""
    count, signed = KINDS[kind]
    if count == 1:
        raw, sign = words[0], 0x8000
    else:
        high, low = (words[1], words[0]) if low_first else (words[0], words[1])
        raw, sign = high << 16 | low, 0x80000000
    return raw - 2 * sign if signed and raw & sign else raw


class Place(NamedTuple):
    """Where a value is in the words of a response: `at` the first, from the block's start."""

    at: int
    kind: str
    low_first: bool

    def reader(self) -> Callable[[bytes], int]:
        """Return a function from a response's PDU to the value."""
        at = 2 + 2 * self.at
        if KINDS[self.kind][0] == 2 and self.low_first:
            swapped = Struct(">HH").unpack_from
            kind = self.kind
            return lambda pdu: from_words(swapped(pdu, at), kind, True)
        plain = Struct(_FORMATS[self.kind]).unpack_from
        return lambda pdu: int(plain(pdu, at)[0])


class Block(NamedTuple):
    """Adjacent registers of a table that are read at once."""

    address: int
    words: int
    names: tuple[str, ...]
    table: str = "holding"


def blocks_of(
    wanted: Sequence[tuple[str, int, int]],
    readable: frozenset[int],
    gaps: bool,
    bridge: int,
    most: int = 125,
) -> list[Block]:
    """Return the fewest blocks that hold all wanted registers.

    Parameters
    ----------
    wanted : sequence of (name, address, words)
        What is to be read.
    readable : frozenset of int
        Addresses that the drive is known to have.
    gaps : bool
        Whether any address in between can be read.
    bridge : int
        Most words read in vain to save a request.
    most : int
        Most words that one request reads.
    """
    blocks: list[Block] = []
    for name, address, words in sorted(wanted, key=lambda one: one[1]):
        end = address + words
        if blocks:
            last = blocks[-1]
            between = range(last.address + last.words, address)
            known = gaps or all(one in readable for one in between)
            if known and len(between) <= bridge and end - last.address <= most:
                words = max(last.words, end - last.address)
                blocks[-1] = Block(last.address, words, (*last.names, name))
                continue
        blocks.append(Block(address, words, (name,)))
    return blocks
