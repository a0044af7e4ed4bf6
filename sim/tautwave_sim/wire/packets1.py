"""Protocol 1.0, the servo's side: Dynamixel's first, and Feetech's.

Source: e-manual, "DYNAMIXEL Protocol 1.0" (docs/en/dxl/protocol1).
"""

from __future__ import annotations

from typing import NamedTuple

HEADER = b"\xff\xff"

INSTRUCTION_BIT, OVERLOAD_BIT, CHECKSUM_BIT, RANGE_BIT = 0x40, 0x20, 0x10, 0x08
OVERHEATING_BIT, ANGLE_BIT, VOLTAGE_BIT = 0x04, 0x02, 0x01

MAX_LENGTH = 250


class Packet(NamedTuple):
    """An instruction as heard; `intact` is False when its checksum is wrong."""

    device_id: int
    instruction: int
    params: bytes
    intact: bool


def checksum(body: bytes) -> int:
    """Return the ones' complement of the sum of id, length, instruction and parameters."""
    return ~sum(body) & 0xFF


def frame(device_id: int, body: bytes) -> bytes:
    """Return a whole packet around instruction (or error) and parameters."""
    inner = bytes((device_id, len(body) + 1)) + body
    return HEADER + inner + bytes((checksum(inner),))


def status(device_id: int, error: int, params: bytes = b"") -> bytes:
    """Return a status packet."""
    return frame(device_id, bytes((error,)) + params)


class Parser:
    """Finds instruction packets in a stream of bytes; the same interface as protocol 2.0's."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._dropped = 0

    def reset(self) -> None:
        """Forget a packet begun: the line was silent for too long."""
        self._drop(len(self._buffer))

    def feed(self, data: bytes) -> list[tuple[Packet, int]]:
        """Take bytes; return the packets they complete and how many bytes went before their end."""
        buffer = self._buffer
        buffer += data
        packets: list[tuple[Packet, int]] = []
        while True:
            at = buffer.find(HEADER)
            if at < 0:
                self._drop(max(len(buffer) - 1, 0))
                return packets
            self._drop(at)
            if len(buffer) < 4:
                return packets
            length = buffer[3]
            if buffer[2] == 0xFF or not 2 <= length <= MAX_LENGTH:
                self._drop(1)
                continue
            end = 4 + length
            if len(buffer) < end:
                return packets
            intact = checksum(bytes(buffer[2 : end - 1])) == buffer[end - 1]
            packet = Packet(buffer[2], buffer[4], bytes(buffer[5 : end - 1]), intact)
            packets.append((packet, self._dropped + end))
            self._drop(end if intact else 2)

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        self._dropped += count
