"""Packets of a rig whose two sides run in one process: written and read as between two."""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence

from tautwave.controller.records import PairParams
from tautwave.errors import DriverError
from tautwave.link.packet import Packet, Refusal, read_packet, write_packet
from tautwave.link.post import last_line, put_line


class Wire:
    """What both sides say in a slot, as bytes and back: one packet a side, for all pairs.

    Parameters
    ----------
    pairs : sequence of PairParams
        The pairs, each with a link.
    """

    def __init__(self, pairs: Sequence[PairParams]) -> None:
        # What the master says waits at the slave, and the other way.
        self._ends = [q.link.slave for q in pairs], [q.link.master for q in pairs]
        self._sent = [-1, -1]

    def begin(self) -> None:
        """Let a session begin: its slots are counted from 0 on."""
        self._sent = [-1, -1]

    def carry(self, table: MutableSequence[float]) -> None:
        """Write and read the packets of this slot; what was read is what will arrive.

        Raises
        ------
        DriverError
            A packet was refused.
        """
        for site, ends in enumerate(self._ends):
            slot = int(table[ends[0].last])
            if slot == self._sent[site]:
                continue
            self._sent[site] = slot
            lines = [last_line(table, k.post, k.days, slot, k.repeated) for k in ends]
            read = read_packet(write_packet(Packet(site, slot, 0, 0, 0, tuple(lines))), 1 - site)
            if isinstance(read, Refusal):
                raise DriverError(f"link: a packet from this same process {read.value}")
            for k, line in zip(ends, read.lines, strict=True):
                put_line(table, k.post, k.days, read.slot, line)
