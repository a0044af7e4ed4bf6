"""The response of a cycle without any irregularity, recognised and unpacked at once.

Nearly every response has the expected length, ids, order and checksums. One unpacking and one
checksum per packet suffice; anything that differs in a single byte is left to the parsers.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol.packet import FixedCrc

FIELDS = "hii"
"""Present current, velocity, position."""

STATUS_FIELDS = "hiiBBb"
"""The same with torque enable, hardware error status and bus watchdog."""

Values = tuple[int, ...]
"""Error byte, current, velocity, position [counts]; then torque enable, error, watchdog."""


class FastPath:
    """Recognises the complete response of some servos.

    Parameters
    ----------
    ids : sequence of int
        The servos, in the order requested.
    fields : str
        What is read of each, as `struct` names it.
    fast : bool
        One packet for all (fast sync read) instead of one each.
    """

    def __init__(self, ids: Sequence[int], fields: str, *, fast: bool) -> None:
        size = struct.calcsize("<" + fields)
        count, stride = len(ids), len(fields) + 3
        self._keep = len(fields) + 2
        self._stride = stride
        self._fast_ids = tuple(ids) if fast else ()
        if fast:
            layout = "<8s" + f"BB{fields}H" * count
            heads = [_head(packet.BROADCAST, count * (size + 4) + 1)]
            self._rows = [1 + index * stride for index in range(count)]
            spans = [(8, struct.calcsize(layout) - 2)]
            ends = [count * stride]
        else:
            layout = "<" + f"8sB{fields}H" * count
            block = size + 11
            heads = [_head(one, size + 4) for one in ids]
            self._rows = [index * stride for index in range(count)]
            spans = [(at + 8, at + block - 2) for at in range(0, count * block, block)]
            ends = [row + stride - 1 for row in self._rows]
        self._heads = tuple(heads)
        self._layout = struct.Struct(layout)
        self.size = self._layout.size
        self._crc = FixedCrc(spans[0][1] - spans[0][0])
        starts = [self._crc.start(packet.crc16(head)) for head in heads]
        # Per packet: index of its checksum, bytes covered, start value.
        self._checks = list(zip(ends, spans, starts, strict=True))

    def take(self, response: bytes) -> list[Values] | None:
        """Return the values of every servo, in the order requested; None where anything differs."""
        if len(response) != self.size:
            return None
        fields = self._layout.unpack(response)
        crc = self._crc
        for at, (first, last), start in self._checks:
            if crc(response[first:last], start) != fields[at]:
                return None
        keep = self._keep
        if not self._fast_ids:
            if fields[:: self._stride] != self._heads:
                return None
            return [fields[row + 1 : row + keep] for row in self._rows]
        if fields[:1] != self._heads or fields[2 :: self._stride] != self._fast_ids:
            return None
        return [(fields[row], *fields[row + 2 : row + keep]) for row in self._rows]


def _head(device_id: int, length: int) -> bytes:
    """Return the first 8 bytes of a status packet."""
    return packet.HEADER + bytes((device_id, length & 0xFF, length >> 8, packet.STATUS))
