"""Protocol 2.0, the servo's side: packets, byte stuffing, checksum, and finding packets again.

Source: e-manual, "DYNAMIXEL Protocol 2.0" (docs/en/dxl/protocol2) and "CRC Calculation".
"""

from __future__ import annotations

from tautwave_sim.wire.packets1 import Packet

HEADER = b"\xff\xff\xfd\x00"
STUFFED = b"\xff\xff\xfd"
BROADCAST = 0xFE

PING, READ, WRITE, REG_WRITE, ACTION, FACTORY_RESET = 0x01, 0x02, 0x03, 0x04, 0x05, 0x06
REBOOT, CLEAR, STATUS = 0x08, 0x10, 0x55
SYNC_READ, SYNC_WRITE, FAST_SYNC_READ = 0x82, 0x83, 0x8A
BULK_READ, BULK_WRITE, FAST_BULK_READ = 0x92, 0x93, 0x9A

RESULT_FAIL, INSTRUCTION_ERROR, CRC_ERROR, RANGE_ERROR = 1, 2, 3, 4
LENGTH_ERROR, LIMIT_ERROR, ACCESS_ERROR = 5, 6, 7
ALERT = 0x80

MAX_LENGTH = 1024
"""Longest packet a servo waits for: a broken length must not make it deaf for long."""


def _table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 8
        for _ in range(8):
            crc = (crc << 1) ^ (0x8005 if crc & 0x8000 else 0)
        table.append(crc & 0xFFFF)
    return tuple(table)


_TABLE = _table()


def crc16(data: bytes | bytearray, crc: int = 0) -> int:
    """Return the checksum (polynomial 0x8005, nothing reflected), continued from `crc`."""
    for byte in data:
        crc = ((crc << 8) & 0xFFFF) ^ _TABLE[(crc >> 8) ^ byte]
    return crc


def stuff(body: bytes) -> bytes:
    """Put an FD behind every FF FF FD, so that no header appears in instruction and parameters."""
    return body.replace(STUFFED, STUFFED + b"\xfd") if STUFFED in body else body


def unstuff(body: bytes) -> bytes:
    """Undo `stuff`; what never was stuffed stays as it is."""
    return body.replace(STUFFED + b"\xfd", STUFFED) if STUFFED in body else body


def frame(device_id: int, body: bytes) -> bytes:
    """Return a whole packet around instruction and parameters (or instruction, error, ...)."""
    stuffed = stuff(body)
    head = HEADER + bytes((device_id,)) + (len(stuffed) + 2).to_bytes(2, "little") + stuffed
    return head + crc16(head).to_bytes(2, "little")


def status(device_id: int, error: int, params: bytes = b"") -> bytes:
    """Return a status packet."""
    return frame(device_id, bytes((STATUS, error)) + params)


def fast_status(pieces: list[tuple[int, int, bytes]], length: int) -> list[bytes]:
    """Return the pieces of a fast sync or bulk response, one per servo, never stuffed.

    Parameters
    ----------
    pieces : list
        Id, error and data of those that respond, in their order.
    length : int
        LENGTH of the whole packet as requested, silent servos included.
    """
    crc = 0
    sent = []
    head = HEADER + bytes((BROADCAST,)) + length.to_bytes(2, "little") + bytes((STATUS,))
    for device_id, error, data in pieces:
        piece = head + bytes((error, device_id)) + data
        head = b""
        crc = crc16(piece, crc)
        checksum = crc.to_bytes(2, "little")
        crc = crc16(checksum, crc)  # the next servo's checksum covers this one too
        sent.append(piece + checksum)
    return sent


class Parser:
    """Finds instruction packets in a stream of bytes, whatever else is in it."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._dropped = 0

    def reset(self) -> None:
        """Forget a packet begun: the line was silent for too long."""
        self._drop(len(self._buffer))

    def feed(self, data: bytes) -> list[tuple[Packet, int]]:
        """Take bytes; return the packets they complete and how many bytes went before their end.

        The count is over all bytes ever fed.
        """
        buffer = self._buffer
        buffer += data
        packets: list[tuple[Packet, int]] = []
        while True:
            at = buffer.find(HEADER)
            if at < 0:
                self._drop(max(len(buffer) - len(HEADER) + 1, 0))
                return packets
            self._drop(at)
            if len(buffer) < 7:
                return packets
            device_id = buffer[4]
            length = buffer[5] | buffer[6] << 8
            if device_id in (0xFD, 0xFF) or not 3 <= length <= MAX_LENGTH:
                self._drop(1)
                continue
            end = 7 + length
            # Stuffing keeps headers out of a packet's body: one in there begins another packet.
            again = buffer.find(HEADER, 7, end - 2)
            if again >= 0:
                self._drop(again)
                continue
            if len(buffer) < end:
                return packets
            intact = crc16(buffer[: end - 2]) == buffer[end - 2] | buffer[end - 1] << 8
            if not intact and buffer.find(HEADER, end - 5) in range(end - 5, end):
                self._drop(1)
                continue
            body = unstuff(bytes(buffer[7 : end - 2]))
            packet = Packet(device_id, body[0], body[1:], intact)
            if packet.instruction != STATUS:
                packets.append((packet, self._dropped + end))
            self._drop(end if intact else 1)

    def _drop(self, count: int) -> None:
        del self._buffer[:count]
        self._dropped += count
