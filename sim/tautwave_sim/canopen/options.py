"""Options of simulated drives: what they need of a CANopen bus' block, and what is theirs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from tautwave_sim.wire.can_faults import CanFaults

Positive = Annotated[float, Field(gt=0.0)]
AtSeconds = Annotated[float, Field(ge=0.0)]
Listed = Field(strict=False)
"""A rig file is read as JSON: it has lists for tuples and text for the keys of a mapping."""
NodeId = Annotated[int, Field(ge=1, le=127)]


class _Keys(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class _Shared(BaseModel):
    """The driver's model of the same block is the strict one; here only what is needed is read."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class Quirks(_Keys):
    """How one drive misbehaves. Times are [s] after the drives began to move."""

    transition_ms: Annotated[int, Field(ge=0)] = 0
    """[s] Time of each change of state."""
    mode_switch_ms: Annotated[int, Field(ge=0)] = 0
    """[s] Time of a change of mode."""
    refuses_modes: Annotated[tuple[int, ...], Listed] = ()
    """Modes in 6502h that it does not go into all the same."""
    lacks_modes: Annotated[tuple[int, ...], Listed] = ()
    """Modes that are missing in 6502h."""
    fault_resets: Annotated[int, Field(ge=1)] = 1
    """Edges of fault reset that a fault needs."""
    starts_in_fault: bool = False
    torque_step_permille: Annotated[int, Field(ge=1)] = 1
    """Its torque is a multiple of that, to the nearest."""
    heartbeat_lost_at_s: AtSeconds | None = None
    """From then on it sends no heartbeat."""
    silent_at_s: AtSeconds | None = None
    """From then on it sends and hears nothing, as without supply."""
    resets_at_s: AtSeconds | None = None
    """It resets itself then."""
    voltage_off_at_s: AtSeconds | None = None
    """Its power stage loses its voltage then (STO): no torque, back to switch on disabled."""
    fault_at_s: AtSeconds | None = None
    """It has a fault then, with the code `fault_code`."""
    fault_code: Annotated[int, Field(ge=1, le=0xFFFF)] = 0x2310
    mode_lost_at_s: AtSeconds | None = None
    """It drops out of its mode then: 6061h shows 0 and no set-point is followed."""
    emergency_at_s: AtSeconds | None = None
    """It sends an EMCY then, with `fault_code`, but keeps running."""
    inputs: Annotated[tuple[Annotated[tuple[AtSeconds, int], Listed], ...], Listed] = ()
    """When its digital inputs (60FDh) change, and what they are then; 0 before."""
    rpdo_timer: Literal["yes", "no_subindex", "no_object"] = "yes"
    """Whether 1400h:05 and its like exist, as deadline timers; without them a drive responds
    06090011h, some 06020000h."""
    heartbeat_consumer: bool = True
    """Whether 1016h exists."""
    abort_option: bool = True
    """Whether 6007h exists."""
    quick_stop_option: bool = True
    """Whether 605Ah can be written."""
    interpolation_period: bool = True
    """Whether 60C2h exists."""
    least_heartbeat_ms: Annotated[int, Field(ge=0)] = 0
    """Less is refused in 1016h (06090032h)."""
    ignores_heartbeat_consumer: bool = False
    """A write to 1016h is confirmed and has no effect."""
    identity: Annotated[int, Field(ge=0, le=0xFFFFFFFF)] | None = None
    """Another product code than the rig's."""
    boot_ms: Annotated[int, Field(ge=0)] = 20
    """From a reset to its boot-up message."""


class SimulatorKeys(_Keys):
    """The `simulator` block in a CANopen bus' options."""

    faults: CanFaults = CanFaults()
    nodes: dict[Annotated[int, Listed], Quirks] = Field(default_factory=dict)
    """By node id; a drive not listed behaves."""
    free: bool = False
    """Without SYNC time runs from the first enabling on, in slots of the bus' period."""
    queue: Annotated[int, Field(ge=1)] = 10
    """Frames that the master's queue holds (txqueuelen)."""


class IdentityKeys(_Shared):
    """What 1018h holds."""

    vendor: int = 0
    product: int = 0
    revision: int | None = None
    serial: int | None = None


class SensorKeys(_Shared):
    """The object of an effort sensor, and what one count of it is."""

    index: int = 0x6401
    subindex: int = 1
    effort: float
    zero: int = 0


class NodeKeys(_Shared):
    """One drive and its motor."""

    id: NodeId
    rated_torque: Positive
    rated_torque_unit: str | None = None
    torque_constant: Positive | None = None
    counts_per_revolution: Annotated[int, Field(gt=0)]
    gear_ratio: Positive = 1.0
    feed: Positive | None = None
    direction: Literal[1, -1] = 1
    velocity_factor: Positive = 1.0
    identity: IdentityKeys | None = None
    effort_sensor: SensorKeys | None = None
    eds: str | None = None


class SimulatedCanopenOptions(_Shared):
    """Options of a CANopen bus, as far as its simulated drives need them."""

    interface: str = "socketcan"
    channel: str = "can0"
    bitrate: Annotated[int, Field(gt=0)] = 1_000_000
    data_bitrate: Annotated[int, Field(gt=0)] | None = None
    sync: bool = True
    nodes: Annotated[tuple[NodeKeys, ...], Listed]
    simulator: SimulatorKeys = SimulatorKeys()

    @model_validator(mode="after")
    def _nodes_exist(self) -> SimulatedCanopenOptions:
        unknown = sorted(set(self.simulator.nodes) - {node.id for node in self.nodes})
        if unknown:
            raise ValueError(f"simulator.nodes names node {unknown[0]}, which nodes does not list")
        return self
