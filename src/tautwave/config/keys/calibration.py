"""`calibration`: what was found on the devices of a rig, in a file beside it or in the rig."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from tautwave.config.keys.common import Block


class AxisCalibration(Block):
    """What `tautwave calibrate` found on one device: where its zero is, which way is positive."""

    device: dict[str, str] = Field(
        default_factory=dict,
        description="Identity reported by the device; a device with a "
        "different identity is rejected.",
    )
    zero: float = Field(
        default=0.0, description="[rad | m] The device's own position where the axis is at 0."
    )
    direction: Literal[1, -1] = Field(
        default=1, description="-1: the device counts in the opposite direction."
    )


class Calibration(Block):
    """The calibration that a rig was given by `tautwave calibrate`."""

    file: Annotated[str, Field(min_length=1)] | None = Field(
        default=None,
        description="Calibration file; a relative path starts at the rig file's directory.",
    )
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")] | None = Field(
        default=None, description="SHA-256 of that file; any other file is rejected."
    )
    axes: dict[str, AxisCalibration] = Field(
        default_factory=dict,
        description="Contents of that file by full axis name, as resolved "
        "in the rig.yaml of a run.",
    )
