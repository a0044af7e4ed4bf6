"""The `options` block of a bus of moteus controllers, and what it means."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.plugin import Budget, BusSpec, ConfigError
from tautwave_drivers.can.ids import unlisted, unused
from tautwave_drivers.can.keys import CanKeys
from tautwave_drivers.can.lengths import frame_s
from tautwave_example_moteus.frames import ANSWER_SIZE, REQUEST_SIZE

MIN_PERIODS = 3
"""That a watchdog has to wait."""


class Device(BaseModel):
    """One controller."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    id: Annotated[int, Field(ge=1, le=126)]
    direction: Literal[1, -1] = 1
    """-1 where the output turns against the axis."""
    zero: float = 0.0
    """[rad] Position of the output where the axis is at 0."""


class Options(CanKeys):
    """Options of the bus; always CAN FD."""

    data_bitrate: Annotated[int, Field(ge=1_000_000, le=8_000_000)] = 5_000_000
    watchdog_s: Annotated[float, Field(ge=0.001, le=1.0)] = 0.05
    """[s] Sent with every command, and read back: without one a controller stops after it."""
    devices: Annotated[tuple[Device, ...], Field(min_length=1, strict=False)]


def devices_of(options: Options, bus: BusSpec) -> list[Device]:
    """Return the controller of each axis.

    Raises
    ------
    ConfigError
        The block and the rig's axes do not match.
    """
    known = {one.id: one for one in options.devices}
    problems = []
    if len(known) < len(options.devices):
        problems.append(f"bus {bus.name}: a device is listed twice in options.devices")
    if options.watchdog_s < MIN_PERIODS / bus.rate_hz:
        least = MIN_PERIODS / bus.rate_hz
        problems.append(f"bus {bus.name}: watchdog_s is below {MIN_PERIODS} periods; use {least:g}")
    for axis in bus.axes:
        if axis.device_id not in known:
            problems.append(unlisted(bus, axis, "device", known, "its id"))
        elif axis.kind != "rotary" or axis.causality != "impedance" or axis.effort_sensor:
            problems.append(f"bus {bus.name}: {axis.name}: use kind: rotary, causality: impedance")
        elif not math.isfinite(axis.effort_limit):
            problems.append(f"bus {bus.name}: {axis.name}: give effort_limit")
    problems += unused(bus, "device", known)
    if problems:
        raise ConfigError(problems)
    return [known[axis.device_id] for axis in bus.axes]


def budget(options: Options, bus: BusSpec) -> Budget:
    """Return the bus time of one cycle, all frames as long as the wire can make them."""
    devices: Sequence[Device] = devices_of(options, bus)
    rates = options.bitrate, options.data_bitrate
    each = frame_s(REQUEST_SIZE, *rates, extended=True) + frame_s(
        ANSWER_SIZE, *rates, extended=True
    )
    whole = each * len(devices)
    sizes = f"{REQUEST_SIZE} and {ANSWER_SIZE} bytes, {each * 1e6:.4g} us"
    return Budget(whole, 0.8 / whole, f"{len(devices)} controllers x {sizes}")
