"""Options of simulated Feetech servos: the keys of the bus that they need, and their own."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from tautwave_sim.feetech.tables import MODELS, SIZE
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

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Listed = Field(strict=False)
"""JSON has text for the keys of a mapping."""

MomentKind = Literal[
    "input_voltage", "encoder", "overheat", "over_current", "overload", "power_cycle",
    "unplug", "replug", "remove", "restore",
]  # fmt: skip


class EventOptions(SerialEvent):
    """One scripted fault: of a packet, or at a moment."""

    kind: PacketKind | MomentKind


class FaultOptions(SerialFaults):
    """Chances per response (`deaf`: per instruction and servo), and the script."""

    events: list[EventOptions] = Field(default=[])


class Quirks(BaseModel):
    """What is particular about one simulated servo."""

    model_config = STRICT

    registers: dict[Annotated[int, Listed], Annotated[int, Field(ge=0, le=255)]] = {}
    """Saved bytes by address, such as {7: 250} for a return delay; others follow the options."""
    stuck: list[int] = []
    """Addresses at which a write has no effect, such as 40: torque cannot be switched."""
    model: str | None = None
    """What it really is, when the bus options believe something else."""
    voltage: Positive | None = None
    """[V] Its supply; that of the options if not given."""
    supply_ohm: NotNegative = 0.0
    """[ohm] By which the supply sags with its current."""
    backlash: NotNegative = 0.0
    """[rad] Play of its gear, which its encoder sees."""
    temperature_c: float = 30.0
    heat: NotNegative = 1.0
    """Heating of its motor, as a multiple of the usual."""
    turn_around_s: NotNegative = 2e-5
    """[s] From the end of a request to its answer, beyond its return delay."""
    boot_s: NotNegative = 0.1
    """[s] Time from its supply to its first answer."""


class SimulatorOptions(BaseModel):
    """The `simulator` block: for the simulated servos only."""

    model_config = STRICT

    factory: bool = False
    """Servos as they leave the factory (return delay 500 us); else as the bus options want them."""
    echo: bool = False
    """The adapter hands the host what it sends."""
    faults: FaultOptions = FaultOptions()
    servos: dict[Annotated[int, Listed], Quirks] = {}
    """Quirks by id."""
    link: str | None = None
    """A symbolic link to the pseudo-terminal, which stays the same over unplug and replug."""


class ServoKeys(BaseModel):
    """One servo on the line, as the driver describes it too; `supply_v` comes from the bus."""

    model_config = LENIENT

    id: DeviceId
    model: str
    gear: Positive | None = None
    torque_constant: Positive | None = None
    resistance: Positive | None = None
    gear_ratio: Positive = 1.0
    direction: Literal[1, -1] = 1
    zero_counts: int = 2048
    offset: int = 0
    supply_v: Positive | None = None


class SimulatedFeetechOptions(BaseModel):
    """What the simulated servos need of a Feetech bus' options."""

    model_config = LENIENT

    port: str
    servos: Annotated[list[ServoKeys], Field(min_length=1)]
    baud: int = 1_000_000
    supply_v: Positive | None = None
    usb_latency_s: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    return_delay_s: Annotated[float, Field(ge=0.0, le=508e-6)] = 0.0
    simulator: SimulatorOptions = SimulatorOptions()

    @model_validator(mode="after")
    def _servos_exist(self) -> SimulatedFeetechOptions:
        there = {servo.id for servo in self.servos}
        for device_id, quirks in self.simulator.servos.items():
            if device_id not in there:
                raise ValueError(f"simulator.servos names servo {device_id}, which is not listed")
            for address in (*quirks.registers, *quirks.stuck):
                if not 0 <= address < SIZE:
                    raise ValueError(f"servo {device_id}: there is no register {address}")
        for event in self.simulator.faults.events:
            if event.id is not None and event.id not in there:
                raise ValueError(
                    f"simulator.faults: {event.kind} is for servo {event.id}, which is not listed"
                )
        for servo in self.servos:
            quirks = self.simulator.servos.get(servo.id, Quirks())
            for name in (servo.model, quirks.model or servo.model):
                if name not in MODELS:
                    raise ValueError(f"no model {name!r} is simulated; known: {', '.join(MODELS)}")
        return self


class FeetechBench(BaseModel):
    """Options of `tautwave sim feetech`: servos without a rig, as they leave the factory."""

    model_config = STRICT

    model: str = Field("STS3215", description=f"Model of all: {', '.join(MODELS)}.")
    ids: list[DeviceId] = Field([1], min_length=1, description="Ids, e.g. 1,2 or 1-6.")
    baud: int = Field(1_000_000, ge=9600, description="Baud rate that the servos are set to.")
    gear: float | None = Field(None, gt=0.0, description="Gear of all, e.g. 147; the model's.")
    return_delay_us: int = Field(
        500, ge=0, le=508, multiple_of=2, description="Return delay; 500 is the factory's."
    )
    usb_latency_s: float | None = Field(
        None, ge=0.0, le=0.1, description="[s] Latency of a USB adapter, e.g. 0.001."
    )
    echo: bool = Field(False, description="The adapter hands the host what it sends.")
    seed: int = Field(0, ge=0, description="Seed of the random faults.")
    faults: dict[str, Any] = Field(
        {}, description='Faults as JSON, e.g. {"lost": 0.01, "corrupted": 0.001}.'
    )
    link: str | None = Field(None, description="A symbolic link to keep pointing to the device.")


assert set(PACKET_KINDS) == set(PacketKind.__args__)  # type: ignore[attr-defined]
assert set(LINE_KINDS) < set(MomentKind.__args__)  # type: ignore[attr-defined]
