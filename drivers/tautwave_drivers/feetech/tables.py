"""Memory tables of Feetech's servos as data, and which firmware has which.

Sources: the vendor's SDK (ftservo/FTServo_Python), memory tables of vassar-feetech-servo-sdk. The
table follows the firmware, not the model, by the vendor's own tool. Numbers are little-endian,
and what is negative is sign and magnitude: the sign is a bit, another one by register and table.
"""

from __future__ import annotations

from typing import NamedTuple


class Register(NamedTuple):
    """One register: address, bytes, bit of the sign (0: none), and whether it lies in EEPROM."""

    name: str
    address: int
    size: int
    sign: int = 0
    eeprom: bool = False

    def encode(self, value: int) -> bytes:
        """Return `value` as the register holds it; beyond its range, the nearest end."""
        most = (1 << (self.sign or 8 * self.size)) - 1
        if self.sign and value < 0:
            held = min(-value, most) | 1 << self.sign
        else:
            held = min(max(value, 0), most)
        return held.to_bytes(self.size, "little")

    def decode(self, data: bytes) -> int:
        """Return the value in the first bytes of `data`."""
        held = int.from_bytes(data[: self.size], "little")
        if self.sign and held >> self.sign & 1:
            return -(held & (1 << self.sign) - 1)
        return held

    def __str__(self) -> str:
        return f"{self.name}({self.address})"


IDENTITY = Register("firmware, byte order, model", 0, 5, eeprom=True)
SEVENTH = Register("return delay or second id", 7, 1, eeprom=True)
LEVEL = Register("answer level", 8, 1, eeprom=True)
MIN_ANGLE = Register("min angle", 9, 2, 15, eeprom=True)
MAX_ANGLE = Register("max angle", 11, 2, 15, eeprom=True)
MAX_TORQUE = Register("max torque", 16, 2, eeprom=True)
PHASE = Register("phase", 18, 1, eeprom=True)
PROTECTION_CURRENT = Register("protection current", 28, 2, eeprom=True)
MODE = Register("mode", 33, 1, eeprom=True)
PROTECTION_TIME = Register("over-current time", 38, 1, eeprom=True)
TORQUE = Register("torque", 40, 1)
ACCELERATION = Register("acceleration", 41, 1)
GOAL_POSITION = Register("goal position", 42, 2, 15)
GOAL_SPEED = Register("goal speed", 46, 2, 15)
TORQUE_LIMIT = Register("torque limit", 48, 2)
LOCK = Register("lock", 55, 1)
POSITION = Register("present position", 56, 2, 15)
VOLTAGE = Register("present voltage", 62, 1)
TEMPERATURE = Register("present temperature", 63, 1)
STATUS = Register("status", 65, 1)

CYCLE = Register("torque to present current", TORQUE.address, 31)
"""Read in every cycle: with the samples whether torque is on, and what a power cycle resets."""
STATE = Register("mode to present position", MODE.address, POSITION.address + 2 - MODE.address)
"""Read before torque is switched on, and after: that, and the mode."""

OFF, ON, DAMPED = 0, 1, 2
"""Of torque(40)."""
POSITION_MODE, EFFORT_MODE = 0, 2
"""Of mode(33), as this driver uses them: 2 is PWM on STS and SMS, current on HLS."""
LOCKED, UNLOCKED = 1, 0
"""Of lock(55): locked, what is written to the EEPROM's addresses is gone with the power."""

VOLT = 0.1
CURRENT_UNIT = 6.5e-3
"""[A] Of currents."""
COUNTS_PER_TURN = 4096
DELAY_UNIT_S = 2e-6
PROTECTION_UNIT_S = 0.01
FULL_TORQUE = 1000
"""Of limits: 0.1 % of the whole supply."""

FINE_SPEED, MANY_TURNS = 0x04, 0x10
"""Bits of phase(18): speed in steps/s instead of 50 steps/s; feedback beyond one turn."""
COARSE = 50
"""Steps/s of a count of speed without `FINE_SPEED`."""

BAUDS = {
    0: 1_000_000, 1: 500_000, 2: 250_000, 3: 128_000, 4: 115_200, 5: 76_800, 6: 57_600, 7: 38_400
}  # fmt: skip
"""Values of baud rate(6)."""

STATUS_BITS = {
    0: "supply voltage outside its limits",
    1: "encoder failed",
    2: "overheated",
    3: "over-current",
    5: "overloaded: its torque has fallen to what it holds with",
}
"""Bits of status(65), which are those of every answer's error byte."""


class Table(NamedTuple):
    """Where one table differs: its name, goal of mode 2 and greatest of it, offset, second id."""

    name: str
    goal: Register
    most: int
    offset: Register
    return_delay: Register | None
    second_id: Register | None
    modes: dict[int, str]


STS = Table(
    "STS",
    Register("goal pwm", 44, 2, 10),
    FULL_TORQUE,
    Register("offset", 31, 2, 11, eeprom=True),
    SEVENTH._replace(name="return delay"),
    None,
    {0: "position", 1: "speed", 2: "PWM", 3: "step"},
)
SMS = STS._replace(name="SMS")
HLS = Table(
    "HLS",
    Register("goal torque", 44, 2, 15),
    2047,
    Register("offset", 31, 2, 15, eeprom=True),
    None,
    SEVENTH._replace(name="second id"),
    {0: "position", 1: "speed", 2: "current", 3: "PWM"},
)


class Identity(NamedTuple):
    """What registers 0 to 4 hold: firmware, whether numbers are big-endian, model."""

    major: int
    minor: int
    big_endian: bool
    model: int

    @property
    def firmware(self) -> str:
        """Version, such as 3.10."""
        return f"{self.major}.{self.minor}"

    @property
    def table(self) -> Table | None:
        """The table of this firmware; None: SCS, or an unknown one."""
        if self.big_endian:
            return None
        if self.major == 3:
            return STS if self.minor < 40 else HLS if self.minor < 60 else None
        if self.major == 2 and 40 <= self.minor < 70:
            return SMS
        return SMS if self.major == 1 else None

    @property
    def series(self) -> str:
        """The series, for people."""
        if self.table is not None:
            return self.table.name
        early = self.major == 3 and 20 <= self.minor < 40
        return "SCS" if self.major == 0 or (self.big_endian and early) else "unknown"


def identity_of(data: bytes) -> Identity:
    """Return what the first five registers say."""
    low, high = data[3], data[4]
    big_endian = bool(data[2])
    return Identity(
        data[0], data[1], big_endian, low << 8 | high if big_endian else high << 8 | low
    )


def status_text(status: int) -> str:
    """Return a status as text; bits that no table names appear as numbers."""
    bits = [bit for bit in range(8) if status >> bit & 1]
    return " and ".join(STATUS_BITS.get(bit, f"status bit {bit}") for bit in bits) or "no error"
