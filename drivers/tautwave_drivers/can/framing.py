"""What frames a port sends and takes: identifiers as Linux has them, classic or FD, echo.

Sources: <linux/can.h> (CAN_EFF_FLAG, struct canfd_frame); ISO 11898-1:2015.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from typing import NamedTuple

EXTENDED = 0x80000000
"""Bit of an identifier of 29 bits (CAN_EFF_FLAG)."""
ERROR_FRAME = 0x20000000
"""Bit of the id of what `receive` gives for an error frame (CAN_ERR_FLAG)."""
STANDARD_MASK, EXTENDED_MASK = 0x7FF, 0x1FFFFFFF
FD_SIZES = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)
"""Data bytes that an FD frame can have."""

ECHO_NS = 100_000_000
"""An echo comes at once or never: what was sent longer ago explains no frame any more."""
_KEPT = 1024


class Framing(NamedTuple):
    """Frames of a port.

    `data_bitrate` [bit/s]: it sends FD frames with rate switch, and also takes classic ones;
    without it it sends and takes classic ones only. `extended`: it takes identifiers of 29 bits,
    marked by `EXTENDED`. `ids`: those it takes, None for all; error frames always pass.
    """

    data_bitrate: int | None = None
    extended: bool = False
    ids: Collection[int] | None = None

    @property
    def fd(self) -> bool:
        """Whether it sends FD frames."""
        return self.data_bitrate is not None

    def check(self, can_id: int, size: int) -> None:
        """Refuse a frame that would leave as another one.

        Raises
        ------
        ValueError
            Its identifier or its size is not one of this framing.
        """
        longest = EXTENDED_MASK if can_id & EXTENDED else STANDARD_MASK
        if can_id & EXTENDED and not self.extended:
            raise ValueError(f"id {can_id:#x}: this port is for identifiers of 11 bits")
        if not 0 <= can_id & ~EXTENDED <= longest:
            raise ValueError(f"id {can_id:#x} has more bits than its kind of frame")
        if size > 8 and not self.fd:
            raise ValueError(f"{size} data bytes: a classic frame has at most 8")
        if self.fd and size not in FD_SIZES:
            raise ValueError(f"{size} data bytes: no FD frame has that many")


class Echo:
    """Tells a port's own frames among those it hears, by content and count.

    An interface that returns what was sent returns each frame once. A frame with the content of one
    that was sent, and not yet heard, is that one; the next of the same content is another node's.
    """

    def __init__(self) -> None:
        self._sent: dict[tuple[int, bytes], deque[int]] = {}

    def sent(self, can_id: int, data: bytes, now_ns: int) -> None:
        """Note a frame that was sent."""
        if len(self._sent) >= _KEPT:
            oldest = now_ns - ECHO_NS
            self._sent = {key: at for key, at in self._sent.items() if at and at[-1] >= oldest}
        self._sent.setdefault((can_id, data), deque(maxlen=_KEPT)).append(now_ns)

    def is_own(self, can_id: int, data: bytes, now_ns: int) -> bool:
        """Return whether a frame that was heard is one of those sent; it is then accounted for."""
        times = self._sent.get((can_id, data))
        while times:
            if times.popleft() >= now_ns - ECHO_NS:
                return True
        return False
