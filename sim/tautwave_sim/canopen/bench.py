"""Simulated drives without a rig: free axes with inertia and damping, for any other software."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import AxisSpec, Bench, BusSpec
from tautwave_sim.bench import free_axis, require_distinct
from tautwave_sim.canopen.options import (
    NodeId,
    NodeKeys,
    Positive,
    SimulatedCanopenOptions,
    SimulatorKeys,
)

SLOT_HZ = 1000.0


class CanopenBench(BaseModel):
    """Options of `tautwave sim canopen`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    nodes: tuple[NodeId, ...] = Field((1, 2), min_length=1, description="node ids, as in 1,2")
    interface: str = Field(
        "socketcan",
        description="of python-can; udp_multicast needs no CAN in the kernel, and virtual reaches "
        "this process only",
    )
    channel: str = Field("vcan0", description="its channel; 239.74.163.2 for udp_multicast")
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = Field(
        1_000_000, description="[bit/s] that the wire's time is computed from"
    )
    kind: Literal["rotary", "linear"] = Field("rotary", description="of the axes")
    rated_torque: Annotated[float, Field(ge=1e-6, le=1e6)] = Field(
        0.1, description="[N m] of the motor, 1000 per mille"
    )
    counts_per_revolution: Annotated[int, Field(gt=0, le=0xFFFF_FFFF)] = Field(
        4096, description="per motor turn"
    )
    inertia: Positive = Field(1e-4, description="[kg m^2 or kg] of the axis")
    damping: Annotated[float, Field(ge=0.0)] = Field(1e-3, description="[N m s/rad or N s/m]")
    feed: Positive = Field(0.01, description="[m] per turn, of linear axes")


def bench(options: CanopenBench) -> Bench:
    """Return what `tautwave sim canopen` serves: one free axis per node.

    Raises
    ------
    ConfigError
        A node is listed twice.
    """
    require_distinct("--nodes", options.nodes, "nodes")
    linear = options.kind == "linear"
    nodes = tuple(
        NodeKeys(
            id=node,
            rated_torque=options.rated_torque,
            counts_per_revolution=options.counts_per_revolution,
            feed=options.feed if linear else None,
        )
        for node in options.nodes
    )
    keys = SimulatedCanopenOptions(
        interface=options.interface,
        channel=options.channel,
        bitrate=options.bitrate,
        nodes=nodes,
        simulator=SimulatorKeys(free=True),
    )
    axes = tuple(
        AxisSpec(f"node.{node}", node, options.kind, "impedance", math.inf)
        for node in options.nodes
    )
    travel = options.feed if linear else math.tau
    physics = [
        free_axis(
            1.0 / SLOT_HZ,
            options.inertia,
            options.damping,
            encoder_quantum=travel / options.counts_per_revolution,
            effort_quantum=options.rated_torque / 1000.0 * (math.tau / travel),
            seed=(0, node),
        )
        for node in options.nodes
    ]
    return Bench(keys, BusSpec("sim", axes, SLOT_HZ), physics)
