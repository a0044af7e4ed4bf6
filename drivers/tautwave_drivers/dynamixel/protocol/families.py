"""Where servos of each family show what `scan` reports: their control tables differ.

Sources, ROBOTIS e-manual: the pages of the X series; docs/en/dxl/mx/mx-28-2 and its sisters; of the
P series docs/en/dxl/p/ph54-200-s500-r; docs/en/dxl/x/xl320. What a family does not have, or what is
not known of it, is not read, and not reported.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.models import MODELS, VELOCITY_UNIT
from tautwave_drivers.dynamixel.protocol.registers import Register

P_VELOCITY_UNIT = 0.01 * 2.0 * math.pi / 60.0
"""[rad/s] 0.01 rev/min, P series."""


class Family(NamedTuple):
    """Registers of a family, None for one that it has not, and units of its limits [A, rad/s]."""

    mode: Register | None
    return_delay: Register
    second_id: Register | None
    voltage: Register
    temperature: Register
    error: Register
    current_limit: Register | None = None
    current_unit: float = 0.0
    velocity_limit: Register | None = None
    velocity_unit: float = 0.0


_X = Family(
    reg.OPERATING_MODE,
    reg.RETURN_DELAY,
    reg.SECONDARY_ID,
    reg.PRESENT_VOLTAGE,
    reg.PRESENT_TEMPERATURE,
    reg.HARDWARE_ERROR,
    velocity_limit=reg.VELOCITY_LIMIT,
    velocity_unit=VELOCITY_UNIT,
)
_P = _X._replace(
    voltage=Register("present input voltage", 592, 2),
    temperature=Register("present temperature", 594, 1),
    error=Register("hardware error status", 518, 1),
    current_limit=reg.CURRENT_LIMIT,
    current_unit=1e-3,
    velocity_unit=P_VELOCITY_UNIT,
)
_XL320 = Family(
    None,
    Register("return delay time", 5, 1, eeprom=True),
    None,
    Register("present voltage", 45, 1),
    Register("present temperature", 46, 1),
    Register("hardware error status", 50, 1),
)

_MX_CURRENT_UNIT = {30: 0.0, 311: 3.36e-3, 321: 3.36e-3}
"""[A] MX-28(2.0), which measures no current, MX-64(2.0), MX-106(2.0)."""
_XW = (1270, 1280, 1310)
_P_NUMBERS = (2000, 2010, 2020, 2100, 2110, 2120)


def family_of(number: int) -> Family | None:
    """Return the family of a model number in protocol 2.0; None: only what it said is known."""
    units = {model.number: model.current_unit for model in MODELS.values()} | _MX_CURRENT_UNIT
    if number in units:
        limit = reg.CURRENT_LIMIT if units[number] else None
        return _X._replace(current_limit=limit, current_unit=units[number])
    if number in _XW:
        return _X
    if number in _P_NUMBERS:
        return _P
    return _XL320 if number == 350 else None
