"""What a site has to say in a slot, between the table of a running pair and a packet's lines."""

from __future__ import annotations

from collections.abc import MutableSequence

from tautwave.link.network import SENT
from tautwave.link.packet import Line


def last_line(table: MutableSequence[float], at: int, size: int, slot: int, repeated: int) -> Line:
    """Return a slot's line of a packet, from the ring of `size` slots sent at `at`."""
    kept = [at + SENT * ((slot - back) % size) for back in range(min(repeated, slot) + 1)]
    granted, asked = int(table[kept[0] + 2]), int(table[kept[0] + 3])
    return Line(granted, asked, tuple((int(table[i]), int(table[i + 1])) for i in kept))


def put_line(table: MutableSequence[float], at: int, size: int, slot: int, line: Line) -> None:
    """Put what a packet's line says where `last_line` finds it."""
    for back, (integral, energy) in enumerate(line.pairs):
        kept = at + SENT * ((slot - back) % size)
        table[kept] = integral
        table[kept + 1] = energy
    kept = at + SENT * (slot % size)
    table[kept + 2] = line.granted
    table[kept + 3] = line.asked
