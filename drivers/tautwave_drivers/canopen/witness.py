"""Velocity (606Ch) and torque (6077h) that a drive reports, read by SDO while the bus runs.

For the motion check of `tautwave accept`: neither is in the TPDO of an axis that takes effort.
Source: CiA 402-2 v3.0, 606Ch and 6077h; CiA 301 v4.2, 7.2.4.3.5 (expedited upload).
"""

from __future__ import annotations

import math
import struct

READ_VELOCITY = bytes.fromhex("406c600000000000")
READ_TORQUE = bytes.fromhex("4077600000000000")
EVERY = 16
"""Cycles between two reads of the same object; the other comes half-way."""


class Told:
    """What one drive reported last; read while `wanted`."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Discard the values, and stop reading."""
        self.wanted = False
        self.velocity = self.torque = math.nan

    def request(self, cycle: int) -> bytes:
        """Return the SDO request of this cycle, b'' for none."""
        if not self.wanted:
            return b""
        return {1: READ_VELOCITY, 1 + EVERY // 2: READ_TORQUE}.get(cycle % EVERY, b"")

    def take(self, data: bytes) -> bool:
        """Take a response by SDO; return whether it is one of these."""
        if len(data) < 8 or data[1:4] not in (READ_VELOCITY[1:4], READ_TORQUE[1:4]):
            return False
        if data[0] & 0xE0 == 0x40:  # an abort says nothing
            if data[1:4] == READ_VELOCITY[1:4]:
                (self.velocity,) = struct.unpack_from("<i", data, 4)
            else:
                (self.torque,) = struct.unpack_from("<h", data, 4)
        return True
