"""The keys of a CAN interface in the options of a bus."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field


class CanKeys(BaseModel):
    """Where a bus is, and how fast; strict and frozen, like the rest of a rig file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    interface: Annotated[str, Field(min_length=1)] = "socketcan"
    """`virtual`, `socketcan`, `udp_multicast`, or any interface that python-can has."""
    channel: str = "can0"
    """Its name, such as `can0`; a multicast address for `udp_multicast`."""
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)] = 1_000_000
    """[bit/s] of the bus, that of arbitration with CAN FD."""
    data_bitrate: Annotated[int, Field(ge=10_000, le=8_000_000)] | None = None
    """[bit/s] of the data phase: all frames are CAN FD with rate switch; without it, classic."""
    usb_latency_s: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    """[s] How long a USB adapter keeps an answer; by `interface` and `channel` without it."""
    backend: Literal["auto", "python-can", "raw"] = "auto"
    """`raw` reads SocketCAN without python-can, which `auto` does where it can."""
