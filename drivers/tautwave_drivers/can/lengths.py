"""Worst-case length of a frame on the wire, and the time it takes.

Sources: Davis, Burns, Bril and Lukkien, "Controller Area Network (CAN) schedulability analysis",
Real-Time Systems 35, 2007 (classic frame with worst-case stuffing, interframe space included; 11
and 29 bits of identifier); ISO 11898-1:2015 for CAN FD: dynamic stuffing up to the data field,
fixed stuff bits in the CRC.
"""

from __future__ import annotations

from tautwave_drivers.can.framing import FD_SIZES


def classic_bits(size: int, extended: bool = False) -> int:
    """Return the worst-case bits of a classic frame with `size` data bytes."""
    stuffable = 53 if extended else 33
    return stuffable + 14 + 8 * size + (stuffable + 8 * size) // 4


def fd_bits(size: int, extended: bool = False) -> tuple[int, int]:
    """Return the worst-case bits of an FD frame at the nominal and at the data bit rate."""
    size = next(length for length in FD_SIZES if length >= size)
    # SOF, id, RRS, IDE, FDF, res, BRS: 17 bits, 36 with an extended id (SRR and 18 more)
    head = 36 if extended else 17
    stuffed = (head + 4 + 8 * size) // 4
    # CRC delimiter, ACK, EOF, space: 13
    crc = 17 if size <= 16 else 21
    fixed = 6 if size <= 16 else 7
    in_head = head // 4
    return head + in_head + 13, 5 + 8 * size + (stuffed - in_head) + 4 + crc + fixed


def frame_s(
    size: int, bitrate: int, data_bitrate: int | None = None, extended: bool = False
) -> float:
    """Return the worst-case time of a frame on the wire [s]."""
    if data_bitrate is None:
        return classic_bits(size, extended) / bitrate
    nominal, fast = fd_bits(size, extended)
    return nominal / bitrate + fast / data_bitrate


def arithmetic(size: int, bitrate: int, data_bitrate: int | None = None) -> str:
    """Return how the worst-case time of a frame with an 11-bit id comes about, as text."""
    time = f"{frame_s(size, bitrate, data_bitrate) * 1e6:.5g} us"
    if data_bitrate is None:
        return (
            f"{size} bytes: 47 + 8*{size} + floor((33 + 8*{size})/4) = "
            f"{classic_bits(size)} bits = {time}"
        )
    nominal, fast = fd_bits(size)
    return f"{size} bytes: {nominal} bits nominal + {fast} bits fast = {time}"
