"""Bits of CAN frames: against a reference written bit by bit, published tables, the worst case."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_sim.wire.can import (
    PLAIN,
    CanTiming,
    frame_bits,
    worst_fd_bits,
)

ids = st.integers(0, 0x7FF)
payloads = st.binary(max_size=8)


def worst_frame_bits(size: int) -> int:
    """Return the most bits that a classic data frame of `size` bytes can have."""
    return PLAIN + 8 * size + (33 + 8 * size) // 4


def bits_of(can_id: int, data: bytes) -> list[int]:
    """Start of frame to data, as ISO 11898-1 lists the fields."""
    text = "0" + format(can_id, "011b") + "000" + format(len(data), "04b")
    return [int(bit) for bit in text + "".join(format(byte, "08b") for byte in data)]


def crc_of(bits: list[int]) -> int:
    """The shift register as Bosch's CAN 2.0 specification, 3.1.1, describes it."""
    register = 0
    for bit in bits:
        following = bit ^ (register >> 14 & 1)
        register = register << 1 & 0x7FFF
        if following:
            register ^= 0x4599
    return register


def stuffed(bits: list[int]) -> int:
    count, out = 0, []
    for bit in bits:
        out.append(bit)
        if len(out) >= 5 and len(set(out[-5:])) == 1:
            out.append(1 - bit)
            count += 1
    return count


@given(ids, payloads)
def test_crc_and_stuffing_are_those_of_the_bits(can_id: int, data: bytes) -> None:
    bits = bits_of(can_id, data)
    crc = crc_of(bits)
    whole = bits + [int(bit) for bit in format(crc, "015b")]
    assert frame_bits(can_id, data) == len(whole) + stuffed(whole) + 13


@given(ids, payloads)
def test_no_frame_is_longer_than_the_worst_case(can_id: int, data: bytes) -> None:
    size = len(data)
    assert 47 + 8 * size <= frame_bits(can_id, data) <= worst_frame_bits(size)


def test_a_sync_and_a_heartbeat_by_hand() -> None:
    # 080h without data: 0 00010000000 000 0000, then 15 bits of CRC
    assert stuffed(bits_of(0x80, b"")) == 2
    assert frame_bits(0x80, b"") == 47 + 2 + 2  # two more in the CRC
    # Zeros all over, the CRC too: every fifth of 34
    assert frame_bits(0, b"") == 47 + 6


@pytest.mark.parametrize(
    ("size", "bits", "plain"),
    [(0, 55, 47), (4, 95, 79), (6, 115, 95), (7, 125, 103), (8, 135, 111)],
)
def test_worst_cases_are_the_published_ones(size: int, bits: int, plain: int) -> None:
    # Davis, Burns, Bril, Lukkien 2007, eq. 3 for 11-bit identifiers: (55 + 10 s) bits
    assert worst_frame_bits(size) == bits == 55 + 10 * size
    assert bits - plain == (33 + 8 * size) // 4


@pytest.mark.parametrize(
    ("size", "us"), [(0, 40.6), (8, 56.6), (16, 72.6), (32, 105.6), (48, 137.6), (64, 169.6)]
)
def test_fd_at_1_and_5_mbit(size: int, us: float) -> None:
    nominal, fast = worst_fd_bits(size)
    assert nominal + fast / 5 == pytest.approx(us)
    assert CanTiming(1_000_000, 5_000_000).frame_ns(1, bytes(size)) == round(us * 1e3)


@pytest.mark.parametrize(("size", "sent"), [(9, 12), (13, 16), (21, 24), (33, 48), (49, 64)])
def test_fd_frames_have_certain_sizes_only(size: int, sent: int) -> None:
    assert worst_fd_bits(size) == worst_fd_bits(sent) != worst_fd_bits(size - 1)


@pytest.mark.parametrize(("bitrate", "ns"), [(1_000_000, 1), (800_000, 1.25), (125_000, 8)])
def test_bits_take_their_time(bitrate: int, ns: float) -> None:
    assert CanTiming(bitrate).bits_ns(100) == 100_000 * ns
    assert CanTiming(bitrate).frame_ns(0x80, b"") == frame_bits(0x80, b"") * ns * 1000
