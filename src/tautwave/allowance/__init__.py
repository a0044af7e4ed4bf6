"""What an axis has, and who may spend it: the one owner of an axis' limits and shares."""

from tautwave.allowance.axis import (
    GREATEST_WALL_SHARE,
    LOAD_SHARE,
    AxisAllowance,
    Device,
    Spending,
    share_out,
)

__all__ = [
    "GREATEST_WALL_SHARE",
    "LOAD_SHARE",
    "AxisAllowance",
    "Device",
    "Spending",
    "share_out",
]
