"""Control tables of AX-12 and MX-28 with protocol 1.0.

Speed, load and torque are a size of ten bits and a direction in bit 10 (1024: clockwise, negative).
"""

from __future__ import annotations

import math

from tautwave_sim.dynamixel.items import EEPROM, RW, Item, Model, R

# Baud rate = 2 000 000 / (value + 1), and three more on the MX (docs/en/dxl/mx/mx-28).
_BAUDS = ((1, 1_000_000), (3, 500_000), (4, 400_000), (7, 250_000), (9, 200_000), (16, 117_647))
BAUDS = (*_BAUDS, (34, 57_142), (103, 19_230), (207, 9_615))
BAUDS_MX = (*BAUDS, (0, 2_000_000), (250, 2_250_000), (251, 2_500_000), (252, 3_000_000))

# e-manual docs/en/dxl/ax/ax-12a
COMMON = (
    Item(0, 2, "Model Number", R, EEPROM, 12),
    Item(2, 1, "Firmware Version", R, EEPROM, 24),
    Item(3, 1, "ID", RW, EEPROM, 1, 0, 253),
    Item(4, 1, "Baud Rate", RW, EEPROM, 1, 0, 254),
    Item(5, 1, "Return Delay Time", RW, EEPROM, 250, 0, 254, "2 us"),
    Item(6, 2, "CW Angle Limit", RW, EEPROM, 0, 0, 1023),
    Item(8, 2, "CCW Angle Limit", RW, EEPROM, 1023, 0, 1023),
    Item(11, 1, "Temperature Limit", RW, EEPROM, 70, 0, 150, "1 degC"),
    Item(12, 1, "Min Voltage Limit", RW, EEPROM, 60, 50, 250, "0.1 V"),
    Item(13, 1, "Max Voltage Limit", RW, EEPROM, 140, 50, 250, "0.1 V"),
    Item(14, 2, "Max Torque", RW, EEPROM, 1023, 0, 1023, "0.1 %"),
    Item(16, 1, "Status Return Level", RW, EEPROM, 2, 0, 2),
    Item(17, 1, "Alarm LED", RW, EEPROM, 36, 0, 127),
    Item(18, 1, "Shutdown", RW, EEPROM, 36, 0, 127),
    Item(24, 1, "Torque Enable", high=1),
    Item(25, 1, "LED", high=1),
    Item(30, 2, "Goal Position", high=1023),
    Item(32, 2, "Moving Speed", high=2047),
    Item(34, 2, "Torque Limit", initial=1023, high=1023, unit="0.1 %"),
    Item(36, 2, "Present Position", R),
    Item(38, 2, "Present Speed", R),
    Item(40, 2, "Present Load", R, unit="0.1 %"),
    Item(42, 1, "Present Input Voltage", R, unit="0.1 V"),
    Item(43, 1, "Present Temperature", R, unit="1 degC"),
    Item(44, 1, "Registered Instruction", R),
    Item(46, 1, "Moving", R),
    Item(47, 1, "Lock", high=1),
    Item(48, 2, "Punch", initial=32, high=1023),
)
AX_ITEMS = (
    Item(26, 1, "CW Compliance Margin", initial=1),
    Item(27, 1, "CCW Compliance Margin", initial=1),
    Item(28, 1, "CW Compliance Slope", initial=32),
    Item(29, 1, "CCW Compliance Slope", initial=32),
)
# e-manual docs/en/dxl/mx/mx-28 (protocol 1.0)
MX_ITEMS = (
    Item(20, 2, "Multi Turn Offset", RW, EEPROM, 0, -26624, 26624, signed=True),
    Item(22, 1, "Resolution Divider", RW, EEPROM, 1, 1, 4),
    Item(26, 1, "D Gain", initial=0, high=254),
    Item(27, 1, "I Gain", initial=0, high=254),
    Item(28, 1, "P Gain", initial=32, high=254),
    Item(50, 2, "Realtime Tick", R, unit="1 ms"),
    Item(73, 1, "Goal Acceleration", high=254),
)
MX_CHANGES: dict[str, dict[str, int]] = {
    "Model Number": {"initial": 29},
    "Firmware Version": {"initial": 41},
    "Baud Rate": {"initial": 34},
    "CW Angle Limit": {"high": 4095},
    "CCW Angle Limit": {"initial": 4095, "high": 4095},
    "Temperature Limit": {"initial": 80, "high": 99},
    "Max Voltage Limit": {"initial": 160},
    "Goal Position": {"high": 4095},
    "Punch": {"initial": 0},
}


def old_series() -> tuple[Model, ...]:
    """Return the models with protocol 1.0."""
    mx = tuple(item._replace(**MX_CHANGES.get(item.name, {})) for item in COMMON)  # type: ignore[arg-type]
    return (
        Model(
            name="AX-12A",
            number=12,
            protocol=1.0,
            firmware=24,
            page="docs/en/dxl/ax/ax-12a",
            items=tuple(sorted(COMMON + AX_ITEMS)),
            indirect=(),
            bauds=BAUDS,
            current_unit_a=0.0,
            stall_torque=1.5,
            stall_current=1.5,
            no_load_speed_rpm=59.0,
            voltage=12.0,
            counts=1023,
            turn_rad=math.radians(300.0),
            velocity_unit_rpm=0.111,
            centre_counts=512,
        ),
        Model(
            name="MX-28",
            number=29,
            protocol=1.0,
            firmware=41,
            page="docs/en/dxl/mx/mx-28",
            items=tuple(sorted(mx + MX_ITEMS)),
            indirect=(),
            bauds=BAUDS_MX,
            current_unit_a=0.0,
            stall_torque=2.5,
            stall_current=1.4,
            no_load_speed_rpm=55.0,
            voltage=12.0,
            counts=4096,
            turn_rad=math.tau,
            velocity_unit_rpm=0.114,
            centre_counts=2048,
        ),
    )
