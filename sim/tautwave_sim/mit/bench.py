"""Simulated MIT motors without a rig: free axes with inertia and damping, for any client."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import AxisSpec, Bench, BusSpec
from tautwave.errors import ConfigError
from tautwave_sim.bench import free_axis, require_distinct
from tautwave_sim.mit.options import MotorKeys, Positive, SimulatedMitOptions, SimulatorKeys

SLOT_HZ = 4000.0
LAST_ROBSTRIDE, ROBSTRIDE_HOST = 127, 0xFD


class MitBench(BaseModel):
    """Options of `tautwave sim mit`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    ids: tuple[Annotated[int, Field(ge=1, le=0x7FF)], ...] = Field(
        (1, 2), min_length=1, description="ids of the motors (ESC_ID), as in 1,2; each answers "
        "with its id + 16 (MST_ID), RobStride's to who asks",
    )  # fmt: skip
    family: Literal["damiao", "robstride"] = Field(
        "damiao", description="whose frames they speak: damiao or robstride"
    )
    interface: str = Field(
        "socketcan",
        description="of python-can; udp_multicast needs no CAN in the kernel, and virtual reaches "
        "this process only",
    )
    channel: str = Field("vcan0", description="its channel; 239.74.163.2 for udp_multicast")
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = Field(
        1_000_000, description="[bit/s] that the wire's time is computed from"
    )
    data_bitrate: Annotated[int, Field(ge=0, le=8_000_000)] = Field(
        0, description="[bit/s] of the data phase of CAN FD; 0: classic CAN"
    )
    p_max: Positive = Field(12.5, description="[rad] PMAX, register 21")
    v_max: Positive = Field(30.0, description="[rad/s] VMAX, register 22")
    t_max: Positive = Field(10.0, description="[N m] TMAX, register 23")
    inertia: Positive = Field(1.8e-3, description="[kg m^2] at the output")
    damping: Annotated[float, Field(ge=0.0)] = Field(0.02, description="[N m s/rad]")


def bench(options: MitBench) -> Bench:
    """Return what `tautwave sim mit` serves: one free axis per motor.

    Raises
    ------
    ConfigError
        A motor is listed twice, or is none of its family.
    """
    require_distinct("--ids", options.ids, "motors")
    other = options.family == "robstride"
    if other and (options.data_bitrate or max(options.ids) > LAST_ROBSTRIDE):
        raise ConfigError(
            f"RobStride's motors have ids up to {LAST_ROBSTRIDE} on classic CAN; give --ids such "
            "as 1,2, and no --data-bitrate"
        )
    motors = tuple(
        MotorKeys(
            id=number,
            feedback_id=ROBSTRIDE_HOST if other else number + 16,
            p_max=options.p_max,
            v_max=options.v_max,
            t_max=options.t_max,
        )
        for number in options.ids
    )
    keys = SimulatedMitOptions(
        interface=options.interface,
        channel=options.channel,
        bitrate=options.bitrate,
        data_bitrate=options.data_bitrate or None,
        family=options.family,
        motors=motors,
        simulator=SimulatorKeys(free=True),
    )
    axes = tuple(
        AxisSpec(f"motor.{number}", number, "rotary", "impedance", math.inf)
        for number in options.ids
    )
    physics = [
        free_axis(1.0 / SLOT_HZ, options.inertia, options.damping, seed=(0, number))
        for number in options.ids
    ]
    return Bench(keys, BusSpec("sim", axes, SLOT_HZ), physics)
