"""Servo models as data: number, units of the current, and the slope of the stall torque.

Sources: ROBOTIS e-manual, page docs/en/dxl/x/<model> ("Specifications": stall torque and current at
the recommended voltage; "Current Limit(38)": unit), model numbers also in dynamixel-sdk,
`control_table/dynamixel.model`. ROBOTIS publishes no torque constant; the slope stall torque over
stall current stands for it, friction and gear losses included: +-20 %, so give `torque_constant`
in the rig file once it is measured.
"""

from __future__ import annotations

import math
from typing import NamedTuple

COUNTS_PER_TURN = 4096
"""Of the encoder, all X models [pulse/rev]."""

VELOCITY_UNIT = 0.229 * 2.0 * math.pi / 60.0
"""[rad/s] 0.229 rev/min, all X models."""

LOAD_UNIT = 0.001
"""Present Load(126) of models that do not measure current: share of the stall torque."""

CAVEAT = "the stall slope, +-20 %"


class Model(NamedTuple):
    """One model. `current_unit` [A] is 0 where current is neither measured nor controlled.

    `stall_torque` [N m] and `stall_current` [A] at the recommended voltage; `current_range` is the
    greatest Current Limit(38) [counts].
    """

    name: str
    number: int
    current_unit: float
    stall_torque: float
    stall_current: float
    current_range: int = 0
    fastest_baud: int = 4_500_000
    indirect_data: int = 224

    @property
    def page(self) -> str:
        """The e-manual's page."""
        return f"docs/en/dxl/x/{self.name.lower()}"

    @property
    def torque_constant(self) -> float:
        """[N m/A] At the horn: stall torque over stall current; +-20 %. 0: not known."""
        return self.stall_torque / self.stall_current if self.stall_current > 0.0 else 0.0

    @property
    def always_watched(self) -> bool:
        """Whether every firmware has a bus watchdog."""
        return "330" in self.name


def _small(name: str, number: int, torque: float, current: float, most: int) -> Model:
    return Model(name, number, 1e-3, torque, current, most, 4_000_000, indirect_data=208)


_X = (
    _small("XL330-M077", 1190, 0.215, 1.47, 1750),
    _small("XL330-M288", 1200, 0.52, 1.47, 1750),
    _small("XC330-T181", 1210, 0.76, 0.80, 910),
    _small("XC330-T288", 1220, 0.92, 0.80, 910),
    _small("XC330-M181", 1230, 0.60, 1.80, 2352),
    _small("XC330-M288", 1240, 0.93, 1.80, 2352),
    Model("XL430-W250", 1060, 0.0, 1.4, 1.3),
    Model("2XL430-W250", 1090, 0.0, 1.4, 1.3),
    Model("XC430-W150", 1070, 0.0, 1.6, 1.4),
    Model("XC430-W240", 1080, 0.0, 1.9, 1.4),
    Model("2XC430-W250", 1160, 0.0, 1.8, 1.4),
    Model("XM430-W350", 1020, 2.69e-3, 4.1, 2.3, 1193),
    Model("XM430-W210", 1030, 2.69e-3, 3.0, 2.3, 1193),
    Model("XH430-W350", 1000, 2.69e-3, 3.4, 1.3, 648),
    Model("XH430-W210", 1010, 2.69e-3, 2.5, 1.3, 648),
    Model("XD430-T350", 1001, 2.69e-3, 3.4, 1.3, 648),
    Model("XD430-T210", 1011, 2.69e-3, 2.5, 1.3, 648),
    Model("XH430-V350", 1040, 1.34e-3, 3.3, 0.7, 689),
    Model("XH430-V210", 1050, 1.34e-3, 2.6, 0.7, 689),
    Model("XM540-W270", 1120, 2.69e-3, 10.6, 4.4, 2047),
    Model("XM540-W150", 1130, 2.69e-3, 7.3, 4.4, 2047),
    Model("XH540-W270", 1100, 2.69e-3, 9.9, 4.9, 2047),
    Model("XH540-W150", 1110, 2.69e-3, 7.1, 4.9, 2047),
    Model("XD540-T270", 1101, 2.69e-3, 9.9, 4.9, 2047),
    Model("XD540-T150", 1111, 2.69e-3, 7.1, 4.9, 2047),
    Model("XH540-V270", 1140, 2.69e-3, 9.2, 2.4, 1188),
    Model("XH540-V150", 1150, 2.69e-3, 6.4, 2.4, 1188),
    Model("XW540-T260", 1170, 2.69e-3, 9.5, 4.9, 2047),
    Model("XW540-T140", 1180, 2.69e-3, 6.9, 4.9, 2047),
)

MODELS = {model.name: model for model in _X}
"""The models that a rig can name."""

FIRST_NAMES = {
    12: "AX-12A", 18: "AX-18A", 300: "AX-12W", 24: "RX-24F", 28: "RX-28", 64: "RX-64",
    107: "EX-106+", 29: "MX-28", 310: "MX-64", 320: "MX-106", 360: "MX-12W",
}  # fmt: skip
"""Models of protocol 1.0, which have their present values at the same addresses."""

_OTHER_NAMES = {
    30: "MX-28(2.0)", 311: "MX-64(2.0)", 321: "MX-106(2.0)", 350: "XL-320", 1270: "XW430-T333",
    1280: "XW430-T200", 1310: "XW540-H260", 2000: "PH42-020-S300", 2010: "PH54-100-S500",
    2020: "PH54-200-S500", 2100: "PM42-010-S260", 2110: "PM54-040-S250", 2120: "PM54-060-S250",
}  # fmt: skip
"""Models that `scan` names, but no rig can drive."""


def model_name(number: int, protocol: float = 2.0) -> str:
    """Return the name of a model number, `model N` if it is unknown here."""
    if protocol < 1.5:
        return FIRST_NAMES.get(number, f"model {number}")
    for model in _X:
        if model.number == number:
            return model.name
    return _OTHER_NAMES.get(number, f"model {number}")
