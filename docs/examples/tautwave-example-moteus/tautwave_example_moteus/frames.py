"""Frames of moteus: subframes that write and read registers, answers as a table of values.

A frame has an identifier of 29 bits: 0x8000 where an answer is wanted, source << 8, destination;
its data are subframes, padded with NOP to a length of CAN FD. Turns, turns per second and newton
metres at the output; a value of an integer type that is the type's least stands for NaN.

Source: the register and frame reference of moteus (github.com/mjbots/moteus, docs/reference.md).
"""

from __future__ import annotations

import math
import struct

from tautwave_drivers.can.framing import EXTENDED, FD_SIZES, STANDARD_MASK

NOP = 0x50
MODE, POSITION, VELOCITY, TORQUE = 0x000, 0x001, 0x002, 0x003
VOLTAGE, TEMPERATURE, FAULT = 0x00D, 0x00E, 0x00F
TO_POSITION, TO_TORQUE, KP_SCALE, WATCHDOG = 0x020, 0x022, 0x023, 0x027
MODEL, FIRMWARE, MAP_VERSION, SERIAL = 0x100, 0x101, 0x102, 0x120

STOPPED, FAULTED, HOLDS_POSITION, TIMED_OUT = 0, 1, 10, 11
MODES = {STOPPED: "stopped", FAULTED: "fault", 5: "calibrating", TIMED_OUT: "watchdog timeout"}
FAULTS = {
    32: "calibration fault", 33: "motor driver fault", 34: "over voltage", 35: "encoder fault",
    36: "motor not configured", 37: "PWM cycle overrun", 38: "over temperature",
    39: "started outside its limits", 40: "under voltage", 41: "configuration changed",
    42: "no valid theta", 43: "no valid position",
}  # fmt: skip
LIMITED = range(96, 104)
"""Of the fault register: limits in force, not faults."""

TYPES = ("b", "<h", "<i", "<f")
LEAST = {0: -0x80, 1: -0x8000, 2: -0x80000000}

STATE = bytes((0x11, MODE, 0x1F, POSITION, 0x13, VOLTAGE))
"""Read the mode, then position, velocity and torque, then voltage, temperature and fault."""
STOP = bytes((0x01, MODE, STOPPED))
IDENTITY = bytes((0x1B, 0x80, 0x02, 0x1B, 0xA0, 0x02))
"""Read model, firmware and map version, then the three words of the serial number."""
READ_WATCHDOG = bytes((0x1D, WATCHDOG))
_ENGAGED = bytes((0x01, MODE, HOLDS_POSITION, 0x02, TO_POSITION, 0x80, 0x00, 0x02, KP_SCALE, 0, 0))
"""Position mode at no position (NaN) and velocity 0, both gains scaled to 0: torque alone."""
_FLOAT = struct.Struct("<BBf")
REQUEST_SIZE, ANSWER_SIZE = 32, 24


def request_id(device: int) -> int:
    """Return the identifier of a frame to a device that is to answer."""
    return EXTENDED | 0x8000 | device


def answer_id(device: int) -> int:
    """Return the identifier of its answers to the host, which is number 0."""
    bare = device << 8
    return bare if bare <= STANDARD_MASK else EXTENDED | bare


def padded(data: bytes) -> bytes:
    """Return data with NOPs up to a length of CAN FD."""
    size = next(size for size in FD_SIZES if size >= len(data))
    return data + bytes([NOP] * (size - len(data)))


def command(torque: float, watchdog_s: float) -> bytes:
    """Return subframes of a torque [N m] and of the time until the device stops by itself [s].

    Its state is read first: a device that was switched off and on since says so.
    """
    torques, watchdog = (
        _FLOAT.pack(0x0D, TO_TORQUE, torque),
        _FLOAT.pack(0x0D, WATCHDOG, watchdog_s),
    )
    return STATE + _ENGAGED + torques + watchdog


def parsed(data: bytes) -> dict[int, float] | None:
    """Return what an answer says, by register; None where it is none: frames never raise."""
    found: dict[int, float] = {}
    at, end = 0, len(data)
    while at < end:
        head = data[at]
        at += 1
        if head == NOP:
            continue
        if not 0x20 <= head < 0x30:
            return None  # an error, or no answer at all
        kind, count = head >> 2 & 3, head & 3
        if count == 0 and at < end:
            count, at = data[at], at + 1
        register, at = _varuint(data, at)
        size = struct.calcsize(TYPES[kind])
        if at + count * size > end or count == 0:
            return None
        for number in range(count):
            (value,) = struct.unpack_from(TYPES[kind], data, at)
            found[register + number] = math.nan if value == LEAST.get(kind) else value
            at += size
    return found


def _varuint(data: bytes, at: int) -> tuple[int, int]:
    """Return a number in groups of 7 bits, lowest first, and where it ends."""
    value = shift = 0
    while at < len(data):
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if data[at - 1] < 0x80:
            break
    return value, at
