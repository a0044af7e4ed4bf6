"""What simulated drives answer: function codes, exceptions in the standard's order, broadcast."""

from __future__ import annotations

import struct

import pytest

from tests.sim.modbus.masters import Bench, pair, read, read_write, words, write_many, write_one

LINKS = pytest.mark.parametrize("link", ["tcp", "rtu"])


@LINKS
def test_the_state_of_a_drive_comes_in_one_block(link: str) -> None:
    bench = Bench(link)
    assert words(bench.ask(read(0, 9))) == [0x5457, 1, 1, 0, 0, 0, 0, 0, 0]
    assert words(bench.ask(read(41, 4))) == [*pair(65536), *pair(1000)]
    assert words(bench.ask(read(0, 1, function=4))) == [0x5457]


@LINKS
def test_writing_one_and_many(link: str) -> None:
    bench = Bench(link)
    assert bench.ask(write_one(17, 2)) == write_one(17, 2)
    assert bench.ask(write_many(19, *pair(-1234))) == struct.pack(">BHH", 16, 19, 2)
    assert bench.number("mode") == 2
    assert bench.number("target_velocity") == -1234


@LINKS
def test_reading_and_writing_at_once_writes_first(link: str) -> None:
    bench = Bench(link)
    assert words(bench.ask(read_write(17, 2, 17, 1, 500))) == [1, 500]


@pytest.mark.parametrize(
    ("pdu", "code"),
    [
        (bytes([1, 0, 0, 0, 1]), 1),  # coils: no drive has any
        (bytes([43, 14, 1, 0]), 1),
        (b"", 1),
        (read(0, 0), 3),
        (read(0, 126), 3),
        (read(0, 125), 2),  # the count is right, the addresses are not
        (read(9, 1), 2),
        (read(8, 2), 2),
        (read(0xFFFF, 2), 2),
        (read(0, 1) + b"\0", 3),
        (write_one(2, 1), 2),  # status: read only
        (write_one(100, 1), 2),
        (write_one(17, 3), 3),  # no such mode
        (write_one(18, 3001), 3),
        (bytes([6, 0]), 3),
        (write_many(17, *(0,) * 124), 3),
        (write_many(17), 3),
        (bytes.fromhex("10 0011 0002 02 0001"), 3),  # byte count of one word
        (bytes.fromhex("10 0011 0001 02 0001 00"), 3),
        (bytes.fromhex("10 0011 0001 04 0001"), 3),
        (write_many(22, 0, 0), 2),
        (read_write(0, 126, 17, 0), 3),
        (read_write(0, 0, 17, 0), 3),
        (read_write(0, 1, 17, *(0,) * 122), 3),
        (read_write(0, 1, 2, 0), 2),
        (read_write(9, 1, 17, 2), 2),
    ],
)
def test_exceptions(pdu: bytes, code: int) -> None:
    bench = Bench("tcp")
    before = dict(bench.drive().bank.values)
    function = pdu[0] if pdu else 0
    fits = 1 <= len(pdu) <= 253  # what is no PDU of the standard cannot come in a frame
    got = bench.ask(pdu) if fits else bench.simulator.bus.handle(1, pdu, 0)[0]
    assert got == bytes([function | 0x80, code])
    assert bench.drive().bank.values == before


@pytest.mark.parametrize(
    ("profile", "refused"), [("dsy-rs", (4, 23)), ("cia402", (23,)), ("generic", ())]
)
def test_a_family_knows_its_function_codes(profile: str, refused: tuple[int, ...]) -> None:
    bench = Bench("rtu", profile)
    address = min(bench.drive().bank.addresses())
    pdus = {3: read(address), 4: read(address, function=4), 23: read_write(address, 1, address, 0)}
    for function, pdu in pdus.items():
        response = bench.ask(pdu)
        assert response is not None
        assert (response == bytes([function | 0x80, 1])) == (function in refused)


def test_function_codes_can_be_taken_from_a_drive() -> None:
    bench = Bench("tcp", device={"function_codes": [3, 6]})
    assert bench.ask(write_many(17, 2)) == bytes([0x90, 1])
    assert bench.ask(write_one(17, 2)) == write_one(17, 2)


@LINKS
def test_a_broadcast_is_done_by_all_and_answered_by_none(link: str) -> None:
    bench = Bench(link, units=(1, 2))
    assert bench.ask(write_one(17, 1), unit=0) is None
    assert [bench.number("mode", unit) for unit in (1, 2)] == [1, 1]
    for pdu in (read(0), read_write(17, 1, 17, 2)):  # what asks for an answer is no broadcast
        assert bench.ask(pdu, unit=0) is None
    assert [bench.number("mode", unit) for unit in (1, 2)] == [1, 1]


def test_nobody_answers_for_a_unit_that_is_not_on_the_line() -> None:
    assert Bench("rtu").ask(read(0), unit=9) is None


def test_a_gateway_says_that_a_unit_is_not_behind_it() -> None:
    assert Bench("tcp").ask(read(0), unit=9) == bytes([0x83, 0x0B])


def test_unit_255_is_the_only_drive_behind_an_endpoint() -> None:
    assert words(Bench("tcp").ask(read(0), unit=255)) == [0x5457]
    assert Bench("tcp", units=(1, 2)).ask(read(0), unit=255) == bytes([0x83, 0x0B])


def test_half_of_a_value_keeps_the_other_half() -> None:
    bench = Bench()
    bench.set("target_position", 0x12345678)
    bench.ask(write_one(22, 0x9ABC))
    assert bench.number("target_position") == 0x12349ABC


def test_a_range_is_checked_before_anything_is_written() -> None:
    bench = Bench()
    assert bench.ask(write_many(17, 1, 3001)) == bytes([0x90, 3])
    assert bench.number("mode") == 0


def test_gaps_that_read_as_zero() -> None:
    bench = Bench(quirks={"gaps_read_zero": True})
    assert words(bench.ask(read(8, 9))) == [0] * 9
    assert bench.ask(write_one(9, 1)) == bytes([0x86, 2])


def test_requests_of_one_segment_are_all_answered() -> None:
    from tautwave_sim.modbus.wire.framing import tcp_frame

    bench = Bench(units=(1, 2))
    got = bench.bytes_back(tcp_frame(1, 1, read(0)) + tcp_frame(2, 2, read(1)))
    assert got == tcp_frame(1, 1, bytes.fromhex("03025457")) + tcp_frame(
        2, 2, bytes.fromhex("03020001")
    )
