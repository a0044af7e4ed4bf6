"""Frames byte for byte as the public documents print them, and streams of anything."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_sim.modbus.registers import Register, RegisterBank
from tautwave_sim.modbus.wire.framing import (
    TcpStream,
    crc16,
    open_rtu,
    rtu_frame,
    silent_ns,
    tcp_frame,
)
from tautwave_sim.modbus.wire.protocol import exception, respond

# MODBUS Application Protocol Specification V1.1b3: 6.3, 6.4, 6.6, 6.12, 6.17, request and response
SPECIFICATION = [
    ("03 006B 0003", "03 06 022B 0000 0064", {0x6B: 0x022B, 0x6C: 0, 0x6D: 0x64}),
    ("04 0008 0001", "04 02 000A", {0x08: 0x000A}),
    ("06 0001 0003", "06 0001 0003", {0x01: 0}),
    ("10 0001 0002 04 000A 0102", "10 0001 0002", {0x01: 0, 0x02: 0}),
    (
        "17 0003 0006 000E 0003 06 00FF 00FF 00FF",
        "17 0C 00FE 0ACD 0001 0003 000D 00FF",
        dict(zip(range(3, 17), [0xFE, 0xACD, 1, 3, 0xD, 0xFF, *(0,) * 8], strict=True)),
    ),
]

# Requests in the manuals of the Kinco FD5P (10.2.3) and FD3/CD3 (12.3) drives
MANUALS = [
    "01 03 3200 0002 CAB3",
    "01 06 3100 000F C732",
    "01 10 6F00 0002 04 5555 0008 1A47",
    "01 10 6F00 0002 04 4E82 001B ED56",
]


class Plain:
    """A server with nothing behind its registers."""

    functions = (3, 4, 6, 16, 23)

    def __init__(self, words: dict[int, int]) -> None:
        registers = {
            f"at {address}": Register(f"at {address}", address, "u16", default=word)
            for address, word in words.items()
        }
        self.bank = RegisterBank(registers)

    def write(self, address: int, words: tuple[int, ...], table: str = "holding") -> None:
        for name, value in self.bank.check(address, words, table).items():
            self.bank.store(name, value)

    def read(self, address: int, count: int, table: str = "holding") -> list[int]:
        return self.bank.read(address, count, table)


@pytest.mark.parametrize(("request_", "response", "words"), SPECIFICATION)
def test_the_specifications_examples(request_: str, response: str, words: dict[int, int]) -> None:
    server = Plain(words)
    assert respond(server, bytes.fromhex(request_)) == bytes.fromhex(response)
    if request_.startswith("17"):
        assert server.read(14, 3) == [0xFF, 0xFF, 0xFF]


def test_the_serial_line_guides_checksum() -> None:
    # MODBUS over Serial Line V1.02, 6.2.2: 02 07 is followed by 41 12.
    assert crc16(bytes.fromhex("02 07")) == 0x1241
    assert rtu_frame(2, b"\x07") == bytes.fromhex("02 07 41 12")


@pytest.mark.parametrize("frame", MANUALS)
def test_frames_that_drive_manuals_print(frame: str) -> None:
    raw = bytes.fromhex(frame)
    assert open_rtu(raw) == (1, raw[1:-2])
    assert rtu_frame(1, raw[1:-2]) == raw


def test_a_drive_manuals_value_is_low_word_first() -> None:
    # Kinco FD3/CD3, 12.3: 55 55 00 08 writes 00085555h.
    one = Register("target velocity", 0x6F00, "i32", low_first=True)
    assert one.decode([0x5555, 0x0008]) == 0x00085555
    assert one._replace(low_first=False).decode([0x0008, 0x5555]) == 0x00085555


def test_an_exception_is_the_function_with_its_top_bit() -> None:
    # V1.1b3, 7: 01 04A1 0001 is answered by 81 02.
    assert exception(bytes.fromhex("01 04A1 0001"), 2) == bytes.fromhex("81 02")


def test_the_header_of_the_tcp_guide() -> None:
    # MODBUS Messaging on TCP/IP Implementation Guide V1.0b: the example of a request's ADU.
    frame = bytes.fromhex("1501 0000 0006 FF 03 0004 0001")
    (request,) = TcpStream().feed(frame)
    assert request == (0x1501, 0xFF, bytes.fromhex("03 0004 0001"))
    assert tcp_frame(*request) == frame


@pytest.mark.parametrize(
    ("baud", "bits", "silent"),
    [(9600, 11, 4_010_417), (19200, 11, 2_005_209), (19201, 11, 1_750_000), (9600, 10, 3_645_834)],
)
def test_silence_of_three_and_a_half_characters(baud: int, bits: int, silent: int) -> None:
    assert silent_ns(baud, bits) == silent


@given(st.binary(max_size=300))
def test_any_bytes_are_a_frame_or_none(data: bytes) -> None:
    found = open_rtu(data)
    if found is not None:
        assert rtu_frame(*found) == data


@given(st.integers(1, 247), st.binary(min_size=1, max_size=253), st.data())
def test_one_wrong_bit_is_no_frame(unit: int, pdu: bytes, data: st.DataObject) -> None:
    frame = bytearray(rtu_frame(unit, pdu))
    assert open_rtu(frame) == (unit, pdu)
    bit = data.draw(st.integers(0, 8 * len(frame) - 1))
    frame[bit // 8] ^= 1 << bit % 8
    assert open_rtu(frame) is None


REQUESTS = st.lists(
    st.tuples(st.integers(0, 0xFFFF), st.integers(0, 255), st.binary(min_size=1, max_size=253)),
    max_size=5,
)


@given(REQUESTS, st.lists(st.integers(1, 40), min_size=1, max_size=20))
def test_a_stream_is_cut_the_same_however_it_comes(
    requests: list[tuple[int, int, bytes]], pieces: list[int]
) -> None:
    whole = b"".join(tcp_frame(*request) for request in requests)
    stream, found, at, turn = TcpStream(), [], 0, 0
    while at < len(whole):
        size = pieces[turn % len(pieces)]
        found += stream.feed(whole[at : at + size])
        at, turn = at + size, turn + 1
    assert found == requests
    assert stream.dropped == 0


@given(st.lists(st.binary(max_size=60), max_size=8))
def test_a_stream_of_anything_finds_its_feet_again(segments: list[bytes]) -> None:
    stream = TcpStream()
    for segment in segments:
        stream.feed(segment)
    good = tcp_frame(7, 1, b"\x03\0\0\0\1")
    # At most one frame's length may still be awaited; after that garbage ends in a wrong header.
    wrong = b"\xff" * 300
    stream.feed(wrong)
    if stream.feed(good) == [(7, 1, b"\x03\0\0\0\1")]:
        return
    stream.feed(wrong)
    assert stream.feed(good) == [(7, 1, b"\x03\0\0\0\1")]


@given(st.binary(max_size=260))
def test_any_pdu_is_answered(pdu: bytes) -> None:
    response = respond(Plain(dict.fromkeys(range(40), 0)), pdu)
    assert 2 <= len(response) <= 253
    assert response[0] & 0x7F == (pdu[0] & 0x7F if pdu else 0)
    if response[0] & 0x80 and pdu and pdu[0] in Plain.functions:
        assert response[1] in (2, 3)


KINDS = {"u16": (0, 0xFFFF), "i16": (-0x8000, 0x7FFF), "u32": (0, 2**32 - 1)}
KINDS["i32"] = (-(2**31), 2**31 - 1)


@given(st.sampled_from(sorted(KINDS)), st.booleans(), st.integers(-(2**33), 2**33))
def test_a_value_goes_through_its_words(kind: str, low_first: bool, value: int) -> None:
    low, high = KINDS[kind]
    one = Register("any", 0, kind, low_first, low=low, high=high)
    words = one.encode(value)
    assert all(0 <= word <= 0xFFFF for word in words)
    assert one.decode(words) == min(max(value, low), high)
