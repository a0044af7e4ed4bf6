"""What an axis has, and who may spend it: the one owner of an axis' limits and shares."""

from tautwave.allowance.axis import (
    LOAD_SHARE,
    MAX_WALL_SHARE,
    AxisAllowance,
    Device,
    Spending,
    share_out,
)

__all__ = [
    "LOAD_SHARE",
    "MAX_WALL_SHARE",
    "AxisAllowance",
    "Device",
    "Spending",
    "share_out",
]
