"""How long a CAN frame is on the wire, in bits: exactly, and at worst.

Sources: ISO 11898-1 (frame format, CRC-15, bit stuffing); Davis, Burns, Bril and Lukkien,
"Controller Area Network (CAN) schedulability analysis: refuted, revisited and revised", 2007
(worst case, classic); Bordoloi and Samii, "The frame packing problem for CAN-FD", 2014.
"""

from __future__ import annotations

import functools

CRC_POLYNOMIAL = 0x4599
EXTENDED = 0x80000000
"""Marks an identifier of 29 bits, as on Linux."""
INTERMISSION = 3
"""Bits of the pause after a frame; every length here includes them."""

PLAIN, PLAIN_EXTENDED = 47, 67
"""Bits of a classic frame without data and stuffing, intermission included, by identifier."""

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


def _stuff_table(width: int) -> tuple[int, ...]:
    """Return what `width` bits do to a count of stuff bits, at `state << width | bits`.

    A count is 8 times the stuff bits so far, plus the state: 2 (run - 1) + the last bit.
    """
    steps = []
    for state in range(8):
        for bits in range(1 << width):
            run, last, stuffed = state // 2 + 1, state % 2, 0
            for at in range(width - 1, -1, -1):
                new = bits >> at & 1
                run, last = (run + 1, last) if new == last else (1, new)
                if run == 5:  # the stuff bit is the first of the next run
                    run, last, stuffed = 1, 1 - last, stuffed + 1
            steps.append(8 * stuffed + 2 * (run - 1) + last - state)
    return tuple(steps)


_CRC = _crc_table()
_STUFF = {width: _stuff_table(width) for width in (3, 7, 8)}
_OF_BYTE, _OF_SEVEN = _STUFF[8], _STUFF[7]
_START = 1
"""Count before the start of frame, which is the first of its run."""


@functools.lru_cache(maxsize=4096)
def _begun(can_id: int, size: int) -> tuple[int, int, int]:
    """Return CRC and count of stuff bits ahead of the data, and the bits of a frame without any."""
    if can_id & EXTENDED:
        # Start of frame, 11 bits, SRR and IDE (both 1), 18 bits, RTR, r1, r0, length: 39 bits.
        head = (can_id >> 18 & 0x7FF) << 27 | 0b11 << 25 | (can_id & 0x3FFFF) << 7 | size
        partial, whole, plain = 7, 4, PLAIN_EXTENDED
    else:
        head = can_id << 7 | size  # start of frame, identifier, RTR, IDE, r0, length: 19 bits
        partial, whole, plain = 3, 2, PLAIN
    crc, count = 0, _START
    # Zeros before the start of frame, itself a zero, do not change a CRC that begins at zero.
    for byte in head.to_bytes(whole + 1, "big"):
        crc = (crc << 8 & 0x7FFF) ^ _CRC[crc >> 7 ^ byte]
    count += _STUFF[partial][count << partial | head >> 8 * whole]
    for byte in (head & (1 << 8 * whole) - 1).to_bytes(whole, "big"):
        count += _OF_BYTE[(count & 7) << 8 | byte]
    return crc, count, plain + 8 * size


def frame_bits(can_id: int, data: bytes) -> int:
    """Return the bits of a classic data frame, 0 to 8 bytes."""
    crc, count, bits = _begun(can_id, len(data))
    for byte in data:
        crc = (crc << 8 & 0x7FFF) ^ _CRC[crc >> 7 ^ byte]
        count += _OF_BYTE[(count & 7) << 8 | byte]
    count += _OF_BYTE[(count & 7) << 8 | crc >> 7]
    count += _OF_SEVEN[(count & 7) << 7 | crc & 0x7F]
    return bits + (count >> 3)


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
        self._fd_ns: dict[tuple[int, bool], int] = {}

    def frame_ns(self, can_id: int, data: bytes, fd: bool | None = None) -> int:
        """Return how long this frame and the pause after it occupy the bus [ns]."""
        if self.data_bitrate is None or fd is False:
            return self.bits_ns(frame_bits(can_id, data))
        kind = len(data), bool(can_id & EXTENDED)
        known = self._fd_ns.get(kind)
        if known is None:
            nominal, fast = worst_fd_bits(*kind)
            known = round(1e9 * (nominal / self.bitrate + fast / self.data_bitrate))
            self._fd_ns[kind] = known
        return known

    def bits_ns(self, bits: int) -> int:
        """Return the time of nominal bits [ns]."""
        return (bits * 1_000_000_000 + self.bitrate // 2) // self.bitrate
