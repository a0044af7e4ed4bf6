"""Control tables of the X series (protocol 2.0).

Each model names its e-manual page; tables, ranges, defaults and stall figures are from there
(stall at the recommended voltage). Where pages and firmware differ, the newest page counts.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from tautwave_sim.dynamixel.items import EEPROM, RW, Indirect, Item, Model, R, indirect_items

RPM = "0.229 rev/min"
S32 = 2**31 - 1
HOMING = 1_044_479

BAUDS_430 = (
    (0, 9600),
    (1, 57600),
    (2, 115200),
    (3, 1_000_000),
    (4, 2_000_000),
    (5, 3_000_000),
    (6, 4_000_000),
    (7, 4_500_000),
)
BAUDS_330 = BAUDS_430[:7]

# e-manual docs/en/dxl/x/xm430-w350, "Control Table of EEPROM Area"
EEPROM_ITEMS = (
    Item(0, 2, "Model Number", R, EEPROM),
    Item(2, 4, "Model Information", R, EEPROM),
    Item(6, 1, "Firmware Version", R, EEPROM),
    Item(7, 1, "ID", RW, EEPROM, 1, 0, 252),
    Item(8, 1, "Baud Rate", RW, EEPROM, 1, 0, 7),
    Item(9, 1, "Return Delay Time", RW, EEPROM, 250, 0, 254, "2 us"),
    Item(10, 1, "Drive Mode", RW, EEPROM, 0, 0, 13),
    Item(11, 1, "Operating Mode", RW, EEPROM, 3, 0, 16),
    Item(12, 1, "Secondary(Shadow) ID", RW, EEPROM, 255, 0, 255),
    Item(13, 1, "Protocol Type", RW, EEPROM, 2, 1, 2),
    Item(20, 4, "Homing Offset", RW, EEPROM, 0, -HOMING, HOMING, "1 pulse", signed=True),
    Item(24, 4, "Moving Threshold", RW, EEPROM, 10, 0, 1023, RPM),
    Item(31, 1, "Temperature Limit", RW, EEPROM, 80, 0, 100, "1 degC"),
    Item(32, 2, "Max Voltage Limit", RW, EEPROM, 160, 95, 160, "0.1 V"),
    Item(34, 2, "Min Voltage Limit", RW, EEPROM, 95, 95, 160, "0.1 V"),
    Item(36, 2, "PWM Limit", RW, EEPROM, 885, 0, 885, "0.113 %"),
    Item(38, 2, "Current Limit", RW, EEPROM, 1193, 0, 1193, "2.69 mA"),
    Item(44, 4, "Velocity Limit", RW, EEPROM, 200, 0, 1023, RPM),
    Item(48, 4, "Max Position Limit", RW, EEPROM, 4095, 0, 4095, "1 pulse"),
    Item(52, 4, "Min Position Limit", RW, EEPROM, 0, 0, 4095, "1 pulse"),
    Item(60, 1, "Startup Configuration", RW, EEPROM, 0, 0, 3),
    Item(63, 1, "Shutdown", RW, EEPROM, 52, 0, 255),
)

# e-manual docs/en/dxl/x/xm430-w350, "Control Table of RAM Area"
RAM_ITEMS = (
    Item(64, 1, "Torque Enable", high=1),
    Item(65, 1, "LED", high=1),
    Item(68, 1, "Status Return Level", initial=2, high=2),
    Item(69, 1, "Registered Instruction", R),
    Item(70, 1, "Hardware Error Status", R),
    Item(76, 2, "Velocity I Gain", initial=1920, high=16383),
    Item(78, 2, "Velocity P Gain", initial=100, high=16383),
    Item(80, 2, "Position D Gain", initial=0, high=16383),
    Item(82, 2, "Position I Gain", initial=0, high=16383),
    Item(84, 2, "Position P Gain", initial=800, high=16383),
    Item(88, 2, "Feedforward 2nd Gain", high=16383),
    Item(90, 2, "Feedforward 1st Gain", high=16383),
    Item(98, 1, "Bus Watchdog", high=127, unit="20 ms"),
    Item(100, 2, "Goal PWM", low=-885, high=885, unit="0.113 %", signed=True, limit="PWM Limit"),
    Item(
        102,
        2,
        "Goal Current",
        low=-32768,
        high=32767,
        unit="2.69 mA",
        signed=True,
        limit="Current Limit",
    ),
    Item(
        104, 4, "Goal Velocity", low=-S32, high=S32, unit=RPM, signed=True, limit="Velocity Limit"
    ),
    Item(108, 4, "Profile Acceleration", high=32767, unit="214.577 rev/min2"),
    Item(112, 4, "Profile Velocity", high=32767, unit=RPM),
    Item(116, 4, "Goal Position", low=-HOMING - 4096, high=HOMING + 4096, signed=True),
    Item(120, 2, "Realtime Tick", R, unit="1 ms"),
    Item(122, 1, "Moving", R),
    Item(123, 1, "Moving Status", R),
    Item(124, 2, "Present PWM", R, unit="0.113 %", signed=True),
    Item(126, 2, "Present Current", R, unit="2.69 mA", signed=True),
    Item(128, 4, "Present Velocity", R, unit=RPM, signed=True),
    Item(132, 4, "Present Position", R, unit="1 pulse", signed=True),
    Item(136, 4, "Velocity Trajectory", R, unit=RPM, signed=True),
    Item(140, 4, "Position Trajectory", R, unit="1 pulse", signed=True),
    Item(144, 2, "Present Input Voltage", R, unit="0.1 V"),
    Item(146, 1, "Present Temperature", R, unit="1 degC"),
    Item(147, 1, "Backup Ready", R, initial=1),
)

# e-manual docs/en/dxl/x/xm540-w270
PORT_ITEMS = (
    *(Item(55 + n, 1, f"External Port Mode {n}", RW, EEPROM, 3, 0, 3) for n in (1, 2, 3)),
    *(Item(150 + 2 * n, 2, f"External Port Data {n}", high=4095) for n in (1, 2, 3)),
)
# e-manual docs/en/dxl/x/xl330-m288
SLOPE_ITEM = Item(62, 1, "PWM Slope", RW, EEPROM, 140, 1, 255, "1.977 mV/ms")
# e-manual docs/en/dxl/x/xl430-w250: no current items, a load in their place
LOAD_ITEM = Item(126, 2, "Present Load", R, unit="0.1 %", signed=True)
CURRENT_NAMES = ("Current Limit", "Goal Current", "Present Current")

INDIRECT_430 = (Indirect(168, 224, 28), Indirect(578, 634, 28))
INDIRECT_330 = (Indirect(168, 208, 20),)
INDIRECT_330_OLD = (Indirect(168, 224, 20),)
OLD_330_FIRMWARE = 52
"""Before this firmware the data of the 330 begin at 224 (dynamixel-sdk, xl330_m288.model)."""


DEFAULT_GAINS = (1920, 100, 0, 0, 800)
"""Velocity I and P, position D, I and P."""


FIRST_WATCHDOG = 38
"""First firmware of the 430 and 540 with Bus Watchdog(98) and Drive Mode(10); all 330 have them."""


class Figures(NamedTuple):
    """What differs between the models of a family: numbers of its page."""

    name: str
    number: int
    stall_torque: float  # [N m]
    stall_current: float  # [A]
    no_load_speed_rpm: float
    voltage: float  # [V] recommended, of the stall figures
    current_limit: int  # counts; 0: no current control
    velocity_limit: int  # counts
    gains: tuple[int, int, int, int, int] = DEFAULT_GAINS
    current_unit_a: float = 2.69e-3
    voltage_limits: tuple[int, int] = (95, 160)  # 0.1 V
    temperature_limit: int = 80  # degC
    shutdown: int = 52
    pwm_slope: int = 140


HIGH_GAINS = (1920, 100, 0, 0, 900)
SMALL_T = (1200, 40, 0, 0, 900)
V24 = (110, 300)
XL5 = (31, 70)

# One line a model, from docs/en/dxl/x/<name in lower case>. Not read: the tables of XC430-W240,
# 2XL430-W250, 2XC430-W250 and XW540-T140 (as their sisters, velocity limit by no-load speed).
# Velocity limits of XH430-W210, -V350 and -V210 are of newer firmware, from memory (old pages: 360,
# 285, 380); XH540-V270's current limit is its sister's newer one (its page, an old one: 2047).
# fmt: off
SERIES_430 = (
    Figures("XH430-W350", 1000, 3.4, 1.3, 30.0, 12.0, 648, 130, HIGH_GAINS),
    Figures("XD430-T350", 1001, 3.4, 1.3, 30.0, 12.0, 648, 130, HIGH_GAINS),
    Figures("XH430-W210", 1010, 2.5, 1.3, 50.0, 12.0, 648, 210, HIGH_GAINS),
    Figures("XD430-T210", 1011, 2.5, 1.3, 50.0, 12.0, 648, 210, HIGH_GAINS),
    Figures("XM430-W350", 1020, 4.1, 2.3, 46.0, 12.0, 1193, 200),
    Figures("XM430-W210", 1030, 3.0, 2.3, 77.0, 12.0, 1193, 330),
    Figures("XH430-V350", 1040, 3.3, 0.7, 31.0, 24.0, 689, 135, DEFAULT_GAINS, 1.34e-3, V24),
    Figures("XH430-V210", 1050, 2.6, 0.7, 52.0, 24.0, 689, 230, DEFAULT_GAINS, 1.34e-3, V24),
)
SERIES_430_LOAD = (
    Figures("XL430-W250", 1060, 1.4, 1.3, 57.0, 11.1, 0, 265,
            (1000, 100, 4000, 0, 640), 0.0, (60, 140), 72),
    Figures("2XL430-W250", 1090, 1.4, 1.3, 57.0, 11.1, 0, 250,
            (1000, 100, 4000, 0, 640), 0.0, (60, 140), 72),
    Figures("XC430-W150", 1070, 1.6, 1.4, 106.0, 12.0, 0, 460,
            (1920, 100, 0, 0, 460), 0.0, (60, 160)),
    Figures("XC430-W240", 1080, 1.9, 1.4, 70.0, 12.0, 0, 306,
            (1920, 100, 0, 0, 460), 0.0, (60, 160)),
    Figures("2XC430-W250", 1160, 1.8, 1.4, 64.0, 12.0, 0, 280,
            (1920, 100, 0, 0, 460), 0.0, (60, 160)),
)
SERIES_540 = (
    Figures("XH540-W270", 1100, 9.9, 4.9, 39.0, 12.0, 2047, 167),
    Figures("XD540-T270", 1101, 9.9, 4.9, 39.0, 12.0, 2047, 167),
    Figures("XH540-W150", 1110, 7.1, 4.9, 70.0, 12.0, 2047, 300),
    Figures("XD540-T150", 1111, 7.1, 4.9, 70.0, 12.0, 2047, 300),
    Figures("XM540-W270", 1120, 10.6, 4.4, 30.0, 12.0, 2047, 128),
    Figures("XM540-W150", 1130, 7.3, 4.4, 53.0, 12.0, 2047, 230),
    Figures("XH540-V270", 1140, 9.2, 2.4, 34.0, 24.0, 1188, 128, voltage_limits=V24),
    Figures("XH540-V150", 1150, 6.4, 2.4, 60.0, 24.0, 1188, 230, voltage_limits=V24),
)
SERIES_XW = (  # no LED
    Figures("XW540-T260", 1170, 9.5, 4.9, 40.0, 12.0, 2047, 167),
    Figures("XW540-T140", 1180, 6.9, 4.9, 72.0, 12.0, 2047, 300),
)
SERIES_330 = (
    Figures("XL330-M077", 1190, 0.215, 1.47, 383.0, 5.0, 1750, 1620,
            (400, 40, 0, 400, 400), 1e-3, XL5, 70, 53),
    Figures("XL330-M288", 1200, 0.52, 1.47, 103.0, 5.0, 1750, 445,
            (1600, 180, 0, 0, 400), 1e-3, XL5, 70, 53),
    Figures("XC330-T181", 1210, 0.76, 0.80, 104.0, 11.1, 910, 510,
            SMALL_T, 1e-3, (55, 140), 70, pwm_slope=255),
    Figures("XC330-T288", 1220, 0.92, 0.80, 65.0, 11.1, 910, 320,
            SMALL_T, 1e-3, (55, 140), 70, pwm_slope=255),
    Figures("XC330-M181", 1230, 0.60, 1.80, 129.0, 5.0, 2352, 545,
            (1400, 100, 500, 0, 1200), 1e-3, XL5, 70),
    Figures("XC330-M288", 1240, 0.93, 1.80, 81.0, 5.0, 2352, 350,
            (1600, 50, 500, 0, 1100), 1e-3, XL5, 70),
)
# fmt: on

GAINS = (
    "Velocity I Gain",
    "Velocity P Gain",
    "Position D Gain",
    "Position I Gain",
    "Position P Gain",
)


def _changes(figures: Figures, small: bool) -> dict[str, dict[str, Any]]:
    """Return what a model's items have of their own."""
    low, high = figures.voltage_limits
    unit = f"{figures.current_unit_a * 1e3:.3g} mA"
    lowest = 35 if (low, high) == (31, 70) else low
    changes: dict[str, dict[str, Any]] = {
        "Model Number": {"initial": figures.number},
        "Temperature Limit": {"initial": figures.temperature_limit},
        "Max Voltage Limit": {"initial": high, "low": low, "high": high},
        "Min Voltage Limit": {"initial": lowest, "low": low, "high": high},
        "Current Limit": {
            "initial": figures.current_limit,
            "high": figures.current_limit,
            "unit": unit,
        },
        "Goal Current": {"unit": unit},
        "Present Current": {"unit": unit},
        "Velocity Limit": {"initial": figures.velocity_limit, "high": 2047 if small else 1023},
        "Shutdown": {"initial": figures.shutdown},
        "PWM Slope": {"initial": figures.pwm_slope},
    }
    for name, value in zip(GAINS, figures.gains, strict=True):
        changes[name] = {"initial": value}
    if small:
        changes["Baud Rate"] = {"high": 6}
        changes["Protocol Type"] = {"low": 2, "high": 22}
    return changes


def _model(figures: Figures, extra: tuple[Item, ...], small: bool, firmware: int) -> Model:
    indirect: tuple[Indirect, ...] = INDIRECT_430
    if small:
        indirect = INDIRECT_330 if firmware >= OLD_330_FIRMWARE else INDIRECT_330_OLD
    top = max(block.data + block.length for block in indirect) - 1
    changes = _changes(figures, small)
    changes["Firmware Version"] = {"initial": firmware}
    missing: tuple[str, ...] = () if figures.current_limit else CURRENT_NAMES
    if figures in SERIES_XW:
        missing = ("LED",)
    if firmware < FIRST_WATCHDOG and not small:
        missing += ("Bus Watchdog", "Drive Mode")
    items = [
        item._replace(**changes.get(item.name, {}))
        for item in (*EEPROM_ITEMS, *RAM_ITEMS, *extra)
        if item.name not in missing
    ]
    first = 1
    for block in indirect:
        items += indirect_items(block, first, top)
        first += block.length
    return Model(
        name=figures.name,
        number=figures.number,
        protocol=2.0,
        firmware=firmware,
        page=f"docs/en/dxl/x/{figures.name.lower()}",
        items=tuple(sorted(items)),
        indirect=indirect,
        bauds=BAUDS_330 if small else BAUDS_430,
        current_unit_a=figures.current_unit_a,
        stall_torque=figures.stall_torque,
        stall_current=figures.stall_current,
        no_load_speed_rpm=figures.no_load_speed_rpm,
        voltage=figures.voltage,
        counts=4096,
        turn_rad=math.tau,
        velocity_unit_rpm=0.229,
        centre_counts=2048,
        # e-manual, "Fast Sync Read": X430 and X540 from 45 on, X330 from 46 on
        fast_firmware=46 if small else 45,
    )


def x_series(firmware_430: int = 48, firmware_330: int = 53) -> tuple[Model, ...]:
    """Return the models of the X series with these firmware versions."""
    small = (SLOPE_ITEM,)
    return (
        *(_model(one, (), small=False, firmware=firmware_430) for one in SERIES_430),
        *(_model(one, (LOAD_ITEM,), False, firmware_430) for one in SERIES_430_LOAD),
        *(_model(one, PORT_ITEMS, False, firmware_430) for one in SERIES_540),
        *(_model(one, (), False, firmware_430) for one in SERIES_XW),
        *(_model(one, small, True, firmware_330) for one in SERIES_330),
    )
