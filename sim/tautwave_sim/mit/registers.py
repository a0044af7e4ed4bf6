"""The registers of a simulated motor: what is in RAM, and what survives its power."""

from __future__ import annotations

import struct
from collections.abc import Mapping

from tautwave_sim.mit.options import MotorKeys

MST_ID, ESC_ID, TIMEOUT, CTRL_MODE = 7, 8, 9, 10
P_MAX, V_MAX, T_MAX, V_BW, CAN_BR = 21, 22, 23, 32, 35
WHOLE = frozenset((MST_ID, ESC_ID, TIMEOUT, CTRL_MODE, 13, 14, 15, 16, CAN_BR, 36))
"""Registers that hold a uint32; all others hold a float32."""
READ_ONLY = frozenset((13, 14, 15, 16, 17, 18, 19, 20, 36, 60, 61, 62, 80, 81))

FROM_THE_MAKER: Mapping[int, float] = {
    0: 15.0, 1: 0.945, 2: 120.0, 3: 0.95, 4: 10.0, 5: -10.0, 6: 300.0, TIMEOUT: 0, CTRL_MODE: 2,
    11: 0.0, 12: 1.8e-5, 13: 3, 14: 6113, 15: 20250001, 16: 14, 17: 0.85, 18: 3.45e-4, 19: 0.004,
    20: 10.0, 24: 1000.0, 25: 0.00125, 26: 0.002, 27: 100.0, 28: 0.2, 29: 32.0, 30: 1.0, 31: 4.0,
    32: 100.0, CAN_BR: 4, 36: 1, 59: 10.261194, 60: 24.0, 61: 30.0, 62: 30.0, 80: 0.0, 81: 0.0,
}  # fmt: skip
"""What a new DM-J4310 holds: its TIMEOUT is off, and it is not in MIT mode."""


class Registers:
    """Registers of one motor.

    Parameters
    ----------
    motor : MotorKeys
        Its ids and ranges.
    fd : bool
        It is set to CAN FD.
    saved : mapping
        Values that differ, by number.
    """

    def __init__(self, motor: MotorKeys, fd: bool, saved: Mapping[int, float]) -> None:
        self._saved = {
            **FROM_THE_MAKER,
            MST_ID: motor.feedback_id,
            ESC_ID: motor.id,
            P_MAX: motor.p_max,
            V_MAX: motor.v_max,
            T_MAX: motor.t_max,
            CAN_BR: 9 if fd else 4,
            **({} if motor.velocity_filter_hz is None else {V_BW: motor.velocity_filter_hz}),
            **saved,
        }
        self._now = dict(self._saved)

    def power_on(self) -> None:
        """Restore the saved values: others are lost."""
        self._now = dict(self._saved)

    def save(self) -> None:
        """Save all values for the next power-on."""
        self._saved = dict(self._now)

    def __getitem__(self, number: int) -> float:
        """Return a value."""
        return self._now[number]

    def whole(self, number: int) -> int:
        """Return the value of a register that holds a uint32."""
        return int(self._now[number])

    def put(self, number: int, value: float) -> None:
        """Set a value from within."""
        self._now[number] = value

    def read(self, number: int) -> bytes | None:
        """Return the four bytes of a register, None if there is none."""
        if number not in self._now:
            return None
        value = self._now[number]
        return struct.pack("<I", int(value)) if number in WHOLE else struct.pack("<f", value)

    def write(self, number: int, data: bytes) -> None:
        """Take four bytes, where the register can be written."""
        if number in self._now and number not in READ_ONLY:
            kind = "<I" if number in WHOLE else "<f"
            (self._now[number],) = struct.unpack(kind, data)
