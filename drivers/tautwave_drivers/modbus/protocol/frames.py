"""Requests and responses as bytes: the only module that uses pymodbus (the same from 3.12 to 3.16).

Its PDUs encode the requests, its socket framer adds the TCP header. What a response has to look
like follows from the request, so that nothing else is ever taken for it. The CRC of RTU is computed
here, in half the time.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from pymodbus.framer import FramerSocket


class _Vendor(NamedTuple):
    """What is used of pymodbus; it is imported with the first frame, not with this module."""

    socket: FramerSocket
    registers: Any
    identification: Any


@cache
def _vendor() -> _Vendor:
    from pymodbus.framer import FramerSocket
    from pymodbus.pdu import DecodePDU, mei_message, register_message

    return _Vendor(FramerSocket(DecodePDU(False)), register_message, mei_message)


def _entry(byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ 0xA001 if byte & 1 else byte >> 1
    return byte


_TABLE = tuple(_entry(byte) for byte in range(256))


def crc16(data: bytes | bytearray, crc: int = 0xFFFF) -> int:
    """Return the CRC of an RTU frame, on from `crc` (MODBUS over Serial Line V1.02, 6.2.2)."""
    table = _TABLE
    for byte in data:
        crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
    return crc


_HEADER = struct.Struct(">HHHB").unpack_from
REFUSED = 0x80
MBAP = 7
IDENTIFY = 0x2B


class Request:
    """One request, and what its response has to look like.

    Parameters
    ----------
    pdu : bytes
        The request.
    head : bytes
        What the PDU of a valid response begins with.
    size : int
        Bytes of that PDU; 0 where the response itself has its length.
    words_at : int
        Where the words that it writes begin, so that they can be changed.
    """

    __slots__ = ("function", "head", "pdu", "rtu_head", "size", "tcp_head", "words_at")

    def __init__(self, pdu: bytes, head: bytes, size: int, words_at: int = 0) -> None:
        self.pdu = bytearray(pdu)
        self.function = pdu[0]
        self.head = head
        self.size = size
        self.words_at = words_at
        self.rtu_head: tuple[bytes, int] | None = None
        self.tcp_head = b""

    def put(self, words: Sequence[int]) -> None:
        """Change the words that it writes."""
        struct.pack_into(f">{len(words)}H", self.pdu, self.words_at, *words)
        if self.function == 6:
            self.head = bytes(self.pdu)

    def fits(self, pdu: bytes) -> bool:
        """Return whether a PDU is a response to this, an exception or not."""
        if len(pdu) == 2 and pdu[0] == self.function | REFUSED:
            return True
        return pdu.startswith(self.head) and (self.size == 0 or len(pdu) == self.size)


def read(function: int, address: int, count: int) -> Request:
    """Return a read of registers: function code 3 (holding) or 4 (input)."""
    pdus = _vendor().registers
    kind = pdus.ReadHoldingRegistersRequest if function == 3 else pdus.ReadInputRegistersRequest
    pdu = bytes((function,)) + kind(address=address, count=count).encode()
    return Request(pdu, bytes((function, 2 * count)), 2 + 2 * count)


def read_bit(function: int, address: int) -> Request:
    """Return a read of one coil (function code 1) or discrete input (2)."""
    pdu = struct.pack(">BHH", function, address, 1)
    return Request(pdu, bytes((function, 1)), 3)


def write_coil(address: int, value: int, *, several: bool) -> Request:
    """Return a write of one coil: function code 5, or 15."""
    if several:
        pdu = struct.pack(">BHHBB", 15, address, 1, 1, value & 1)
        return Request(pdu, pdu[:5], 5)
    pdu = struct.pack(">BHH", 5, address, 0xFF00 if value else 0)
    return Request(pdu, pdu, 5)


def write(address: int, words: Sequence[int]) -> Request:
    """Return a write of several registers: function code 16."""
    kind = _vendor().registers.WriteMultipleRegistersRequest
    pdu = b"\x10" + kind(address=address, registers=list(words)).encode()
    return Request(pdu, pdu[:5], 5, 6)


def write_one(address: int, word: int) -> Request:
    """Return a write of one register: function code 6, echoed as its response."""
    kind = _vendor().registers.WriteSingleRegisterRequest
    pdu = b"\x06" + kind(address=address, registers=[word]).encode()
    return Request(pdu, pdu, 5, 3)


def read_write(address: int, count: int, to: int, words: Sequence[int]) -> Request:
    """Return a write at `to` and a read of `count` registers in one: function code 23."""
    request = _vendor().registers.ReadWriteMultipleRegistersRequest(
        read_address=address, read_count=count, write_address=to, write_registers=list(words)
    )
    return Request(b"\x17" + request.encode(), bytes((23, 2 * count)), 2 + 2 * count, 10)


def identify() -> Request:
    """Return the request for a device's identification: function code 43/14, basic objects."""
    request = _vendor().identification.ReadDeviceInformationRequest(read_code=1, object_id=0)
    return Request(bytes((IDENTIFY,)) + request.encode(), bytes((IDENTIFY, 0x0E)), 0)


def identity_of(pdu: bytes) -> dict[int, str]:
    """Return the objects of an identification: 0 vendor, 1 product, 2 revision. Never raises."""
    response = _vendor().identification.ReadDeviceInformationResponse()
    try:
        response.decode(pdu[1:])
    except Exception:  # noqa: BLE001  it raises many things on invalid bytes
        return {}
    return {
        number: bytes(value).decode("ascii", "replace").strip("\0 ")
        for number, value in response.information.items()
        if isinstance(value, bytes | bytearray)
    }


def words_of(pdu: bytes) -> tuple[int, ...]:
    """Return the registers in the response to a read (3, 4, 23)."""
    count = (len(pdu) - 2) // 2
    return struct.unpack_from(f">{count}H", pdu, 2)


def tcp_frame(transaction_id: int, unit: int, pdu: bytes | bytearray) -> bytes:
    """Return MBAP header and PDU (MODBUS Messaging on TCP/IP V1.0b, 3.1.3)."""
    return _vendor().socket.encode(bytes(pdu), unit, transaction_id)


def tcp_request(transaction_id: int, unit: int, request: Request) -> bytes:
    """Return the frame of a request; the constant part of its header is made once."""
    head = request.tcp_head
    if not head or head[-1] != unit:
        head = request.tcp_head = tcp_frame(0, unit, request.pdu)[2:MBAP]
    return transaction_id.to_bytes(2, "big") + head + request.pdu


def only_tcp(data: bytes) -> tuple[int, int, bytes] | None:
    """Return transaction, unit and PDU where `data` is one frame and nothing else."""
    if len(data) < MBAP + 1:
        return None
    transaction_id, protocol, length, unit = _HEADER(data)
    if protocol or length + 6 != len(data) or length < 3:
        return None
    return transaction_id, unit, data[MBAP:]


def may_be_tcp(buffer: bytearray) -> bool:
    """Return whether bytes may be the beginning of a frame: its header says so, or is not whole."""
    return len(buffer) < 6 or not (buffer[2] or buffer[3] or buffer[4] or not 3 <= buffer[5] <= 254)


def take_tcp(buffer: bytearray) -> tuple[int, int, bytes] | None:
    """Take transaction, unit and PDU of the first whole frame out of a stream; None if none is.

    Where bytes cannot be a header, there is no way to find the next one: all are dropped.
    """
    if not may_be_tcp(buffer):
        buffer.clear()
    if len(buffer) < MBAP + 1:
        return None
    end = 6 + buffer[5]
    if len(buffer) < end:
        return None
    _, unit, transaction_id, pdu = _vendor().socket.decode(bytes(buffer[:end]))
    del buffer[:end]
    return transaction_id, unit, pdu


def rtu_request(unit: int, request: Request) -> bytes:
    """Return the frame of a request; the CRC of its constant part is computed once."""
    at = request.words_at
    if not at:
        return rtu_frame(unit, request.pdu)
    head = request.rtu_head
    if head is None or head[0][0] != unit:
        fixed = bytes((unit,)) + request.pdu[:at]
        head = request.rtu_head = (fixed, crc16(fixed))
    words = request.pdu[at:]
    return head[0] + words + crc16(words, head[1]).to_bytes(2, "little")


def rtu_frame(unit: int, pdu: bytes | bytearray) -> bytes:
    """Return address, PDU and CRC, its low byte first (MODBUS over Serial Line V1.02, 2.5.1)."""
    body = bytes((unit,)) + pdu
    return body + crc16(body).to_bytes(2, "little")


def take_rtu(data: bytes | bytearray, unit: int, request: Request) -> bytes | None:
    """Return the PDU in `data` that responds to a request; None while there is none.

    Noise around it is skipped: address, function, length and CRC have to be right together.
    """
    function, size = request.function, request.size
    if size and len(data) == size + 3 and data[1] == function and data[0] == unit:
        # Nearly always: the response alone, and complete.
        crc, table = 0xFFFF, _TABLE
        for byte in data:
            crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
        if crc == 0 and data.startswith(request.head, 1):  # over itself a CRC is 0
            return bytes(data[1:-2])
    start = data.find(unit)
    while 0 <= start <= len(data) - 5:
        code = data[start + 1]
        size = 0
        if code == function:
            size = request.size or _reported_size(data, start + 1)
        elif code == function | REFUSED:
            size = 2
        end = start + 3 + size
        if size and end <= len(data) and crc16(data[start:end]) == 0:
            pdu = bytes(data[start + 1 : end - 2])
            if request.fits(pdu):
                return pdu
        start = data.find(unit, start + 1)
    return None


def _reported_size(data: bytes | bytearray, start: int) -> int:
    """Return the length of an identification's PDU; 0 while it is not known."""
    at = start + 7
    if at > len(data):
        return 0
    for _ in range(data[start + 6]):
        if at + 2 > len(data):
            return 0
        at += 2 + data[at + 1]
    return at - start


def frame_in(data: bytes | bytearray) -> tuple[int, int] | None:
    """Return unit and function code of the first RTU response in `data`, to whomever; None: none.

    Exceptions count as their function.
    """
    for start in range(len(data) - 4):
        code = data[start + 1]
        size = 5 if code & REFUSED or code not in _SIZES else _SIZES[code] or 5 + data[start + 2]
        if start + size <= len(data) and crc16(data[start : start + size]) == 0:
            return data[start], code & ~REFUSED
    return None


_SIZES = {1: 0, 2: 0, 3: 0, 4: 0, 5: 8, 6: 8, 15: 8, 16: 8, 23: 0}
"""Bytes of a response by function code; 0 where its third byte says how many more."""
