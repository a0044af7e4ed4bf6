"""Dynamixel protocol 1.0 as pure bytes: AX, RX, EX, the first MX servos, and Feetech's.

Source: ROBOTIS e-manual, "DYNAMIXEL Protocol 1.0" (docs/en/dxl/protocol1): header FF FF, id,
length of what follows, instruction or error, parameters, and the complement of the sum of all
bytes since the id. Nothing is stuffed, so a header may also be data. Feetech's STS, SMS and HLS
have a sync read beside it (82h): one answer of each servo, in the order asked.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

HEADER = b"\xff\xff"
BROADCAST = 0xFE
LONGEST = 250

PING = 0x01
READ = 0x02
WRITE = 0x03
SYNC_READ = 0x82
SYNC_WRITE = 0x83

HEAD = 5
"""Bytes of a status packet before its data; the checksum is one more."""


class Status(NamedTuple):
    """A status packet as it came: its servo, error byte and data."""

    device_id: int
    error: int
    data: bytes


def checksum(data: Iterable[int]) -> int:
    """Return the complement of the sum of all bytes between header and checksum."""
    return ~sum(data) & 0xFF


def build(device_id: int, instruction: int, params: bytes = b"") -> bytes:
    """Return a packet, ready for the wire."""
    body = bytes((device_id, len(params) + 2, instruction)) + params
    return HEADER + body + bytes((checksum(body),))


def read_packet(device_id: int, address: int, size: int) -> bytes:
    """Return the instruction to read `size` bytes at `address`."""
    return build(device_id, READ, bytes((address, size)))


def write_packet(device_id: int, address: int, data: bytes) -> bytes:
    """Return the instruction to write `data` at `address`."""
    return build(device_id, WRITE, bytes((address,)) + data)


def sync_write_packet(address: int, size: int, values: Iterable[tuple[int, bytes]]) -> bytes:
    """Return the instruction to write the same registers of several servos; none responds."""
    params = bytes((address, size)) + b"".join(bytes((one,)) + data for one, data in values)
    return build(BROADCAST, SYNC_WRITE, params)


def sync_read_packet(ids: Sequence[int], address: int, size: int) -> bytes:
    """Return the instruction to read `size` bytes at `address` of several servos (Feetech)."""
    return build(BROADCAST, SYNC_READ, bytes((address, size, *ids)))


def take_packet(buffer: bytearray, longest: int = LONGEST) -> Status | None:
    """Take the first whole packet out of `buffer`, and everything before it.

    An instruction looks alike: its number is then the `error`. None when none is whole yet.
    """
    while True:
        start = buffer.find(HEADER)
        if start < 0:
            del buffer[: max(0, len(buffer) - 1)]
            return None
        if start > 0:
            del buffer[:start]
        if len(buffer) < 4:
            return None
        device_id, length = buffer[2], buffer[3]
        # An id of FF is a header that begins one byte later.
        if device_id > 0xFD or not 2 <= length <= longest:
            del buffer[:1]
            continue
        end = 4 + length
        if len(buffer) < end:
            return None
        if checksum(buffer[2 : end - 1]) != buffer[end - 1]:
            del buffer[:1]
            continue
        packet = Status(device_id, buffer[4], bytes(buffer[HEAD : end - 1]))
        del buffer[:end]
        return packet
