"""Memory tables of Feetech servos from their documents: bytes by address, the servo's side.

Sources: the vendor's SDK (ftservo/FTServo_Python); memory tables of vassar-feetech-servo-sdk.
"""

from __future__ import annotations

from typing import NamedTuple

SIZE = 87
EEPROM_END = 40
"""Addresses below are kept without power, once they were written unlocked."""
READ_ONLY_FROM, WRITABLE_FROM = 56, 5

ID, BAUD, DELAY, LEVEL, MIN_ANGLE, MAX_ANGLE, MAX_TORQUE, PHASE = 5, 6, 7, 8, 9, 11, 16, 18
PROTECTION_CURRENT, OFFSET, MODE, HOLDING, OVERLOAD_TIME, OVERLOAD, PROTECTION_TIME = (
    28, 31, 33, 34, 35, 36, 38,
)  # fmt: skip
TORQUE, ACCELERATION, GOAL_POSITION, GOAL, GOAL_SPEED, TORQUE_LIMIT, LOCK = (
    40, 41, 42, 44, 46, 48, 55,
)  # fmt: skip
POSITION, SPEED, LOAD, VOLTAGE, TEMPERATURE, STATUS, MOVING, CURRENT = (
    56, 58, 60, 62, 63, 65, 66, 69,
)  # fmt: skip

BAUDS = {
    0: 1_000_000, 1: 500_000, 2: 250_000, 3: 128_000, 4: 115_200, 5: 76_800, 6: 57_600, 7: 38_400
}  # fmt: skip
FINE_SPEED, MANY_TURNS = 0x04, 0x10
VOLTAGE_BIT, ENCODER_BIT, HEAT_BIT, CURRENT_BIT, OVERLOAD_BIT = 0x01, 0x02, 0x04, 0x08, 0x20

FACTORY = {
    BAUD: 0, DELAY: 250, LEVEL: 1, MAX_ANGLE: 0xFF, MAX_ANGLE + 1: 0x0F, 13: 70, 14: 80, 15: 40,
    MAX_TORQUE: 0xE8, MAX_TORQUE + 1: 0x03, 21: 32, 22: 32, 24: 16, 26: 1, 27: 1,
    PROTECTION_CURRENT: 0xF4, PROTECTION_CURRENT + 1: 0x01, PROTECTION_TIME: 200,
}  # fmt: skip
"""Of a servo as it leaves the factory, STS and HLS."""
FACTORY_STS = {HOLDING: 20, OVERLOAD_TIME: 200, OVERLOAD: 80}
"""On HLS these are gains of its current loop."""


class Model(NamedTuple):
    """A model: its identity (registers 0 to 4), whether it has a current loop, and its motor.

    `constant` [N m/A] and `inertia` [kg m^2], `friction` [N m s/rad], `coulomb` [N m] at the horn,
    `resistance` [ohm], `voltage` [V] it is made for, with its gear of 1:`gear`.
    """

    name: str
    identity: tuple[int, int, int, int, int]
    hls: bool
    constant: float
    resistance: float
    voltage: float
    gear: float
    inertia: float
    friction: float
    coulomb: float

    @property
    def sync_reads(self) -> bool:
        """Whether it knows the sync read: SCS do not."""
        return self.identity[2] == 0

    @property
    def offset_sign(self) -> int:
        """The bit of the offset's sign."""
        return 15 if self.hls else 11


MODELS = {
    model.name: model
    for model in (
        # Rhoban/bam: 7.4 V, 1:345, identified at the horn.
        Model("STS3215", (3, 10, 0, 9, 3), False, 1.21, 2.68, 7.4, 345, 0.0284, 0.059, 0.052),
        # Torque constant as its users measured it; the rest of its motor is assumed.
        Model("HLS3625", (3, 42, 0, 10, 13), True, 0.814, 3.0, 12.0, 345, 0.006, 0.03, 0.02),
        # Only its packets matter: its motor is assumed.
        Model("SCS0009", (0, 9, 1, 5, 4), False, 0.2, 3.0, 6.0, 300, 0.001, 0.005, 0.005),
    )
}


def magnitude(value: int, sign: int) -> int:
    """Return a number as sign and magnitude, its sign at a bit; beyond its range, the end."""
    size = min(abs(value), (1 << sign) - 1)
    return size | 1 << sign if value < 0 else size


def signed(held: int, sign: int) -> int:
    """Return the number that sign and magnitude hold."""
    size = held & (1 << sign) - 1
    return -size if held >> sign & 1 else size
