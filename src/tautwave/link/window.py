"""The replay window: each sequence number passes once, however late, within the last 64.

Source: RFC 4303, appendix A2 (the window of IPsec).
"""

from __future__ import annotations

WIDTH = 64


def admit(newest: int, seen: int, sequence: int) -> tuple[int, int, bool]:
    """Ask whether a packet that is genuine is new.

    Parameters
    ----------
    newest : int
        Greatest sequence number so far, -1 before the first.
    seen : int
        Bit i: newest - i came.
    sequence : int
        Of this packet.

    Returns
    -------
    tuple
        The new `newest` and `seen`; whether it is admitted. What is older than the window is not.
    """
    if sequence > newest:
        ahead = sequence - newest
        seen = 1 if ahead >= WIDTH else (seen << ahead | 1) & ((1 << WIDTH) - 1)
        return sequence, seen, True
    bit = 1 << (newest - sequence) if newest - sequence < WIDTH else 0
    if bit == 0 or seen & bit:
        return newest, seen, False
    return newest, seen | bit, True
