"""The datagram: frames fixed to the byte, and any other bytes are refused for one clear reason."""

from __future__ import annotations

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from tautwave.laws.counters import SPAN
from tautwave.link.packet import (
    GREATEST_BYTES,
    KEY_BYTES,
    Line,
    Packet,
    Refusal,
    packet_size,
    read_packet,
    seal_of,
    write_packet,
)

KEY = bytes(range(KEY_BYTES))
SESSION = 0x0123456789ABCDEF
SENT = Packet(
    SESSION, 0, 0x1001, 5, 1_000_000_007, 999_000_000, 12_345,
    (Line(7, 8, ((0x0A, 0x0B), (0xF_FFFF_FFFF_FFFF, 0x0C))),),
)  # fmt: skip
GOLDEN = bytes.fromhex(
    "7477 01 00 01 01 0000"
    "0123456789abcdef 0000000000001001 0000000000000005"
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
        SESSION, draw(st.integers(0, 1)), draw(words), draw(st.integers(repeated, SPAN - 1)),
        draw(words), draw(words), draw(words),
        tuple(draw(st.lists(line, min_size=1, max_size=6))),
    )  # fmt: skip


def test_the_golden_packet_is_written_and_read() -> None:
    data = write_packet(SENT, KEY)
    assert data[:-16] == GOLDEN
    assert data[-16:].hex() == "0f89151ea7ef677f7980681efb7bf2ff"
    assert read_packet(data, KEY, SESSION, 1) == SENT


@given(packets())
def test_what_is_written_is_read(packet: Packet) -> None:
    data = write_packet(packet, KEY)
    assert len(data) == packet_size(len(packet.lines), len(packet.lines[0].pairs) - 1)
    assert read_packet(data, KEY, SESSION, 1 - packet.site) == packet


@given(st.binary(max_size=300))
@example(b"")
@example(GOLDEN)
@example(GOLDEN[:56] + bytes(16))
@example(b"tw\x01\x01\xff\xff" + bytes(300))
def test_any_bytes_are_refused_and_nothing_raises(data: bytes) -> None:
    assert isinstance(read_packet(data, KEY, SESSION, 1), Refusal)


@given(packets(), st.data())
def test_a_packet_changed_in_a_bit_is_refused(packet: Packet, data: st.DataObject) -> None:
    good = bytearray(write_packet(packet, KEY))
    bit = data.draw(st.integers(0, 8 * len(good) - 1))
    good[bit // 8] ^= 1 << bit % 8
    assert isinstance(read_packet(bytes(good), KEY, SESSION, 1 - packet.site), Refusal)


@given(packets(), st.data())
def test_a_packet_cut_or_lengthened_is_refused(packet: Packet, data: st.DataObject) -> None:
    good = write_packet(packet, KEY)
    at = data.draw(st.integers(0, len(good) - 1))
    for bad in (good[:at], good + good[at:]):
        assert isinstance(read_packet(bad, KEY, SESSION, 1 - packet.site), Refusal)


def sealed(content: bytes) -> bytes:
    return content + seal_of(content, KEY)


@pytest.mark.parametrize(
    ("data", "session", "site", "why"),
    [
        (b"xx" + GOLDEN[2:] + bytes(16), SESSION, 1, Refusal.FOREIGN),
        (GOLDEN[:70], SESSION, 1, Refusal.FOREIGN),
        (sealed(GOLDEN[:2] + b"\x02" + GOLDEN[3:]), SESSION, 1, Refusal.VERSION),
        (sealed(GOLDEN[:4] + b"\x02" + GOLDEN[5:]), SESSION, 1, Refusal.LENGTH),
        (sealed(GOLDEN[:4] + b"\x00" + GOLDEN[5:]), SESSION, 1, Refusal.LENGTH),
        (sealed(GOLDEN), SESSION + 1, 1, Refusal.SESSION),
        (sealed(GOLDEN), SESSION, 0, Refusal.SITE),
        (GOLDEN + bytes(16), SESSION, 1, Refusal.FORGED),
        (sealed(GOLDEN[:3] + b"\x02" + GOLDEN[4:]), SESSION, 1, Refusal.RANGE),
        (sealed(GOLDEN[:6] + b"\x00\x01" + GOLDEN[8:]), SESSION, 1, Refusal.RANGE),
        (sealed(GOLDEN[:24] + bytes(8) + GOLDEN[32:]), SESSION, 1, Refusal.RANGE),
        (sealed(GOLDEN[:88] + b"\x00\x1f" + GOLDEN[90:]), SESSION, 1, Refusal.RANGE),
        (sealed(GOLDEN[:24] + b"\x01" + GOLDEN[25:]), SESSION, 1, Refusal.RANGE),
    ],
)
def test_each_refusal_says_what_is_wrong(
    data: bytes, session: int, site: int, why: Refusal
) -> None:
    found = read_packet(data, KEY, session, site)
    assert found is why
    assert f"a datagram {found.value}".count(".") == 0  # the rest of a sentence


def test_another_key_does_not_fit() -> None:
    assert read_packet(write_packet(SENT, KEY), KEY[::-1], SESSION, 1) is Refusal.FORGED


def test_a_datagram_longer_than_any_path_takes_is_refused_unread() -> None:
    content = GOLDEN[:4] + bytes((6, 12)) + GOLDEN[6:32] + bytes(24 + 6 * (2 + 26) * 8)
    assert len(content) + 16 == packet_size(6, 12) > GREATEST_BYTES
    assert read_packet(sealed(content), KEY, SESSION, 1) is Refusal.LENGTH


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
        write_packet(SENT._replace(lines=lines), KEY)
