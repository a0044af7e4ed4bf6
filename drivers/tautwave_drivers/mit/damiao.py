"""Frames and registers of Damiao motors: DM-J4310, 4340, 6006, 8006, 8009, 10010 and their like.

Source: the maker's manuals of the DM series, with what public clients send (enactic/openarm_can,
i2rt-robotics/i2rt, damiao-motor on PyPI). An answer has no length, number or checksum of its own.
"""

from __future__ import annotations

import struct
from typing import Literal, NamedTuple

PARAMETERS = 0x7FF
"""Id of everything about registers; the motor's own id is in the data."""
OFFSETS = (0x000, 0x100, 0x200, 0x300)
"""A motor listens on its id plus these, one for each of its modes."""

ENABLE = bytes((0xFF,) * 7 + (0xFC,))
DISABLE = bytes((0xFF,) * 7 + (0xFD,))
CLEAR = bytes((0xFF,) * 7 + (0xFB,))

READ, WRITE, SAVE, ASK = 0x33, 0x55, 0xAA, 0xCC
LAST_REGISTER = 81

DISABLED, ENABLED, TIMED_OUT = 0x0, 0x1, 0xD
STATES = {
    0x0: "disabled",
    0x1: "enabled",
    0x8: "over-voltage",
    0x9: "under-voltage",
    0xA: "over-current",
    0xB: "its driver is too hot",
    0xC: "its rotor is too hot",
    0xD: "no command in time",
    0xE: "overload",
}

POSITION_TOP, TOP = 0xFFFF, 0xFFF
"""Greatest codes: 16 bits for the position, 12 for all others."""
P_ZERO, V_ZERO = 0x8000, 0x800
"""Codes of a position and a velocity of zero, but for half a step: no code is zero."""
DAMPING_STEP = 5.0 / TOP
"""[N m s/rad] One code of kd."""
LOOP_S = 50e-6
"""Period of a motor's own loop, which counts TIMEOUT too."""
LOOP_LATE = 1.0
"""Loops from its sample to the current that follows it."""

TIMEOUT_S = 50e-6
"""One count of TIMEOUT."""
MIT_MODE = 1
MODES = {1: "MIT", 2: "position and velocity", 3: "velocity", 4: "force and position"}
FD_RATES = {
    0: 125_000, 1: 200_000, 2: 250_000, 3: 500_000, 4: 1_000_000,
    5: 2_000_000, 6: 2_500_000, 7: 3_200_000, 8: 4_000_000, 9: 5_000_000,
}  # fmt: skip
"""can_br: from 5 on the motor answers in CAN FD, with this data rate."""


class Register(NamedTuple):
    """A register: its number, its name in the manual, and whether it is a uint32 or a float32."""

    number: int
    name: str
    kind: Literal["I", "f"] = "I"

    def encode(self, value: float) -> bytes:
        """Return the four bytes of a value."""
        return struct.pack(f"<{self.kind}", int(value) if self.kind == "I" else value)

    def decode(self, data: bytes) -> float:
        """Return the value of four bytes."""
        (value,) = struct.unpack(f"<{self.kind}", data)
        return float(value)

    def __str__(self) -> str:
        return f"{self.name}({self.number})"


MST_ID = Register(7, "MST_ID")
ESC_ID = Register(8, "ESC_ID")
TIMEOUT = Register(9, "TIMEOUT")
CTRL_MODE = Register(10, "CTRL_MODE")
INERTIA = Register(12, "Inertia", "f")
HARDWARE = Register(13, "hw_ver")
SOFTWARE = Register(14, "sw_ver")
SERIAL = Register(15, "SN")
GEAR = Register(20, "Gr", "f")
P_MAX = Register(21, "PMAX", "f")
V_MAX = Register(22, "VMAX", "f")
T_MAX = Register(23, "TMAX", "f")
V_BANDWIDTH = Register(32, "V_BW", "f")
CAN_RATE = Register(35, "can_br")
SUB_VERSION = Register(36, "sub_ver")
VOLTAGE = Register(60, "bus voltage", "f")


class Feedback(NamedTuple):
    """What a motor answers to a frame of its own: codes, and temperatures [degC]."""

    state: int
    position: int
    velocity: int
    torque: int
    driver_temperature: int
    rotor_temperature: int


def command(torque: int, damping: int = 0) -> bytes:
    """Return the frame of a motor without spring: codes of its torque and of its damper."""
    low = (damping & 0xF) << 4 | torque >> 8
    return _COMMAND.pack(P_ZERO, V_ZERO >> 4, 0, 0, damping >> 4, low, torque & 0xFF)


_COMMAND = struct.Struct(">HBBBBBB")
FEEDBACK = struct.Struct(">BHBBBBB")


def feedback(data: bytes, motor_id: int) -> Feedback | None:
    """Return the feedback of a motor, None if the data are not feedback of that motor."""
    if len(data) != 8 or data[0] & 0xF != motor_id & 0xF or is_parameter(data):
        return None
    head, position, speed, middle, torque, driver, rotor = FEEDBACK.unpack(data)
    return Feedback(
        head >> 4, position, speed << 4 | middle >> 4, (middle & 0xF) << 8 | torque, driver, rotor
    )


def is_parameter(data: bytes) -> bool:
    """Return whether these bytes are about a register, also one that another program requested.

    They come on the id of the feedback, and would pass as one of a motor at the end of its range.
    """
    return data[1] <= 0x0F and data[2] in (READ, WRITE, SAVE, ASK) and data[3] <= LAST_REGISTER


def read_register(motor_id: int, register: Register) -> bytes:
    """Return the frame that asks for a register."""
    return struct.pack("<HBBI", motor_id, READ, register.number, 0)


def write_register(motor_id: int, register: Register, value: float) -> bytes:
    """Return the frame that sets a register until the motor is switched off."""
    return struct.pack("<HBB", motor_id, WRITE, register.number) + register.encode(value)


def register_value(data: bytes, motor_id: int, register: Register) -> float | None:
    """Return the value in the answer to a read, None if the data do not answer that read."""
    if len(data) == 8 and data[:4] == struct.pack("<HBB", motor_id, READ, register.number):
        return register.decode(data[4:])
    return None


def state_text(state: int) -> str:
    """Return a motor's state as text."""
    return STATES.get(state, f"unknown state {state:X}h")
