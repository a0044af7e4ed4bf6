"""Scripted moments of a servo: its hardware errors, and what happens to its line."""

from __future__ import annotations

from tautwave_sim.dynamixel.motor import (
    ENCODER_BIT,
    OVERHEAT_BIT,
    OVERLOAD_BIT,
    SHOCK_BIT,
    VOLTAGE_BIT,
)
from tautwave_sim.wire.serial_faults import LINE_KINDS

HARDWARE_KINDS = {
    "input_voltage": VOLTAGE_BIT,
    "overheat": OVERHEAT_BIT,
    "encoder": ENCODER_BIT,
    "electrical_shock": SHOCK_BIT,
    "overload": OVERLOAD_BIT,
}
MOMENT_KINDS = (*HARDWARE_KINDS, *LINE_KINDS)
