"""The codec: stuffing both ways, and packets found again whatever lies between them."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.wire import packets1 as p1
from tests.sim.dynamixel.line import Host

PARSERS = [p2, p1]
NASTY = st.lists(
    st.sampled_from([b"\xff", b"\xfd", b"\x00", b"\xff\xff\xfd", b"\x01"]), max_size=20
)
BYTES = st.one_of(st.binary(max_size=60), NASTY.map(b"".join))


@given(BYTES)
def test_stuffing_comes_back_and_hides_the_header(body: bytes) -> None:
    stuffed = p2.stuff(body)
    assert p2.unstuff(stuffed) == body
    assert p2.HEADER not in stuffed
    assert stuffed.count(p2.STUFFED) == stuffed.count(p2.STUFFED + b"\xfd")


@given(BYTES, st.integers(0, 252), st.integers(1, 0x9A).filter(lambda code: code != p2.STATUS))
def test_a_packet_comes_back(params: bytes, device_id: int, code: int) -> None:
    found = p2.Parser().feed(p2.frame(device_id, bytes((code,)) + params))
    assert [one for one, _ in found] == [p2.Packet(device_id, code, params, True)]


@pytest.mark.parametrize("codec", PARSERS)
@given(garbage=BYTES, cuts=st.lists(st.integers(0, 90), max_size=4))
def test_a_packet_is_found_behind_anything(codec: object, garbage: bytes, cuts: list[int]) -> None:
    if codec is p1:
        # No stuffing there: a length in the garbage may swallow a packet, and silence ends it.
        parser: p1.Parser | p2.Parser = p1.Parser()
        parser.feed(garbage)
        parser.reset()
        good = p1.frame(7, b"\x02\x24\x02")
        found = parser.feed(good)
    else:
        parser = p2.Parser()
        good = p2.frame(7, b"\x02\x84\x00\x04\x00")
        stream, found = garbage + good, []
        edges = sorted({0, len(stream), *(cut for cut in cuts if cut < len(stream))})
        for first, last in itertools.pairwise(edges):
            found += parser.feed(stream[first:last])
    assert [one.device_id for one, _ in found if one.intact][-1:] == [7]


@pytest.mark.parametrize("noise", [b"", b"\x00\xff", b"\xff\xff\xfd"])
def test_a_packet_may_come_in_two_pieces_cut_anywhere(noise: bytes) -> None:
    good = p2.frame(7, b"\x01")
    for cut in range(1, len(noise + good)):
        parser, stream = p2.Parser(), noise + good
        found = parser.feed(stream[:cut]) + parser.feed(stream[cut:])
        assert found == [(p2.Packet(7, p2.PING, b"", True), len(stream))], cut


def test_bytes_before_a_header_are_no_part_of_a_packet() -> None:
    good = p1.frame(7, b"\x02\x24\x02")
    assert p1.Parser().feed(b"\x00\x00\x13\x05" + good) == [
        (p1.Packet(7, 2, b"\x24\x02", True), 4 + len(good))
    ]


@pytest.mark.parametrize("missing", [1, 2, 3, 5, 9])
def test_a_packet_cut_short_is_no_checksum_error(missing: int) -> None:
    """The next header may stand where its checksum should have been."""
    good = p2.frame(1, b"\x01")
    found = p2.Parser().feed(p2.frame(1, b"\x02\x84\x00\x04\x00")[:-missing] + good)
    assert [one for one, _ in found] == [p2.Packet(1, p2.PING, b"", True)]


@given(garbage=BYTES)
def test_the_end_of_a_packet_is_where_its_last_byte_is(garbage: bytes) -> None:
    good = p2.frame(7, b"\x01")
    found = p2.Parser().feed(garbage + good + b"\xff\xff")
    assert found[-1][1] == len(garbage + good)


@given(st.lists(BYTES, max_size=6))
def test_random_bytes_never_raise_and_the_servo_still_answers(chunks: list[bytes]) -> None:
    host = Host((1, 2))
    for chunk in chunks:
        host.send(chunk)
        host.hear()
    host.pass_time(0.2)
    assert host.ask(1, p2.PING)[:9] == p2.status(1, 0, b"\xfc\x03\x30")[:9]


@given(st.integers(1, 0x9A), BYTES, st.sampled_from([0, 1, 2, 0xFE]))
def test_any_instruction_with_any_parameters_never_raises(
    code: int, params: bytes, device_id: int
) -> None:
    host = Host((1, 2))
    host.talk(p2.frame(device_id, bytes((code,)) + params))
    old = Host((1,), "AX-12A")
    old.talk(p1.frame(device_id, bytes((code,)) + params))


def test_every_16_bit_current_survives_both_ways() -> None:
    """All values, next to bytes that make FF FF FD with them on either side."""
    for value in range(-32768, 32768):
        raw = value.to_bytes(2, "little", signed=True)
        for body in (
            b"\x83\x66\x00\x02\x00\xff" + raw,
            raw + b"\xfd\xff\xff",
            b"\xff" + raw + b"\xfd",
        ):
            if not body.count(b"\xff\xff\xfd"):
                continue
            stuffed = p2.stuff(body)
            assert p2.unstuff(stuffed) == body
            assert len(stuffed) > len(body)


def test_every_32_bit_value_with_ff_ff_fd_survives_both_ways() -> None:
    around = (b"", b"\xff", b"\xff\xff", b"\xfd", b"\xfd\xff\xff")
    for byte in range(256):
        for raw in (b"\xff\xff\xfd" + bytes((byte,)), bytes((byte,)) + b"\xff\xff\xfd"):
            for before in around:
                for behind in around:
                    body = b"\x83" + before + raw + behind
                    [(packet, _)] = p2.Parser().feed(p2.frame(1, body))
                    assert packet == p2.Packet(1, 0x83, body[1:], True)


@pytest.mark.parametrize("velocity", [-3, -515])  # FD FF FF FF and FD FD FF FF behind the current
def test_every_current_survives_the_wire_both_ways(velocity: int) -> None:
    """Goal Current -1 in front of a velocity that begins with FD is FF FF FD on the wire."""
    host = Host((1,), "XL330-M288", simulator={"factory": False})
    head = bytes((p2.SYNC_WRITE, 102, 0, 6, 0, 1))
    tail = velocity.to_bytes(4, "little", signed=True)
    stuffed = 0
    for current in [*range(-445, 446), -1750, 1750]:
        data = current.to_bytes(2, "little", signed=True) + tail
        if velocity < -445:
            host.servos[0].memory.poke("Velocity Limit", 2047)
        host.talk(p2.frame(p2.BROADCAST, head + data), wait_ns=600_000)
        response = host.talk(p2.frame(1, bytes((p2.READ, 102, 0, 6, 0))), wait_ns=900_000)
        stuffed += len(response) > 17
        assert p2.unstuff(response[7:-2])[2:] == data
    assert stuffed == 1


@given(
    st.sampled_from([b"\xff\xff\xfd", b"\xff\xff\xfd\xfd", b"\xfd\xff\xff", b"\xff\xff\xff\xfd"]),
    st.binary(min_size=1, max_size=1),
)
def test_32_bit_values_with_ff_ff_fd_survive_the_wire(core: bytes, rest: bytes) -> None:
    raw = (core + rest)[:4]
    host = Host((1,), simulator={"factory": False})
    host.write(1, "Operating Mode", 4)
    item = host.servos[0].memory.items["Goal Position"]
    value = item.decode(raw)
    expected = 0 if item.low <= value <= item.high else p2.RANGE_ERROR
    assert host.write(1, "Goal Position", value) == expected
    if not expected:
        assert host.read(1, "Goal Position") == value


def test_goal_velocity_minus_131073_is_stuffed_in_the_answer_too() -> None:
    host = Host((1,), "XM430-W350")
    host.servos[0].memory.poke("Goal Velocity", -131073)  # FF FF FD FF
    response = host.ask(1, p2.READ, 104, 0, 4, 0)
    assert b"\xff\xff\xfd\xfd\xff" in response[7:]
    assert len(response) == 16
    assert host.read(1, "Goal Velocity") == -131073


def test_what_the_sdk_leaves_unstuffed_is_understood() -> None:
    """dynamixel-sdk 4.1 does not stuff what it sends: FF FF FD FF stands as it is."""
    host = Host((1,), simulator={"servos": {1: {"registers": {"Operating Mode": 4}}}})
    head = p2.HEADER + bytes((1, 9, 0, p2.WRITE, 116, 0)) + b"\xff\xff\xfd\xff"
    response = host.talk(head + p2.crc16(head).to_bytes(2, "little"))
    assert response[8] == 0
    assert host.read(1, "Goal Position") == -131073
