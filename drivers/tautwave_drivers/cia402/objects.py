"""Objects of the drive profile (CiA 402-2, IEC 61800-7-201), as data.

The communication objects are in `communication`; `find` knows both. Units marked `user` are what
the drive's factors (608Fh to 6096h, 60A8h, 60A9h) make of them, encoder increments by default.
"""

from __future__ import annotations

from tautwave_drivers.cia402.communication import COMMUNICATION
from tautwave_drivers.cia402.entry import Entry

_402 = "CiA 402-2 v3.0"


def _entry(index: int, sub: int, kind: str, name: str, unit: str, meaning: str) -> Entry:
    return Entry(name, index, sub, kind, unit, meaning, _402)


ABORT_CONNECTION = _entry(0x6007, 0, "I16", "abort connection option", "", "when the bus is lost")
ERROR_CODE = _entry(0x603F, 0, "U16", "error code", "", "of the last error, as in its EMCY")
CONTROLWORD = _entry(0x6040, 0, "U16", "controlword", "bits", "commands to the state machine")
STATUSWORD = _entry(0x6041, 0, "U16", "statusword", "bits", "state and flags")
QUICK_STOP_OPTION = _entry(
    0x605A, 0, "I16", "quick stop option", "", "how it stops and which state follows"
)
SHUTDOWN_OPTION = _entry(0x605B, 0, "I16", "shutdown option", "", "on transition 8")
DISABLE_OPTION = _entry(0x605C, 0, "I16", "disable operation option", "", "on transition 5")
HALT_OPTION = _entry(0x605D, 0, "I16", "halt option", "", "on controlword bit 8")
FAULT_OPTION = _entry(0x605E, 0, "I16", "fault reaction option", "", "on a fault")
MODE = _entry(0x6060, 0, "I8", "mode of operation", "", "asked for")
MODE_DISPLAY = _entry(0x6061, 0, "I8", "mode of operation display", "", "in force")
POSITION = _entry(0x6064, 0, "I32", "position actual value", "user", "measured")
VELOCITY = _entry(0x606C, 0, "I32", "velocity actual value", "user", "measured")
TARGET_TORQUE = _entry(0x6071, 0, "I16", "target torque", "rated/1000", "set-point of CST and PT")
MAX_TORQUE = _entry(0x6072, 0, "U16", "max torque", "rated/1000", "limit")
MAX_CURRENT = _entry(0x6073, 0, "U16", "max current", "rated/1000", "limit")
RATED_CURRENT = _entry(0x6075, 0, "U32", "motor rated current", "mA", "of the name plate")
RATED_TORQUE = _entry(
    0x6076, 0, "U32", "motor rated torque", "mN m", "mN of a linear motor; EPOS4: uN m"
)
TORQUE = _entry(0x6077, 0, "I16", "torque actual value", "rated/1000", "measured by current")
CURRENT = _entry(0x6078, 0, "I16", "current actual value", "rated/1000", "measured")
TARGET_POSITION = _entry(0x607A, 0, "I32", "target position", "user", "set-point of CSP and PP")
MIN_WRAP = _entry(0x607B, 1, "I32", "min position range limit", "user", "positions wrap there")
MAX_WRAP = _entry(0x607B, 2, "I32", "max position range limit", "user", "positions wrap there")
HOME_OFFSET = _entry(0x607C, 0, "I32", "home offset", "user", "from home to the zero position")
MIN_POSITION = _entry(0x607D, 1, "I32", "min position limit", "user", "software limit")
MAX_POSITION = _entry(0x607D, 2, "I32", "max position limit", "user", "software limit")
POLARITY = _entry(0x607E, 0, "U8", "polarity", "bits", "7: position, 6: velocity, are inverted")
MAX_PROFILE_VELOCITY = _entry(0x607F, 0, "U32", "max profile velocity", "user", "limit")
MAX_MOTOR_SPEED = _entry(0x6080, 0, "U32", "max motor speed", "rpm", "limit")
PROFILE_VELOCITY = _entry(0x6081, 0, "U32", "profile velocity", "user", "of PP")
PROFILE_ACCELERATION = _entry(0x6083, 0, "U32", "profile acceleration", "user", "of PP and PV")
PROFILE_DECELERATION = _entry(0x6084, 0, "U32", "profile deceleration", "user", "of PP and PV")
QUICK_STOP_DECELERATION = _entry(0x6085, 0, "U32", "quick stop deceleration", "user", "of its ramp")
TORQUE_SLOPE = _entry(0x6087, 0, "U32", "torque slope", "rated/1000/s", "of PT")
POSITION_NOTATION = _entry(0x6089, 0, "I8", "position notation index", "", "power of ten of 608Ah")
POSITION_DIMENSION = _entry(0x608A, 0, "U8", "position dimension index", "", "unit, by edition 2")
VELOCITY_NOTATION = _entry(0x608B, 0, "I8", "velocity notation index", "", "power of ten of 608Ch")
VELOCITY_DIMENSION = _entry(0x608C, 0, "U8", "velocity dimension index", "", "unit, by edition 2")
ENCODER_INCREMENTS = _entry(0x608F, 1, "U32", "encoder increments", "", "per 608Fh:02 motor turns")
ENCODER_REVOLUTIONS = _entry(0x608F, 2, "U32", "motor revolutions", "", "for 608Fh:01")
VELOCITY_INCREMENTS = _entry(
    0x6090, 1, "U32", "encoder increments per second", "1/s", "per 6090h:02"
)
VELOCITY_REVOLUTIONS = _entry(
    0x6090, 2, "U32", "motor revolutions per second", "1/s", "for 6090h:01"
)
GEAR_MOTOR = _entry(0x6091, 1, "U32", "motor shaft revolutions", "", "gear ratio, numerator")
GEAR_SHAFT = _entry(0x6091, 2, "U32", "driving shaft revolutions", "", "gear ratio, divisor")
FEED = _entry(0x6092, 1, "U32", "feed", "user", "travel per 6092h:02 turns of the driving shaft")
FEED_REVOLUTIONS = _entry(0x6092, 2, "U32", "feed revolutions", "", "for 6092h:01")
POSITION_FACTOR = _entry(0x6093, 1, "U32", "position factor numerator", "", "drive's own scale")
POSITION_DIVISOR = _entry(0x6093, 2, "U32", "position factor divisor", "", "drive's own scale")
VELOCITY_ENCODER_FACTOR = _entry(
    0x6094, 1, "U32", "velocity encoder factor numerator", "", "drive's own scale"
)
VELOCITY_ENCODER_DIVISOR = _entry(
    0x6094, 2, "U32", "velocity encoder factor divisor", "", "drive's own scale"
)
VELOCITY_FACTOR_1 = _entry(0x6095, 1, "U32", "velocity factor 1 numerator", "", "its own scale")
VELOCITY_DIVISOR_1 = _entry(0x6095, 2, "U32", "velocity factor 1 divisor", "", "its own scale")
VELOCITY_FACTOR = _entry(0x6096, 1, "U32", "velocity factor numerator", "", "drive's own scale")
VELOCITY_DIVISOR = _entry(0x6096, 2, "U32", "velocity factor divisor", "", "drive's own scale")
HOMING_METHOD = _entry(0x6098, 0, "I8", "homing method", "", "35 and 37: current position is home")
HOMING_FAST = _entry(0x6099, 1, "U32", "speed of switch search", "user", "of homing")
HOMING_SLOW = _entry(0x6099, 2, "U32", "speed of zero search", "user", "of homing")
HOMING_ACCELERATION = _entry(0x609A, 0, "U32", "homing acceleration", "user", "of homing")
POSITION_UNIT = _entry(0x60A8, 0, "U32", "SI unit position", "", "prefix, unit (CiA 303-2)")
VELOCITY_UNIT = _entry(0x60A9, 0, "U32", "SI unit velocity", "", "prefix, unit, time (CiA 303-2)")
POSITION_OFFSET = _entry(0x60B0, 0, "I32", "position offset", "user", "added in CSP")
VELOCITY_OFFSET = _entry(0x60B1, 0, "I32", "velocity offset", "user", "added in CSP and CSV")
TORQUE_OFFSET = _entry(0x60B2, 0, "I16", "torque offset", "rated/1000", "added in CSP, CSV and CST")
INTERPOLATION_TIME = _entry(0x60C2, 1, "U8", "interpolation time", "", "times 10**(60C2h:02) s")
INTERPOLATION_INDEX = _entry(0x60C2, 2, "I8", "interpolation time index", "", "-3: ms")
POSITIVE_TORQUE_LIMIT = _entry(0x60E0, 0, "U16", "positive torque limit", "rated/1000", "limit")
NEGATIVE_TORQUE_LIMIT = _entry(0x60E1, 0, "U16", "negative torque limit", "rated/1000", "limit")
TARGET_VELOCITY = _entry(0x60FF, 0, "I32", "target velocity", "user", "set-point of CSV and PV")
SUPPORTED_MODES = _entry(0x6502, 0, "U32", "supported drive modes", "bits", "bit n-1: mode n")

DRIVE = tuple(value for value in list(globals().values()) if isinstance(value, Entry))
"""Every object of this module, by index."""

_KNOWN = {(entry.index, entry.sub): entry for entry in (*COMMUNICATION, *DRIVE)}


def find(index: int, sub: int = 0) -> Entry | None:
    """Return the object at `index`:`sub`, of any axis of a multi-axis drive; None if unknown."""
    axis = 0
    if 0x6800 <= index < 0xA000:
        axis = (index - 0x6000) // 0x800
    entry = _KNOWN.get((index - 0x800 * axis, sub))
    return entry.on_axis(axis) if entry is not None else None


def interpolation_period(period_ns: int) -> tuple[int, int] | None:
    """Return 60C2h:01 and :02 for `period_ns`; None where one byte and a power of ten cannot.

    Source: CiA 402-2, 60C2h: time = value * 10**index s, value 1 to 255.
    """
    for index in range(0, -10, -1):
        unit_ns = 10 ** (9 + index)
        if period_ns % unit_ns == 0 and 1 <= period_ns // unit_ns <= 255:
            return period_ns // unit_ns, index
    return None
