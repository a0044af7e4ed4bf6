"""Bytes: examples of the standard, agreement with pymodbus's framers, and whatever comes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU

from tautwave_drivers.modbus.protocol import frames
from tautwave_drivers.modbus.protocol.registers import blocks_of, from_words, to_words

UNIT = 17
RTU = FramerRTU(DecodePDU(False))
SOCKET = FramerSocket(DecodePDU(False))
WORD = st.integers(0, 0xFFFF)


def hexed(text: str) -> bytes:
    return bytes.fromhex(text)


# MODBUS Application Protocol Specification V1.1b3, the examples of 6.3, 6.4, 6.6, 6.12, 6.17, 6.21.
EXAMPLES = {
    "FC 3": (frames.read(3, 107, 3), "03 006B 0003", "03 06 022B 0000 0064"),
    "FC 4": (frames.read(4, 8, 1), "04 0008 0001", "04 02 000A"),
    "FC 6": (frames.write_one(1, 3), "06 0001 0003", "06 0001 0003"),
    "FC 16": (frames.write(1, (10, 258)), "10 0001 0002 04 000A 0102", "10 0001 0002"),
    "FC 23": (
        frames.read_write(3, 6, 14, (255, 255, 255)),
        "17 0003 0006 000E 0003 06 00FF 00FF 00FF",
        "17 0C 00FE 0ACD 0001 0003 000D 00FF",
    ),
    "FC 43": (
        frames.identify(),
        "2B 0E 01 00",
        "2B 0E 01 01 00 00 03 00 16 "
        + b"Company identification".hex()
        + "01 0D "
        + b"Product codeX".hex()
        + "02 05 "
        + b"V2.11".hex(),
    ),
}


@pytest.mark.parametrize("name", EXAMPLES)
def test_requests_and_responses_are_those_of_the_standard(name: str) -> None:
    request, sent, response = EXAMPLES[name]
    assert bytes(request.pdu) == hexed(sent)
    assert request.fits(hexed(response))
    assert request.fits(bytes((request.function | 0x80, 2)))
    assert not request.fits(bytes((request.function | 0x80, 2, 0)))
    frame = frames.rtu_frame(UNIT, hexed(response))
    assert frames.take_rtu(frame, UNIT, request) == hexed(response)
    assert frames.take_rtu(frame, UNIT + 1, request) is None
    assert frames.take_rtu(frame[:-1], UNIT, request) is None


def test_the_crc_is_that_of_the_standard() -> None:
    # MODBUS over Serial Line V1.02, 6.2.2: the CRC of 02 07 is 1241h, sent as 41 12.
    assert frames.rtu_frame(2, b"\x07") == hexed("02 07 41 12")


def test_the_identification_is_read() -> None:
    reported = frames.identity_of(hexed(EXAMPLES["FC 43"][2]))
    assert reported == {0: "Company identification", 1: "Product codeX", 2: "V2.11"}


@given(st.integers(1, 247), st.binary(min_size=1, max_size=250), WORD)
def test_frames_are_those_of_pymodbus(unit: int, pdu: bytes, transaction: int) -> None:
    assert frames.rtu_frame(unit, pdu) == RTU.encode(pdu, unit, 0)
    assert frames.tcp_frame(transaction, unit, pdu) == SOCKET.encode(pdu, unit, transaction)


@given(st.integers(1, 247), st.lists(WORD, min_size=1, max_size=4), st.lists(WORD, min_size=4))
def test_changed_words_make_the_frame_of_a_new_request(
    unit: int, first: list[int], more: list[int]
) -> None:
    second = more[: len(first)]
    for request, made in (
        (frames.write(18, first), frames.write(18, second)),
        (frames.read_write(2, 4, 18, first), frames.read_write(2, 4, 18, second)),
        (frames.write_one(18, first[0]), frames.write_one(18, second[0])),
    ):
        frames.rtu_request(unit, request)
        request.put(second if request.function != 6 else second[:1])
        assert request.pdu == made.pdu
        assert request.head == made.head
        assert frames.rtu_request(unit, request) == frames.rtu_frame(unit, bytes(made.pdu))


@given(st.lists(WORD, min_size=1, max_size=20), st.binary(max_size=12), st.binary(max_size=6))
def test_an_answer_is_found_between_noise(words: list[int], before: bytes, after: bytes) -> None:
    request = frames.read(3, 0, len(words))
    pdu = bytes((3, 2 * len(words))) + b"".join(word.to_bytes(2, "big") for word in words)
    found = frames.take_rtu(before + frames.rtu_frame(UNIT, pdu) + after, UNIT, request)
    assert found == pdu
    assert frames.words_of(pdu) == tuple(words)


@given(st.binary(max_size=300))
def test_no_bytes_raise(data: bytes) -> None:
    for request, _, _ in EXAMPLES.values():
        frames.take_rtu(data, UNIT, request)
        frames.take_rtu(bytes((UNIT,)) + request.head + data, UNIT, request)
    buffer = bytearray(data)
    while frames.take_tcp(buffer) is not None:
        pass
    frames.identity_of(data)


@given(st.lists(st.tuples(WORD, st.binary(min_size=2, max_size=60)), max_size=5), st.data())
def test_a_stream_is_cut_into_its_frames(
    responses: list[tuple[int, bytes]], data: st.DataObject
) -> None:
    stream = b"".join(frames.tcp_frame(number, 1, pdu) for number, pdu in responses)
    buffer = bytearray()
    found = []
    while stream:
        count = data.draw(st.integers(1, len(stream)))
        buffer += stream[:count]
        stream = stream[count:]
        while (one := frames.take_tcp(buffer)) is not None:
            found.append((one[0], one[2]))
    assert found == responses
    assert not buffer


@given(st.sampled_from(["u16", "i16", "u32", "i32"]), st.booleans(), st.integers(-(2**33), 2**33))
def test_values_survive_their_words(kind: str, low_first: bool, value: int) -> None:
    words = to_words(value, kind, low_first)
    back = from_words(words, kind, low_first)
    bits = 16 * len(words)
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if kind[0] == "i" else (0, (1 << bits) - 1)
    assert back == min(max(value, low), high)


def test_word_order() -> None:
    assert to_words(0x12345678, "u32") == (0x1234, 0x5678)
    assert to_words(0x12345678, "u32", low_first=True) == (0x5678, 0x1234)
    assert to_words(-2, "i32", low_first=True) == (0xFFFE, 0xFFFF)


def test_adjacent_registers_are_read_at_once_and_gaps_only_where_they_are_known() -> None:
    wanted = [("status", 2, 1), ("position", 4, 2), ("far", 90, 1)]
    known = frozenset({2, 3, 4, 5, 90})
    found = blocks_of(wanted, known, False, 16)
    assert [(one.address, one.words) for one in found] == [(2, 4), (90, 1)]
    found = blocks_of(wanted, known - {3}, False, 16)
    assert [(one.address, one.words) for one in found] == [(2, 1), (4, 2), (90, 1)]
    found = blocks_of(wanted, known, True, 100)
    assert [(one.address, one.words) for one in found] == [(2, 89)]


def test_a_request_of_several_units_has_the_head_of_each() -> None:
    """Also of unit 6, which is as much as its length."""
    request = frames.read(3, 2, 2)
    for unit in (9, 6, 1, 247, 6, 9):
        expected = frames.tcp_frame(7, unit, request.pdu)
        assert frames.tcp_request(7, unit, request) == expected, unit
