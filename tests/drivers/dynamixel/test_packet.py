"""Protocol 2.0 byte for byte as the e-manual prints it, and whatever a wire may do to it.

Examples: ROBOTIS e-manual, "DYNAMIXEL Protocol 2.0" (docs/en/dxl/protocol2), "Instruction
Details": the packets of its tables, CRC included.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.clock import FakeClock
from tautwave_drivers.dynamixel.exchange import Exchange, Goals, Timing
from tautwave_drivers.dynamixel.fast_path import FIELDS, FastPath
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol.fast import FastStatus
from tautwave_drivers.dynamixel.protocol.registers import GOAL_CURRENT, GOAL_VELOCITY
from tautwave_sim.dynamixel import packets as servo_codec


def hexed(text: str) -> bytes:
    return bytes.fromhex(text)


INSTRUCTIONS = {
    "ping 1": (packet.build(1, packet.PING), "FFFFFD00 01 0300 01 194E"),
    "ping all": (packet.build(packet.BROADCAST, packet.PING), "FFFFFD00 FE 0300 01 3142"),
    "read": (packet.read_packet(1, 132, 4), "FFFFFD00 01 0700 02 84000400 1D15"),
    "write": (
        packet.write_packet(1, 116, (512).to_bytes(4, "little")),
        "FFFFFD00 01 0900 03 7400 00020000 CA89",
    ),
    "reg write": (
        packet.write_packet(1, 104, (200).to_bytes(4, "little"), packet.REG_WRITE),
        "FFFFFD00 01 0900 04 6800 C8000000 AE8E",
    ),
    "action": (packet.build(1, packet.ACTION), "FFFFFD00 01 0300 05 02CE"),
    "factory reset": (packet.build(1, 0x06, b"\x01"), "FFFFFD00 01 0400 06 01 A1E6"),
    "reboot": (packet.build(1, packet.REBOOT), "FFFFFD00 01 0300 08 2F4E"),
    "clear": (
        packet.build(1, packet.CLEAR, hexed("01 44584C22")),
        "FFFFFD00 01 0800 10 01 44584C22 B1DC",
    ),
    "sync read": (
        packet.sync_read_packet((1, 2), 132, 4),
        "FFFFFD00 FE 0900 82 84000400 0102 CEFA",
    ),
    "sync write": (
        packet.sync_write_packet(
            116, 4, [(1, (150).to_bytes(4, "little")), (2, (170).to_bytes(4, "little"))]
        ),
        "FFFFFD00 FE 1100 83 74000400 01 96000000 02 AA000000 8287",
    ),
    "bulk read": (
        packet.build(packet.BROADCAST, packet.BULK_READ, hexed("01 9000 0200 02 9200 0100")),
        "FFFFFD00 FE 0D00 92 01 9000 0200 02 9200 0100 1A05",
    ),
    "bulk write": (
        packet.build(packet.BROADCAST, packet.BULK_WRITE, hexed("01200002 00A00002 1F000100 50")),
        "FFFFFD00 FE 1000 93 01 2000 0200 A000 02 1F00 0100 50 B768",
    ),
}

STATUS = {
    "ping 1": ("FFFFFD00 01 0700 55 00 060426 655D", 1, 0, "060426"),
    "ping 2": ("FFFFFD00 02 0700 55 00 060426 6F6D", 2, 0, "060426"),
    "read": ("FFFFFD00 01 0800 55 00 A6000000 8CC0", 1, 0, "A6000000"),
    "write": ("FFFFFD00 01 0400 55 00 A10C", 1, 0, ""),
    "sync read 2": ("FFFFFD00 02 0800 55 00 1F080000 BABE", 2, 0, "1F080000"),
    "bulk read 1": ("FFFFFD00 01 0600 55 00 7700 C369", 1, 0, "7700"),
    "bulk read 2": ("FFFFFD00 02 0500 55 00 24 8BA9", 2, 0, "24"),
}


@pytest.mark.parametrize("name", INSTRUCTIONS)
def test_instructions_are_those_of_the_e_manual(name: str) -> None:
    built, printed = INSTRUCTIONS[name]
    assert built == hexed(printed)


@pytest.mark.parametrize("name", STATUS)
def test_status_packets_of_the_e_manual_are_read(name: str) -> None:
    printed, device_id, error, data = STATUS[name]
    found = packet.take_packet(bytearray(hexed(printed)))
    assert found is not None
    assert (found.device_id, found.instruction, found.error) == (device_id, packet.STATUS, error)
    assert found.data == hexed(data)


@pytest.mark.parametrize("name", STATUS)
def test_status_packets_of_the_e_manual_are_built(name: str) -> None:
    printed, device_id, error, data = STATUS[name]
    assert packet.build(device_id, packet.STATUS, bytes((error,)) + hexed(data)) == hexed(printed)


TRICKY = st.lists(
    st.sampled_from([0xFF, 0xFD, 0x00, 0x55, 0x01]) | st.integers(0, 255), max_size=40
).map(bytes)


@given(st.integers(0, 253), TRICKY)
def test_what_is_built_is_read_back(device_id: int, params: bytes) -> None:
    built = packet.build(device_id, packet.WRITE, params)
    assert packet.HEADER not in built[4:-2]
    assert packet.take_packet(bytearray(built)) == (device_id, packet.WRITE, params)


@given(TRICKY)
def test_stuffing_is_undone(data: bytes) -> None:
    assert packet.unstuff(packet.stuff(data)) == data


@given(st.lists(TRICKY | TRICKY.map(lambda p: packet.build(1, 3, p)), max_size=6), st.data())
def test_bytes_never_raise_and_packets_come_through_in_any_pieces(
    parts: list[bytes], data: st.DataObject
) -> None:
    last = packet.build(9, packet.STATUS, b"\x00\x2a")
    # What is left of a packet that never ends may swallow the next: silence ends it in the driver.
    stream = b"".join(parts) + bytes(40) + last
    buffer = bytearray()
    found = []
    while stream:
        count = data.draw(st.integers(1, 20))
        buffer += stream[:count]
        stream = stream[count:]
        while (one := packet.take_packet(buffer, longest=30)) is not None:
            found.append(one)
    assert (9, packet.STATUS, b"\x00\x2a") in found


@pytest.mark.slow
@pytest.mark.parametrize("register", [GOAL_CURRENT, GOAL_VELOCITY], ids=lambda r: r.name)
def test_goals_go_out_as_their_register_holds_them(register: object) -> None:
    """All 16-bit patterns; of the 32-bit ones those of two 16-bit halves that look dangerous."""
    if register is GOAL_CURRENT:
        values = range(-32_768, 32_768)
    else:
        halves = [0, 1, 0xFF, 0xFD, 0xFFFF, 0xFDFF, 0xFFFD, 0xFF00, 0x00FF, 0xFE, 0x7FFF]
        values = [struct.unpack("<i", struct.pack("<HH", *p))[0] for p in _pairs(halves)]
    goals = Goals(register, (253, 255 - 2))  # ids whose bytes look dangerous too
    size = register.size
    for value in values:
        goals.put(0, value)
        goals.put(1, -value if value > -(1 << 8 * size - 1) else value)
        sent = goals.packet()
        assert packet.PATTERN not in sent[7:-2].replace(packet.STUFFED, b"")
        [(found, _)] = servo_codec.Parser().feed(sent)
        assert found.intact
        assert found.instruction == packet.SYNC_WRITE
        params = found.params
        assert int.from_bytes(params[5 : 5 + size], "little", signed=True) == value


@pytest.mark.slow
def test_every_current_comes_back_from_the_servos_own_codec() -> None:
    """Before a velocity that begins with FD, too: FF FF FD over the border of two registers."""
    usual = FastPath((1,), FIELDS, fast=False)
    stuffed = 0
    for current in range(-32_768, 32_768):
        block = struct.pack("<hii", current, 0xFD, -3)
        response = servo_codec.status(1, 0, block)
        found = usual.take(response)
        if found is None:
            stuffed += 1
            one = packet.take_packet(bytearray(response), longest=17)
            assert one is not None
            found = [(one.error, *struct.unpack("<hii", one.data))]
        assert found == [(0, current, 0xFD, -3)]
    assert stuffed == 1


def _pairs(halves: list[int]) -> list[tuple[int, int]]:
    return [(low, high) for low in halves for high in halves]


def sync_answer(values: list[tuple[int, int, int]], errors: list[int]) -> bytes:
    return b"".join(
        packet.build(number, packet.STATUS, bytes((error,)) + struct.pack("<hii", *one))
        for number, (one, error) in enumerate(zip(values, errors, strict=True), 1)
    )


def fast_answer(
    values: list[tuple[int, int, int]], errors: list[int], count: int = 0, ids: Sequence[int] = ()
) -> bytes:
    reported = packet.HEADER + bytes(
        (0xFE, *((count or len(values)) * 14 + 1).to_bytes(2, "little"))
    )
    reported += bytes((packet.STATUS,))
    numbers = ids or range(1, len(values) + 1)
    for number, one, error in zip(numbers, values, errors, strict=True):
        reported += bytes((error, number)) + struct.pack("<hii", *one)
        reported += packet.crc16(reported).to_bytes(2, "little")
    return reported


INT16 = st.sampled_from([-1, -3, 0, -32768, 0x7FFF]) | st.integers(-32768, 32767)
INT32 = st.sampled_from([-1, -3, 0xFFFD, -131_073, 2**31 - 1]) | st.integers(-(2**31), 2**31 - 1)
SAMPLES = st.lists(st.tuples(INT16, INT32, INT32), min_size=1, max_size=4)


@given(SAMPLES, st.booleans(), st.data())
@example([(-1, 0x00FD, 0)], False, None).via("FF FF FD over the border of two registers")
def test_the_usual_answer_is_what_the_careful_parsers_read(
    values: list[tuple[int, int, int]], fast: bool, data: st.DataObject | None
) -> None:
    errors = (
        [0] * len(values)
        if data is None
        else data.draw(
            st.lists(st.sampled_from([0, 0x80]), min_size=len(values), max_size=len(values))
        )
    )
    ids = range(1, len(values) + 1)
    response = (fast_answer if fast else sync_answer)(values, errors)
    want = [(error, *one) for error, one in zip(errors, values, strict=True)]
    usual = FastPath(ids, FIELDS, fast=fast).take(response)
    stuffed = not fast and packet.STUFFED in response
    assert usual == (None if stuffed else want)
    if fast:
        reported = [one[:3] for one in FastStatus(len(values), 10).take(bytearray(response))]
    else:
        buffer, reported = bytearray(response), []
        while (one := packet.take_packet(buffer)) is not None:
            reported.append((one.device_id, one.error, one.data))
    read = [(error, *struct.unpack("<hii", block)) for _, error, block in reported]
    assert read == want


@given(SAMPLES, st.booleans(), st.data())
def test_a_broken_byte_is_never_usual(
    values: list[tuple[int, int, int]], fast: bool, data: st.DataObject
) -> None:
    response = bytearray((fast_answer if fast else sync_answer)(values, [0] * len(values)))
    at = data.draw(st.integers(0, len(response) - 1))
    response[at] ^= data.draw(st.integers(1, 255))
    ids = range(1, len(values) + 1)
    assert FastPath(ids, FIELDS, fast=fast).take(bytes(response)) is None


def test_a_fast_answer_that_ends_early_gives_what_came() -> None:
    values = [(5, -6, 7), (-1, 2, 3)]
    whole = fast_answer(values, [0, 0x80], count=3)
    parser = FastStatus(3, 10)
    buffer = bytearray()
    found = []
    for byte in b"\x00\xff" + whole:
        buffer.append(byte)
        found += parser.take(buffer)
    assert found == [
        (1, 0, struct.pack("<hii", *values[0]), 0),
        (2, 0x80, struct.pack("<hii", *values[1]), 1),
    ]


def test_fast_data_is_believed_only_with_its_checksum_or_the_last_one() -> None:
    values = [(5, -6, 7), (-1, 2, 3)]
    whole = bytearray(fast_answer(values, [0, 0]))
    whole[20] ^= 1  # the first servo's own checksum
    assert FastStatus(2, 10).take(whole) == []
    # Servos whose own checksum means something else, but whose last one covers all.
    whole[-2:] = packet.crc16(whole[:-2]).to_bytes(2, "little")
    assert [one[0] for one in FastStatus(2, 10).take(whole)] == [2, 1]


@given(st.binary(min_size=1, max_size=30), st.integers(0, 0xFFFF))
def test_the_fast_checksum_is_the_slow_one(data: bytes, crc: int) -> None:
    fixed = packet.FixedCrc(len(data))
    assert fixed(data, fixed.start(crc)) == packet.crc16(data, crc)


class Line:
    """A line on which bytes appear."""

    def __init__(self) -> None:
        self.inbox = b""

    def write(self, data: bytes) -> None:
        """Let the request go nowhere."""

    def read(self) -> bytes:
        data, self.inbox = self.inbox, b""
        return data

    def readable(self) -> bool:
        return bool(self.inbox)

    def next_event_ns(self) -> None:
        return None

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""


@pytest.mark.parametrize("ids", [(1, 2), (2, 1), (1, 7), (1, 1)])
def test_a_fast_answer_of_others_than_were_asked_in_this_order_is_nobodys(
    ids: tuple[int, int],
) -> None:
    line, clock = Line(), FakeClock()
    timing = Timing(1_000_000, 0.0, 0.0)
    exchange = Exchange(line, clock, (1, 2), 126, FIELDS, timing, fast=True)  # type: ignore[arg-type]
    exchange.send(b"", clock.now_ns())
    values = [(1, 2, 3), (4, 5, 6)]
    line.inbox = fast_answer(values, [0, 0], ids=ids)
    missing = exchange.collect(clock.now_ns() + 5_000_000)
    right = ids == (1, 2)
    assert exchange.values == ([(0, *one) for one in values] if right else [None, None])
    assert missing == (0 if right else 2)
