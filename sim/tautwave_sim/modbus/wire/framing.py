"""Frames around a request: address and CRC on a serial line, MBAP header on TCP.

Sources: MODBUS over Serial Line V1.02, 2.5.1 (RTU, CRC, silent intervals); MODBUS Messaging on
TCP/IP Implementation Guide V1.0b, 3.1.3 (MBAP).
"""

from __future__ import annotations

from typing import NamedTuple

RTU_LEAST, RTU_MOST = 4, 256
MBAP = 7
PDU_MOST = 253


def _entry(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_CRC = tuple(_entry(byte) for byte in range(256))


def crc16(data: bytes | bytearray) -> int:
    """Return the CRC of an RTU frame (polynomial A001h reflected, initially FFFFh)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc


def rtu_frame(unit: int, pdu: bytes) -> bytes:
    """Return address, PDU and CRC (low byte first)."""
    body = bytes([unit]) + pdu
    return body + crc16(body).to_bytes(2, "little")


def open_rtu(frame: bytes | bytearray) -> tuple[int, bytes] | None:
    """Return address and PDU of what came between two silences; None if it is not a frame."""
    if not RTU_LEAST <= len(frame) <= RTU_MOST:
        return None
    if crc16(frame[:-2]) != int.from_bytes(frame[-2:], "little"):
        return None
    return frame[0], bytes(frame[1:-2])


def silent_ns(baud: int, bits: int) -> int:
    """Return the silence that ends a frame [ns]: 3.5 characters; 1.75 ms above 19200 baud."""
    return 1_750_000 if baud > 19200 else -(-35 * bits * 100_000_000 // baud)


class TcpRequest(NamedTuple):
    """One request in a stream."""

    transaction: int
    unit: int
    pdu: bytes


def tcp_frame(transaction: int, unit: int, pdu: bytes) -> bytes:
    """Return MBAP header and PDU."""
    head = transaction.to_bytes(2, "big") + b"\0\0" + (len(pdu) + 1).to_bytes(2, "big")
    return head + bytes([unit]) + pdu


class TcpStream:
    """Cuts a stream into requests.

    A header that cannot be one (protocol not 0, length beyond the standard's) leaves no way to
    find the next: all that has come is forgotten, and the next segment begins anew.
    """

    def __init__(self) -> None:
        self._held = bytearray()
        self.dropped = 0
        """Times that it had to forget what had come."""

    def feed(self, data: bytes) -> list[TcpRequest]:
        """Take bytes; return the requests that are now complete."""
        self._held += data
        requests = []
        while len(self._held) >= MBAP:
            length = int.from_bytes(self._held[4:6], "big")
            if self._held[2:4] != b"\0\0" or not 2 <= length <= PDU_MOST + 1:
                self._held.clear()
                self.dropped += 1
                break
            if len(self._held) < 6 + length:
                break
            transaction = int.from_bytes(self._held[:2], "big")
            pdu = bytes(self._held[MBAP : 6 + length])
            requests.append(TcpRequest(transaction, self._held[6], pdu))
            del self._held[: 6 + length]
        return requests
