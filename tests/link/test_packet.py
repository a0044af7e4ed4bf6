"""The datagram: frames fixed to the byte, and any other bytes are refused for one clear reason."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.counters import SPAN
from tautwave.link.packet import (
    MAX_BYTES,
    Line,
    Packet,
    Refusal,
    packet_size,
    read_packet,
    write_packet,
)
from tautwave.sites.seal import OVERHEAD

SENT = Packet(
    0, 5, 1_000_000_007, 999_000_000, 12_345,
    (Line(7, 8, ((0x0A, 0x0B), (0xF_FFFF_FFFF_FFFF, 0x0C))),),
)  # fmt: skip
GOLDEN = bytes.fromhex(
    "01 00 01 01 00000000 0000000000000005"
    "000000003b9aca07 000000003b8b87c0 0000000000003039"
    "0000000000000007 0000000000000008"
    "000000000000000a 000000000000000b 000fffffffffffff 000000000000000c"
)

words = st.integers(0, 2**64 - 1)
counters = st.integers(0, SPAN - 1)


@st.composite
def packets(draw: st.DrawFn) -> Packet:
    repeated = draw(st.integers(0, 7))
    pair = st.tuples(counters, counters)
    line = st.builds(
        Line, counters, counters,
        st.lists(pair, min_size=repeated + 1, max_size=repeated + 1).map(tuple),
    )  # fmt: skip
    return Packet(
        draw(st.integers(0, 1)), draw(st.integers(repeated, SPAN - 1)),
        draw(words), draw(words), draw(words),
        tuple(draw(st.lists(line, min_size=1, max_size=6))),
    )  # fmt: skip


def test_the_golden_packet_is_written_and_read() -> None:
    assert write_packet(SENT) == GOLDEN
    assert read_packet(GOLDEN, 1) == SENT


@given(packets())
def test_what_is_written_is_read(packet: Packet) -> None:
    data = write_packet(packet)
    assert len(data) == packet_size(len(packet.lines), len(packet.lines[0].pairs) - 1)
    assert read_packet(data, 1 - packet.site) == packet


@given(st.binary(max_size=300))
@example(b"")
@example(GOLDEN[:-1])
@example(b"\x01\x01\xff\xff" + bytes(300))
def test_any_bytes_are_a_packet_or_a_refusal_and_nothing_raises(data: bytes) -> None:
    found = read_packet(data, 1)
    assert isinstance(found, Refusal) or write_packet(found) == data


@given(packets(), st.data())
def test_a_packet_cut_or_lengthened_is_refused(packet: Packet, data: st.DataObject) -> None:
    good = write_packet(packet)
    at = data.draw(st.integers(0, len(good) - 1))
    for bad in (good[:at], good + good[at:]):
        assert isinstance(read_packet(bad, 1 - packet.site), Refusal)


@pytest.mark.parametrize(
    ("data", "site", "why"),
    [
        (GOLDEN[:60], 1, Refusal.SHORT),
        (b"\x02" + GOLDEN[1:], 1, Refusal.VERSION),
        (GOLDEN[:2] + b"\x02" + GOLDEN[3:], 1, Refusal.LENGTH),
        (GOLDEN[:2] + b"\x00" + GOLDEN[3:], 1, Refusal.LENGTH),
        (GOLDEN, 0, Refusal.SITE),
        (GOLDEN[:1] + b"\x02" + GOLDEN[2:], 1, Refusal.RANGE),
        (GOLDEN[:6] + b"\x00\x01" + GOLDEN[8:], 1, Refusal.RANGE),
        (GOLDEN[:8] + bytes(8) + GOLDEN[16:], 1, Refusal.RANGE),
        (GOLDEN[:8] + b"\x01" + GOLDEN[9:], 1, Refusal.RANGE),
        (GOLDEN[:72] + b"\x00\x1f" + GOLDEN[74:], 1, Refusal.RANGE),
    ],
)
def test_each_refusal_says_what_is_wrong(data: bytes, site: int, why: Refusal) -> None:
    found = read_packet(data, site)
    assert found is why
    assert f"a payload {found.value}".count(".") == 0  # the rest of a sentence


def test_a_payload_longer_than_any_path_takes_is_refused_unread() -> None:
    data = GOLDEN[:2] + bytes((6, 12)) + GOLDEN[4:16] + bytes(24 + 6 * (2 + 26) * 8)
    assert len(data) == packet_size(6, 12) > MAX_BYTES
    assert read_packet(data, 1) is Refusal.LENGTH


def test_the_seal_leaves_room_on_every_path() -> None:
    assert MAX_BYTES + OVERHEAD <= 1200


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        ((), "at least one"),
        ((Line(0, 0, ()),), "at least one"),
        ((Line(0, 0, ((0, 0),)), Line(0, 0, ((0, 0), (0, 0)))), "repeat the same"),
        ((Line(0, 0, ((0, 0),) * 80),), "repeat fewer"),
    ],
)
def test_a_packet_that_cannot_be_is_not_written(lines: tuple[Line, ...], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        write_packet(SENT._replace(lines=lines))
