"""Options of simulated servos: the bus' own, the `simulator` block in them, and the bench's."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from tautwave_sim.dynamixel.hardware import HARDWARE_KINDS
from tautwave_sim.dynamixel.models import MODELS, find_model
from tautwave_sim.wire.serial_faults import LINE_KINDS, PACKET_KINDS
from tautwave_sim.wire.serial_options import (
    STRICT,
    DeviceId,
    PacketKind,
    SerialEvent,
    SerialFaults,
)

# The driver's model of the same block is the strict one; what only it needs passes here.
LENIENT = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


MomentKind = Literal[
    "input_voltage", "overheat", "encoder", "electrical_shock", "overload",
    "unplug", "replug", "remove", "restore",
]  # fmt: skip


class EventOptions(SerialEvent):
    """One scripted fault: of a packet, or at a moment."""

    kind: PacketKind | MomentKind


class FaultOptions(SerialFaults):
    """Chances per response (`deaf`: per instruction and servo), and the script."""

    events: list[EventOptions] = Field(default=[])


class ServoQuirks(BaseModel):
    """What is particular about one simulated servo."""

    model_config = STRICT

    registers: dict[str, int] = {}
    """Values by the e-manual's names, as if written before, e.g. {Return Delay Time: 250}."""
    firmware: Annotated[int, Field(ge=1, le=255)] | None = None
    model: str | None = None
    """What it really is, when the bus options believe something else."""
    voltage: Annotated[float, Field(gt=0.0)] | None = None
    """[V] Its supply."""
    temperature_c: float | None = None
    """[degC] At the beginning; 25 around it."""
    rise_k: Annotated[float, Field(ge=0.0)] = 60.0
    """[K] How much warmer it gets at stall current."""
    heating_s: Annotated[float, Field(gt=0.0)] = 120.0
    """[s] Time constant of that."""
    overload_share: Annotated[float, Field(gt=0.0)] = 0.9
    """Share of the stall current that, standing still, is an overload after `overload_s`."""
    overload_s: Annotated[float, Field(gt=0.0)] = 1.0
    reboot_s: Annotated[float, Field(ge=0.0)] = 0.2
    """[s] Time of a reboot."""

    @field_validator("model")
    @classmethod
    def _known(cls, name: str | None) -> str | None:
        if name is not None:
            find_model(name)
        return name


class SimulatorOptions(BaseModel):
    """The `simulator` block: for the simulated servos only."""

    model_config = STRICT

    factory: bool = False
    """Servos as they leave the factory (return delay 500 us, position mode); else as the bus
    options and the axes want them."""
    faults: FaultOptions = FaultOptions()
    servos: dict[Annotated[int, Field(strict=False)], ServoQuirks] = {}  # JSON has text for keys
    """Quirks by id."""
    link: str | None = None
    """A symbolic link to the pseudo-terminal, which stays the same over unplug and replug."""


class ShadowOptions(BaseModel):
    """A second servo on the joint of another, as the driver describes it too."""

    model_config = LENIENT

    id: DeviceId
    opposite: bool = True
    homing_offset: int = 0


class ServoOptions(BaseModel):
    """One servo on the line, as the driver describes it too."""

    model_config = LENIENT

    id: DeviceId
    model: str
    torque_constant: Annotated[float, Field(gt=0.0)] | None = None
    gear_ratio: Annotated[float, Field(gt=0.0)] = 1.0
    direction: Literal[1, -1] = 1
    zero_counts: int | None = None
    current_limit: Annotated[float, Field(gt=0.0)] | None = None
    homing_offset: int = 0
    reverse_mode: bool = False
    shadow: ShadowOptions | None = None

    @field_validator("model")
    @classmethod
    def _known(cls, name: str) -> str:
        find_model(name)
        return name


class DynamixelOptions(BaseModel):
    """What the simulated servos need of a Dynamixel bus' options."""

    model_config = LENIENT

    port: str
    servos: Annotated[list[ServoOptions], Field(min_length=1)]
    baud: Annotated[int, Field(ge=9600, le=10_500_000)] = 1_000_000
    protocol: float = 2.0
    usb_latency_s: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    return_delay_s: Annotated[float, Field(ge=0.0, le=508e-6)] = 0.0
    simulator: SimulatorOptions = SimulatorOptions()

    @model_validator(mode="after")
    def _servos_and_registers_exist(self) -> DynamixelOptions:
        there = {servo.id for servo in self.servos}
        there |= {servo.shadow.id for servo in self.servos if servo.shadow is not None}
        for device_id in self.simulator.servos:
            if device_id not in there:
                raise ValueError(f"simulator.servos names servo {device_id}, which is not listed")
        for event in self.simulator.faults.events:
            if event.id is not None and event.id not in there:
                raise ValueError(
                    f"simulator.faults: {event.kind} is for servo {event.id}, which is not listed"
                )
        for servo in self.servos:
            quirks = self.simulator.servos.get(servo.id, ServoQuirks())
            model = find_model(quirks.model or servo.model)
            known = {item.name for item in model.items}
            for name in quirks.registers:
                if name not in known:
                    raise ValueError(f"servo {servo.id}: a {model.name} has no register {name!r}")
        return self


class BenchOptions(BaseModel):
    """Options of `tautwave sim dynamixel`: servos without a rig, as they leave the factory."""

    model_config = STRICT

    model: str = Field("XM430-W350", description=f"Model of all: {', '.join(MODELS)}.")
    ids: list[DeviceId] = Field([1], min_length=1, description="Ids, e.g. 1,2 or 1-6.")
    baud: int = Field(1_000_000, ge=9600, description="Baud rate that the servos are set to.")
    return_delay_us: int = Field(
        500, ge=0, le=508, multiple_of=2, description="Return Delay Time; 500 is the factory's."
    )
    usb_latency_s: float | None = Field(
        None, ge=0.0, le=0.1, description="[s] Latency timer of a USB adapter, e.g. 0.016."
    )
    seed: int = Field(0, ge=0, description="Seed of the random faults.")
    faults: dict[str, Any] = Field(
        {}, description='Faults as JSON, e.g. {"lost": 0.01, "corrupted": 0.001}.'
    )
    link: str | None = Field(None, description="A symbolic link to keep pointing to the device.")


assert set(PACKET_KINDS) | set(HARDWARE_KINDS) | set(LINE_KINDS) == {
    *PacketKind.__args__,  # type: ignore[attr-defined]
    *MomentKind.__args__,  # type: ignore[attr-defined]
}
