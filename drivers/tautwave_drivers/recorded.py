"""What devices report beside their samples, as drivers of several buses record it."""

from __future__ import annotations

from collections.abc import Callable

from tautwave.columns import Column

MOTOR_EFFORT = Column(
    "motor_effort",
    "N m, N",
    "motor effort from its current, where the drive reports it; NaN: no sample",
)
DRIVER_TEMPERATURE = Column(
    "driver_temperature",
    "degC",
    "of the motor's power stage, where it is reported; NaN: no sample",
)
ROTOR_TEMPERATURE = Column(
    "rotor_temperature",
    "degC",
    "of the motor's windings, where it is reported; NaN: no sample",
)
MOTOR_TEMPERATURE = Column(
    "motor_temperature",
    "degC",
    "of the motor or its housing, where it is reported; NaN: no sample",
)
SUPPLY_VOLTAGE = Column(
    "supply_voltage", "V", "of the motor's supply, where it is reported; NaN: no sample"
)
ANSWER = Column(
    "answer_us",
    "µs",
    "CANopen, Modbus: from SYNC or request to the response; NaN if none arrived",
)


def read_by(kind: Column, value: Callable[..., float]) -> Column:
    """Return a kind of column with what reads it, `value(owner)`."""
    return kind._replace(value=value)
