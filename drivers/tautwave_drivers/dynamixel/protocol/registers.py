"""Control tables as data: where a register is, how wide, signed or not, lasting or not.

Sources, ROBOTIS e-manual: "Control Table of EEPROM Area" and "Control Table of RAM Area" on the
page of each model, docs/en/dxl/x/<model> for the X series (the addresses below are those of all of
them), docs/en/dxl/ax/ax-12a and docs/en/dxl/mx/mx-28 for protocol 1.0. What is negative is two's
complement in protocol 2.0; in 1.0 bit 10 of speed and load is the direction.
"""

from __future__ import annotations

from typing import NamedTuple


class Register(NamedTuple):
    """One register: address, bytes, and whether it is signed and kept without power."""

    name: str
    address: int
    size: int
    signed: bool = False
    eeprom: bool = False

    def encode(self, value: int) -> bytes:
        """Return `value` as the register holds it; beyond its range, the nearest end."""
        bits = 8 * self.size
        low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if self.signed else (0, (1 << bits) - 1)
        value = low if value < low else high if value > high else value
        return value.to_bytes(self.size, "little", signed=self.signed)

    def decode(self, data: bytes) -> int:
        """Return the value in the first bytes of `data`."""
        return int.from_bytes(data[: self.size], "little", signed=self.signed)


MODEL_NUMBER = Register("model number", 0, 2, eeprom=True)
FIRMWARE = Register("firmware version", 6, 1, eeprom=True)
HOMING_OFFSET = Register("homing offset", 20, 4, signed=True, eeprom=True)
RETURN_DELAY = Register("return delay time", 9, 1, eeprom=True)
DRIVE_MODE = Register("drive mode", 10, 1, eeprom=True)
OPERATING_MODE = Register("operating mode", 11, 1, eeprom=True)
SECONDARY_ID = Register("secondary id", 12, 1, eeprom=True)
PWM_LIMIT = Register("pwm limit", 36, 2, eeprom=True)
CURRENT_LIMIT = Register("current limit", 38, 2, eeprom=True)
VELOCITY_LIMIT = Register("velocity limit", 44, 4, eeprom=True)
MAX_POSITION = Register("max position limit", 48, 4, eeprom=True)
MIN_POSITION = Register("min position limit", 52, 4, eeprom=True)
STARTUP = Register("startup configuration", 60, 1, eeprom=True)
SHUTDOWN = Register("shutdown", 63, 1, eeprom=True)
TORQUE_ENABLE = Register("torque enable", 64, 1)
LED = Register("led", 65, 1)
STATUS_RETURN_LEVEL = Register("status return level", 68, 1)
HARDWARE_ERROR = Register("hardware error status", 70, 1)
BUS_WATCHDOG = Register("bus watchdog", 98, 1, signed=True)
GOAL_PWM = Register("goal pwm", 100, 2, signed=True)
GOAL_CURRENT = Register("goal current", 102, 2, signed=True)
GOAL_VELOCITY = Register("goal velocity", 104, 4, signed=True)
PROFILE_ACCELERATION = Register("profile acceleration", 108, 4)
PROFILE_VELOCITY = Register("profile velocity", 112, 4)
GOAL_POSITION = Register("goal position", 116, 4, signed=True)
PRESENT_CURRENT = Register("present current", 126, 2, signed=True)
PRESENT_VELOCITY = Register("present velocity", 128, 4, signed=True)
PRESENT_POSITION = Register("present position", 132, 4, signed=True)
PRESENT_VOLTAGE = Register("present input voltage", 144, 2)
PRESENT_TEMPERATURE = Register("present temperature", 146, 1)

PRESENT = Register("present current, velocity, position", 126, 10)
"""The block of every cycle: three registers that lie side by side."""

KEPT = (
    (DRIVE_MODE, OPERATING_MODE, SECONDARY_ID),
    (HOMING_OFFSET,),
    (PWM_LIMIT, CURRENT_LIMIT, VELOCITY_LIMIT),
    (STARTUP, SHUTDOWN),
    (BUS_WATCHDOG, GOAL_PWM),
    (PROFILE_ACCELERATION, PROFILE_VELOCITY),
)
"""What a run relies on beside torque enable, by neighbours that one read takes."""

INDIRECT_ADDRESS = 168
"""First of the 2-byte registers that say what appears at the indirect data, all X models."""

STATUS_BYTES = PRESENT.size + TORQUE_ENABLE.size + HARDWARE_ERROR.size + BUS_WATCHDOG.size
"""Of the block that the indirect addresses make."""

FULL_PWM = 885
"""PWM Limit(36) and Goal PWM(100) of the whole supply."""

CURRENT_MODE = 0
VELOCITY_MODE = 1
POSITION_MODE = 3
CURRENT_POSITION_MODE = 5
MODES = {
    0: "current", 1: "velocity", 3: "position", 4: "extended position",
    5: "current-based position", 16: "PWM",
}  # fmt: skip

BAUDS = {0: 9_600, 1: 57_600, 2: 115_200, 3: 1_000_000, 4: 2_000_000, 5: 3_000_000, 6: 4_000_000,
         7: 4_500_000}  # fmt: skip
"""Values of Baud Rate(8); the 330 models end at 4 Mbaud."""

RETURN_DELAY_UNIT_S = 2e-6
WATCHDOG_UNIT_S = 0.02
WATCHDOG_TRIPPED = -1
WATCHDOG_FIRMWARE = 38
"""First firmware of the 430 and 540 models with a bus watchdog; every 330 has one."""

FIRST_MODEL_NUMBER = Register("model number", 0, 2, eeprom=True)
FIRST_PRESENT = Register("present position, speed, load", 36, 6)
