"""A server's response to a request: function codes 3, 4, 6, 16 and 23, and the exceptions.

Source: MODBUS Application Protocol Specification V1.1b3, 6.3, 6.4, 6.6, 6.12, 6.17 and 7; the order
of the checks is that of its state diagrams.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple, Protocol

from tautwave_sim.modbus.registers import (
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    Refusal,
)

READ_COILS, READ_DISCRETE, WRITE_COIL, WRITE_COILS = 1, 2, 5, 15
READ_HOLDING, READ_INPUT, WRITE_ONE, WRITE_MANY, READ_WRITE = 3, 4, 6, 16, 23
READS = (READ_COILS, READ_DISCRETE, READ_HOLDING, READ_INPUT, READ_WRITE)
TABLE_OF = {READ_COILS: "coil", READ_DISCRETE: "discrete", READ_INPUT: "input", WRITE_COIL: "coil",
          WRITE_COILS: "coil"}  # fmt: skip
"""The table that a function code is about, where it is not that of holding registers."""
MAX_BITS = 2000
MAX_READ, MAX_WRITTEN, MAX_WRITTEN_READING = 125, 123, 121

_PAIR = struct.Struct(">HH")
_TWO_PAIRS = struct.Struct(">HHHH")


class Request(NamedTuple):
    """A request that is well formed: words to write at an address, and words to read."""

    function: int
    write_address: int = 0
    words: tuple[int, ...] = ()
    read_address: int = 0
    read_count: int = 0


class Server(Protocol):
    """A drive behind the requests."""

    @property
    def functions(self) -> Sequence[int]:
        """Function codes that it knows."""
        ...

    def write(self, address: int, words: Sequence[int], table: str = "holding") -> None:
        """Take words of a table, or bits; raises `Refusal`."""
        ...

    def read(self, address: int, count: int, table: str = "holding") -> list[int]:
        """Return words of a table, or bits; raises `Refusal`."""
        ...


def parse(pdu: bytes, functions: Sequence[int]) -> Request:
    """Return a request; raises `Refusal` (1, 3 or 2, in that order) if it is none."""
    if not pdu or pdu[0] not in functions:
        raise Refusal(ILLEGAL_FUNCTION)
    function, body = pdu[0], pdu[1:]
    if function in (READ_COILS, READ_DISCRETE, READ_HOLDING, READ_INPUT):
        if len(body) != 4:
            raise Refusal(ILLEGAL_VALUE)
        address, count = _PAIR.unpack(body)
        request = Request(function, read_address=address, read_count=count)
        _check(1 <= count <= (MAX_BITS if function in TABLE_OF and function != 4 else MAX_READ))
    elif function == WRITE_COIL:
        _check(len(body) == 4 and body[2:] in (b"\xff\x00", b"\x00\x00"))
        request = Request(function, _PAIR.unpack(body)[0], (int(body[2] == 0xFF),))
    elif function == WRITE_COILS:
        _check(len(body) >= 6)
        address, count = _PAIR.unpack_from(body)
        _check(1 <= count <= MAX_BITS and len(body) == 5 + body[4] == 5 + (count + 7) // 8)
        bits = tuple(body[5 + at // 8] >> at % 8 & 1 for at in range(count))
        request = Request(function, address, bits)
    elif function == WRITE_ONE:
        if len(body) != 4:
            raise Refusal(ILLEGAL_VALUE)
        address, word = _PAIR.unpack(body)
        request = Request(function, address, (word,))
    elif function == WRITE_MANY:
        _check(len(body) >= 5)
        address, count = _PAIR.unpack_from(body)
        words = _words(body[4:], count, MAX_WRITTEN)
        request = Request(function, address, words)
    elif function == READ_WRITE:
        _check(len(body) >= 9)
        read_address, read_count, address, count = _TWO_PAIRS.unpack_from(body)
        _check(1 <= read_count <= MAX_READ)
        words = _words(body[8:], count, MAX_WRITTEN_READING)
        request = Request(function, address, words, read_address, read_count)
    else:
        raise Refusal(ILLEGAL_FUNCTION)
    if (
        request.read_address + request.read_count > 0x10000
        or request.write_address + len(request.words) > 0x10000
    ):
        raise Refusal(ILLEGAL_ADDRESS)
    return request


def _check(right: bool) -> None:
    if not right:
        raise Refusal(ILLEGAL_VALUE)


def _words(counted: bytes, count: int, most: int) -> tuple[int, ...]:
    _check(1 <= count <= most and counted[0] == 2 * count and len(counted) == 1 + 2 * count)
    return struct.unpack(f">{count}H", counted[1:])


def respond(server: Server, pdu: bytes) -> bytes:
    """Return the response to a request, or its exception response; raises nothing."""
    try:
        request = parse(pdu, server.functions)
        # FC 23 writes before it reads (6.17), but nothing at all if the read is refused.
        table = TABLE_OF.get(request.function, "holding")
        if request.words and request.read_count:
            server.read(request.read_address, request.read_count)
        if request.words:
            server.write(request.write_address, request.words, table)
        if request.read_count:
            words = server.read(request.read_address, request.read_count, table)
            if table in ("coil", "discrete"):
                packed = bytearray((len(words) + 7) // 8)
                for at, bit in enumerate(words):
                    packed[at // 8] |= (bit & 1) << at % 8
                return bytes((request.function, len(packed))) + packed
            return struct.pack(f">BB{len(words)}H", request.function, 2 * len(words), *words)
    except Refusal as refusal:
        return exception(pdu, refusal.code)
    if request.function in (WRITE_ONE, WRITE_COIL):
        return pdu
    return struct.pack(">BHH", request.function, request.write_address, len(request.words))


def exception(pdu: bytes, code: int) -> bytes:
    """Return an exception response to a request."""
    return bytes([(pdu[0] if pdu else 0) | 0x80, code])
