"""How long a CAN frame is on the wire, in bits: exactly, and at worst.

Sources: ISO 11898-1 (frame format, CRC-15, bit stuffing); Davis, Burns, Bril and Lukkien,
"Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised", 2007
(worst case, classic); Bordoloi and Samii, "The frame packing problem for CAN-FD", 2014.
"""

from __future__ import annotations

CRC_POLYNOMIAL = 0x4599
EXTENDED = 0x80000000
"""Marks an identifier of 29 bits, as on Linux."""
INTERMISSION = 3
"""Bits of the pause after a frame; every length here includes them."""

PLAIN = 47
"""Bits of a classic frame without data and stuffing, intermission included."""

ERROR_FRAME = 20 + INTERMISSION
"""Bits of an error frame, its flags superposed as far as they can be (6 to 12, and 8)."""

FD_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Data bytes that a FD frame can have."""


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte << 7
        for _ in range(8):
            crc = (crc << 1) ^ (CRC_POLYNOMIAL if crc & 0x4000 else 0)
        table.append(crc & 0x7FFF)
    return tuple(table)


def _stuff_table() -> tuple[tuple[tuple[int, int], ...], ...]:
    """Return, per state and byte, the next state and the stuff bits; state = 2 (run - 1) + bit."""
    rows = []
    for state in range(8):
        row = []
        for byte in range(256):
            run, bit, stuffed = state // 2 + 1, state % 2, 0
            for at in range(7, -1, -1):
                new = byte >> at & 1
                run, bit = (run + 1, bit) if new == bit else (1, new)
                if run == 5:  # the stuff bit is the first of the next run
                    run, bit, stuffed = 1, 1 - bit, stuffed + 1
            row.append((2 * (run - 1) + bit, stuffed))
        rows.append(tuple(row))
    return tuple(rows)


_CRC = _crc_table()
_STUFF = _stuff_table()


def crc15(can_id: int, data: bytes) -> int:
    """Return the CRC sequence of a classic data frame with an 11-bit identifier."""
    crc = 0
    # Zeros before the start of frame, itself a zero, do not change a CRC that begins at zero.
    for byte in _head(can_id, len(data)) + data:
        crc = (crc << 8 & 0x7FFF) ^ _CRC[crc >> 7 ^ byte]
    return crc


def _head(can_id: int, size: int) -> bytes:
    """Return start of frame, identifier, RTR, IDE, r0 and length: 19 bits, to the right."""
    return (can_id << 7 | size).to_bytes(3, "big")


def stuff_bits(can_id: int, data: bytes) -> int:
    """Return how many bits are stuffed into this classic data frame, from start to CRC."""
    size = len(data)
    head = can_id << 7 | size
    body = (head << 8 * size | int.from_bytes(data, "big")) << 15 | crc15(can_id, data)
    # The first two of 34 + 8 size bits are the start of frame and the identifier's highest.
    state, total = (1, 0) if can_id & 0x400 else (2, 0)
    for byte in (body & (1 << 32 + 8 * size) - 1).to_bytes(4 + size, "big"):
        state, stuffed = _STUFF[state][byte]
        total += stuffed
    return total


def extended_bits(can_id: int, data: bytes) -> int:
    """Return the bits of a classic data frame with a 29-bit identifier, 0 to 8 bytes."""
    size = len(data)
    # Start of frame, 11 bits, SRR and IDE (both 1), 18 bits, RTR, r1, r0, length: 39 bits.
    head = (can_id >> 18 & 0x7FF) << 27 | 0b11 << 25 | (can_id & 0x3FFFF) << 7 | size
    crc = 0
    for byte in head.to_bytes(5, "big") + data:
        crc = (crc << 8 & 0x7FFF) ^ _CRC[crc >> 7 ^ byte]
    body, length = (head << 8 * size | int.from_bytes(data, "big")) << 15 | crc, 54 + 8 * size
    run, last, stuffed = 0, -1, 0
    for at in range(length - 1, -1, -1):
        bit = body >> at & 1
        run, last = (run + 1, last) if bit == last else (1, bit)
        if run == 5:
            run, last, stuffed = 1, 1 - last, stuffed + 1
    return length + stuffed + 10 + INTERMISSION  # delimiters, acknowledge, end of frame


def frame_bits(can_id: int, data: bytes) -> int:
    """Return the bits of a classic data frame, 0 to 8 bytes."""
    if can_id & EXTENDED:
        return extended_bits(can_id, data)
    return PLAIN + 8 * len(data) + stuff_bits(can_id, data)


def priority(can_id: int) -> tuple[int, bool, int]:
    """Return the order of arbitration, least first: 11 bits before 29 that begin with them."""
    if can_id & EXTENDED:
        return can_id >> 18 & 0x7FF, True, can_id & 0x3FFFF
    return can_id, False, 0


def fd_size(size: int) -> int:
    """Return the smallest size of a FD frame that holds `size` bytes."""
    return next(step for step in FD_SIZES if step >= size)


def worst_fd_bits(size: int, extended: bool = False) -> tuple[int, int]:
    """Return the most bits of a FD frame with rate switch: at the nominal and at the data rate."""
    padded = fd_size(size)
    longer = 19 + 19 // 4 if extended else 0
    return 32 + INTERMISSION + longer, 28 + 5 * (1 if padded > 16 else 0) + 10 * padded


class CanTiming:
    """Time on the wire of a bus.

    Parameters
    ----------
    bitrate : int
        [bit/s] nominal.
    data_bitrate : int, optional
        [bit/s] of the data phase of FD frames, which have the rate switched and are taken at their
        worst; a frame is one unless it is said to be classic.
    """

    def __init__(self, bitrate: int, data_bitrate: int | None = None) -> None:
        self.bitrate = bitrate
        self.data_bitrate = data_bitrate
        self.fd = data_bitrate is not None

    def frame_ns(self, can_id: int, data: bytes, fd: bool | None = None) -> int:
        """Return how long this frame and the pause after it occupy the bus [ns]."""
        if self.data_bitrate is None or fd is False:
            return self.bits_ns(frame_bits(can_id, data))
        nominal, fast = worst_fd_bits(len(data), bool(can_id & EXTENDED))
        return round(1e9 * (nominal / self.bitrate + fast / self.data_bitrate))

    def bits_ns(self, bits: int) -> int:
        """Return the time of nominal bits [ns]."""
        return (bits * 1_000_000_000 + self.bitrate // 2) // self.bitrate
