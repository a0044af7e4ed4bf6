"""Dynamixel protocol 2.0 as pure bytes: no I/O, and no bytes from a wire ever raise.

Source: ROBOTIS e-manual, "DYNAMIXEL Protocol 2.0" (docs/en/dxl/protocol2) and "CRC"
(docs/en/dxl/crc): header FF FF FD 00, id, length of what follows, instruction, parameters, CRC-16
(polynomial 8005h, start 0, low byte first). FF FF FD between instruction and CRC gets an FD
stuffed behind it; length and CRC count the stuffed bytes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import reduce
from operator import getitem, xor
from typing import NamedTuple

HEADER = b"\xff\xff\xfd\x00"
PATTERN = b"\xff\xff\xfd"
STUFFED = b"\xff\xff\xfd\xfd"
BROADCAST = 0xFE

PING = 0x01
READ = 0x02
WRITE = 0x03
REG_WRITE = 0x04
ACTION = 0x05
REBOOT = 0x08
CLEAR = 0x10
STATUS = 0x55
SYNC_READ = 0x82
SYNC_WRITE = 0x83
FAST_SYNC_READ = 0x8A
BULK_READ = 0x92
BULK_WRITE = 0x93

ALERT = 0x80
"""Bit of a status packet's error byte: look at the servo's hardware error status."""

SHORTEST = 3  # length of a packet without parameters: instruction and CRC
LONGEST = 1024
"""Longest length accepted; a longer one is noise that looked like a header."""


def _table() -> tuple[int, ...]:
    values = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ 0x8005 if crc & 0x8000 else crc << 1
        values.append(crc & 0xFFFF)
    return tuple(values)


_CRC = _table()


def crc16(data: Iterable[int], crc: int = 0) -> int:
    """Return the CRC-16 of `data`, continued from `crc`."""
    table = _CRC
    for byte in data:
        crc = (crc << 8 & 0xFF00) ^ table[crc >> 8 ^ byte]
    return crc


class FixedCrc:
    """CRC-16 of blocks of one length, twice as fast as `crc16`: a CRC is linear in its bytes.

    Parameters
    ----------
    length : int
        Bytes of every block.
    """

    def __init__(self, length: int) -> None:
        self._length = length
        # The CRC of a byte followed by 0, 1, 2, ... zero bytes.
        tables = [tuple(crc16((byte,)) for byte in range(256))]
        for _ in range(length - 1):
            tables.append(tuple(crc16((0,), crc) for crc in tables[-1]))
        self._tables = tuple(reversed(tables))

    def start(self, crc: int) -> int:
        """Return the start value for a block that continues from `crc`."""
        return crc16(bytes(self._length), crc)

    def __call__(self, data: Iterable[int], start: int = 0) -> int:
        """Return the CRC of a block of the right length."""
        return reduce(xor, map(getitem, self._tables, data), start)


def stuff(data: bytes) -> bytes:
    """Return `data` with FD behind every FF FF FD."""
    return data.replace(PATTERN, STUFFED) if PATTERN in data else data


def unstuff(data: bytes) -> bytes:
    """Return `data` without the FD that was stuffed behind every FF FF FD."""
    return data.replace(STUFFED, PATTERN) if STUFFED in data else data


class Packet(NamedTuple):
    """A packet as received, stuffing removed. In a status packet `params[0]` is the error byte."""

    device_id: int
    instruction: int
    params: bytes

    @property
    def error(self) -> int:
        """The error byte of a status packet."""
        return self.params[0] if self.params else 0

    @property
    def data(self) -> bytes:
        """What a status packet carries."""
        return self.params[1:]


def build(device_id: int, instruction: int, params: bytes = b"") -> bytes:
    """Return a packet, ready for the wire."""
    body = bytes((instruction,)) + stuff(params)
    head = HEADER + bytes((device_id,)) + (len(body) + 2).to_bytes(2, "little") + body
    return head + crc16(head).to_bytes(2, "little")


def read_packet(device_id: int, address: int, size: int, instruction: int = READ) -> bytes:
    """Return the instruction to read `size` bytes at `address`."""
    return build(device_id, instruction, _span(address, size))


def write_packet(device_id: int, address: int, data: bytes, instruction: int = WRITE) -> bytes:
    """Return the instruction to write `data` at `address`."""
    return build(device_id, instruction, address.to_bytes(2, "little") + data)


def sync_read_packet(ids: Sequence[int], address: int, size: int, *, fast: bool = False) -> bytes:
    """Return the instruction to read the same registers of several servos."""
    instruction = FAST_SYNC_READ if fast else SYNC_READ
    return build(BROADCAST, instruction, _span(address, size) + bytes(ids))


def sync_write_packet(address: int, size: int, values: Iterable[tuple[int, bytes]]) -> bytes:
    """Return the instruction to write the same registers of several servos; none responds."""
    params = _span(address, size) + b"".join(bytes((one,)) + data for one, data in values)
    return build(BROADCAST, SYNC_WRITE, params)


def take_packet(buffer: bytearray, longest: int = LONGEST) -> Packet | None:
    """Take the first complete packet out of `buffer`, and everything before it.

    Noise, broken packets and lengths above `longest` are skipped, up to the next header.
    Returns None when there is no complete packet yet; the beginning of one stays.
    """
    while True:
        start = buffer.find(HEADER)
        if start < 0:
            # The end may be the beginning of a header.
            del buffer[: max(0, len(buffer) - 3)]
            return None
        if start > 0:
            del buffer[:start]
        if len(buffer) < 7:
            return None
        length = buffer[5] | buffer[6] << 8
        if not SHORTEST <= length <= longest:
            del buffer[:4]
            continue
        end = 7 + length
        if len(buffer) < end:
            return None
        packet = bytes(buffer[: end - 2])
        if crc16(packet) != buffer[end - 2] | buffer[end - 1] << 8:
            del buffer[:4]
            continue
        del buffer[:end]
        return Packet(packet[4], packet[7], unstuff(packet[8:]))


def _span(address: int, size: int) -> bytes:
    return address.to_bytes(2, "little") + size.to_bytes(2, "little")
