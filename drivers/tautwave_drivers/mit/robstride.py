"""Frames of RobStride motors (RS00 to RS06, EL05): their private protocol, identifiers of 29 bits.

An identifier is type << 24 | 16 bits of data << 8 | who is meant. A command has p, v, kp and kd in
its bytes and the torque in its identifier; an answer has state and faults in its identifier. Unlike
in the motors' MIT mode, parameters can be read back here: so their watchdog is sure.

Source: the maker's manuals (RobStride/Product_Information); parameters with what public clients
read (huggingface/lerobot, robstride on PyPI). Firmware of RS01 before 0.1.3.4 and of RS02 before
0.2.3.6 takes kp and kd for 1.4167 times what is sent (its release notes): both are zero here.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from tautwave_drivers.can.framing import EXTENDED

GET_ID, MOTION, FEEDBACK, ENABLE, STOP, READ, WRITE, FAULTS = 0, 1, 2, 3, 4, 17, 18, 21
BROADCAST_ANSWER = 0xFE
RESET, CALIBRATES, RUNS = 0, 1, 2
STATES = {RESET: "stopped", CALIBRATES: "calibrating", RUNS: "running"}
BITS = ("under-voltage", "over-current", "too hot", "encoder fault", "stalled or overloaded",
        "not calibrated")  # fmt: skip
"""Of the faults in an answer, lowest first."""
TOP = 0xFFFF
TIMEOUT_S = 50e-6
"""One count of the CAN timeout."""


class Parameter(NamedTuple):
    """A parameter: its number, its name, and how its four bytes are read."""

    number: int
    name: str
    kind: str = "f"

    def __str__(self) -> str:
        return f"{self.name}({self.number:#06x})"


RUN_MODE = Parameter(0x7005, "run_mode", "B")
TORQUE_LIMIT = Parameter(0x700B, "limit_torque")
POSITION = Parameter(0x7019, "mechPos")
VOLTAGE = Parameter(0x701C, "VBUS")
TIMEOUT = Parameter(0x7028, "CAN_timeout", "I")


class Answer(NamedTuple):
    """What a frame from a motor is: its type, the motor, state and faults, its eight bytes."""

    kind: int
    motor: int
    state: int
    faults: int
    data: bytes


def frame_id(kind: int, motor: int, data: int) -> int:
    """Return the identifier of a frame to a motor."""
    return EXTENDED | kind << 24 | data << 8 | motor


def motion(torque_code: int) -> tuple[int, bytes]:
    """Return the 16 bits of the identifier and the bytes of a torque alone: kp and kd are 0."""
    return torque_code, struct.pack(">HHHH", TOP // 2, TOP // 2, 0, 0)


def parameter_bytes(parameter: Parameter, value: float | None = None) -> bytes:
    """Return the bytes that read a parameter, or write a value into it."""
    head = struct.pack("<HH", parameter.number, 0)
    if value is None:
        return head + bytes(4)
    if parameter.kind == "f":
        return head + struct.pack("<f", value)
    return head + struct.pack("<I", int(value))


def parameter_value(parameter: Parameter, data: bytes) -> float | None:
    """Return what an answer says of a parameter; None where it is about another."""
    if int.from_bytes(data[:2], "little") != parameter.number:
        return None
    if parameter.kind == "f":
        (value,) = struct.unpack("<f", data[4:8])
        return float(value)
    return float(int.from_bytes(data[4 : 5 if parameter.kind == "B" else 8], "little"))


def answer(can_id: int, data: bytes, host: int) -> Answer | None:
    """Return what a frame to this host says; None: it is no answer of a motor to it."""
    if not can_id & EXTENDED or len(data) != 8:
        return None
    kind, to = can_id >> 24 & 0x1F, can_id & 0xFF
    if to != (BROADCAST_ANSWER if kind == GET_ID else host):
        return None
    if kind not in (GET_ID, FEEDBACK, READ, FAULTS):
        return None
    return Answer(kind, can_id >> 8 & 0xFF, can_id >> 22 & 3, can_id >> 16 & 0x3F, data)


def faults_text(faults: int) -> str:
    """Return the faults of an answer in words."""
    return ", ".join(word for bit, word in enumerate(BITS) if faults >> bit & 1)
