"""Options of a CANopen bus: the `options` block of a rig file, and what it means for each axis."""

from __future__ import annotations

from fractions import Fraction
from functools import cache
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.can.ids import unlisted, unused
from tautwave_drivers.can.keys import CanKeys
from tautwave_drivers.cia402.units import INT16, AxisScale, Transmission, axis_scale, limit_counts

Positive = Annotated[float, Field(gt=0.0)]
Byte4 = Annotated[int, Field(ge=0, le=0xFFFFFFFF)]
NodeId = Annotated[int, Field(ge=1, le=127)]

CLASSIC_RATES = (1_000_000, 800_000, 500_000, 250_000, 125_000, 50_000, 20_000, 10_000)


class Block(BaseModel):
    """Strict and frozen, like the rest of a rig file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Identity(Block):
    """Required contents of 1018h; missing keys are not compared."""

    vendor: Byte4
    """1018h:01."""
    product: Byte4
    """1018h:02."""
    revision: Byte4 | None = None
    """1018h:03."""
    serial: Byte4 | None = None
    """1018h:04."""


class Homing(Block):
    """Home the drive before it is enabled in its own mode; speeds in the drive's units."""

    method: Annotated[int, Field(ge=-128, le=127)]
    """6098h."""
    fast: Byte4 | None = None
    """6099h:01, speed towards the switch."""
    slow: Byte4 | None = None
    """6099h:02, speed towards zero."""
    acceleration: Byte4 | None = None
    """609Ah."""
    timeout_s: Positive = 8.0
    """[s] After which homing has failed."""


class Move(Block):
    """Move the axis to `position` [rad or m] at `velocity` [rad/s or m/s] before enabling it."""

    position: float
    """[rad | m] Where to."""
    velocity: Positive
    """[rad/s | m/s] How fast."""
    mode: Literal["csp", "pv"] = "csp"
    """Cyclic synchronous position, or profile velocity."""
    timeout_s: Positive = 8.0
    """[s] After which the move has failed."""


class SensorInput(Block):
    """An object of the drive with what an effort sensor shows, such as an analogue input."""

    index: Annotated[int, Field(ge=0x2000, le=0xFFFF)] = 0x6401
    """6401h (CiA 401, analogue inputs of 16 bits), or an object of the manufacturer."""
    subindex: Annotated[int, Field(ge=0, le=254)] = 1
    """1 is the first input."""
    effort: float
    """[N m | N] of one count, as the effort from outside on the axis; may be negative."""
    zero: Annotated[int, Field(ge=-32768, le=32767)] = 0
    """Counts without an effort."""


class Node(Block):
    """One drive: what cannot be read from the bus, and what has to be checked."""

    id: NodeId
    rated_torque: Positive
    """[N m] at the motor shaft (rated force of a linear motor [N]): 1000 per mille of 6071h."""
    rated_torque_unit: Literal["mN m", "uN m", "mA"] | None = None
    """Unit of 6076h; mN m without it, uN m on maxon's drives."""
    torque_constant: Positive | None = None
    """[N m/A] of the motor, where 6076h is a current."""
    counts_per_revolution: Annotated[int, Field(gt=0, le=0xFFFF_FFFF)]
    """Position counts (6064h) per motor turn, after quadrature."""
    gear_ratio: Annotated[float, Field(ge=1e-3, le=1e6)] = 1.0
    """Motor turns per turn of the output."""
    feed: Positive | None = None
    """[m] per turn of the output; required for a linear axis."""
    direction: Literal[1, -1] = 1
    velocity_factor: Positive = 1.0
    """Counts per second that one unit of 606Ch and 60FFh stands for."""
    home_offset: Annotated[int, Field(ge=-0x8000_0000, le=0x7FFF_FFFF)] = 0
    """[counts] 607Ch, which shifts positions; compared."""
    identity: Identity | None = None
    eds: str | None = None
    """EDS or DCF file; parameter values of a DCF are written first."""
    dcf_include: Annotated[
        tuple[Annotated[str, Field(pattern="^[0-9A-Fa-f]{4}(:[0-9A-Fa-f]{2})?$")], ...],
        Field(strict=False),
    ] = ()
    """Objects of the DCF that are written although they are left out, such as `2003:01`."""
    mapping: Literal["lean", "full"] = "full"
    mode_display: Literal["always", "when_enabled"] = "always"
    """When 6061h shows the mode: with `when_enabled` it is compared once the drive is enabled,
    which has no torque before."""
    enable_input: Annotated[int, Field(ge=0, le=31)] | None = None
    """Bit of the digital inputs (60FDh) that a dead-man switch sets: an operated rig engages only
    while it is on."""
    effort_sensor: SensorInput | None = None
    """Of an axis with `effort_sensor`; in the TPDO, which needs `mapping: lean`."""
    report_torque: bool = False
    """6077h of an axis that takes effort, recorded as `motor_effort`; needs `mapping: lean`."""
    homing: Homing | None = None
    move: Move | None = None


class CanopenOptions(CanKeys):
    """Options of a CANopen bus."""

    data_bitrate: Annotated[int, Field(ge=10_000, le=8_000_000)] | None = None
    """For the budget only: what CAN FD would allow; the driver uses classic CAN."""
    sync: bool = True
    """This master sends SYNC; false: TPDOs by the drive's event timer, RPDOs act on receipt."""
    rpdo: Literal["sync", "event"] = "sync"
    """When a command acts: at the next SYNC (one period), or on receipt (less than one)."""
    master_id: NodeId = 127
    heartbeat_ms: Annotated[int, Field(ge=1, le=10_000)] = 20
    heartbeat_timeout_ms: Annotated[int, Field(ge=2, le=60_000)] = 60
    abort_connection_option: Literal[1, 2, 3] = 2
    """6007h: 1 fault reaction, 2 disable voltage, 3 quick stop."""
    quick_stop_option: Annotated[int, Field(ge=-32768, le=32767)] = 2
    stop: Literal["disable_voltage", "quick_stop"] = "disable_voltage"
    fault_resets: Annotated[int, Field(ge=0, le=10)] = 3
    # A tuple, so that options are hashable and immutable; a rig file has lists.
    tolerated_emergencies: Annotated[
        tuple[Annotated[int, Field(ge=1, le=0xFFFF)], ...], Field(strict=False)
    ] = ()
    """EMCY codes that are reported but do not stop the run (a manufacturer's warnings)."""
    answer_share: Annotated[float, Field(gt=0.0, le=0.7)] = 0.6
    """Share of a period after SYNC in which TPDOs are waited for."""
    sdo_timeout_s: Positive = 0.3
    reserve: Annotated[float, Field(ge=0.0, le=0.5)] = 0.05
    """Share of the bus kept for EMCY and SDO in the budget."""
    nodes: Annotated[tuple[Node, ...], Field(min_length=1, strict=False)]
    simulator: dict[str, Any] = Field(default_factory=dict)
    """The simulator's own keys; a driver of hardware ignores them."""


def transmission(node: Node, kind: str) -> Transmission:
    """Return gear and feed as the factor group has them."""
    ratio = Fraction(node.gear_ratio).limit_denominator(1_000_000)
    feed = 0.0 if kind == "rotary" or node.feed is None else node.feed
    return Transmission(ratio.numerator, ratio.denominator, feed)


@cache
def _scale(node: Node, kind: str) -> AxisScale:
    gear = transmission(node, kind)
    quantum = gear.travel / node.counts_per_revolution
    return axis_scale(
        gear,
        node.counts_per_revolution,
        node.rated_torque,
        velocity_quantum=quantum * node.velocity_factor,
    )


def scale(node: Node, axis: AxisSpec) -> AxisScale:
    """Return the value of one count of this node at the axis."""
    return _scale(node, axis.kind)


def nodes_of(options: CanopenOptions, bus: BusSpec) -> list[Node]:
    """Return the node of each axis, in the order of the axes.

    Raises
    ------
    ConfigError
        The block and the rig's axes do not match.
    """
    known: dict[int, Node] = {}
    problems = []
    for node in options.nodes:
        if node.id in known:
            problems.append(f"bus {bus.name}: node {node.id} is listed twice in options.nodes")
        if node.id == options.master_id:
            problems.append(
                f"bus {bus.name}: node {node.id} has the same id as this master; choose another "
                "master_id"
            )
        known[node.id] = node
    if options.data_bitrate is None and options.bitrate not in CLASSIC_RATES:
        rates = ", ".join(str(rate) for rate in CLASSIC_RATES)
        problems.append(
            f"bus {bus.name}: bitrate {options.bitrate} is not one of CANopen's: {rates}"
        )
    if options.heartbeat_timeout_ms < 2 * options.heartbeat_ms:
        problems.append(
            f"bus {bus.name}: heartbeat_timeout_ms {options.heartbeat_timeout_ms} must be at "
            f"least twice heartbeat_ms {options.heartbeat_ms}, or one late frame stops the rig"
        )
    if not options.sync:
        if options.rpdo == "sync":
            problems.append(f"bus {bus.name}: without SYNC (sync: false) rpdo must be event")
        if bus.period_ns % 1_000_000:
            problems.append(
                f"bus {bus.name}: without SYNC drives send by an event timer in whole ms; "
                f"{bus.rate_hz:g} Hz is not possible: use sync: true or another rate"
            )
    for axis in bus.axes:
        keys = known.get(axis.device_id)
        if keys is None:
            needed = "its rated_torque and counts_per_revolution"
            problems.append(unlisted(bus, axis, "node", known, needed))
        elif axis.kind == "linear" and keys.feed is None:
            problems.append(
                f"bus {bus.name}: {axis.name} is linear, but node {keys.id} has no feed; "
                "set it to the travel per turn of its output [m]"
            )
        elif axis.kind == "rotary" and keys.feed is not None:
            problems.append(
                f"bus {bus.name}: {axis.name} is rotary, but node {keys.id} has a feed; "
                "remove it, or make the axis linear"
            )
        elif (keys.rated_torque_unit == "mA") != (keys.torque_constant is not None):
            problems.append(
                f"bus {bus.name}: node {keys.id}: rated_torque_unit: mA and torque_constant "
                "[N m/A] go together: 6076h is then a current, compared times that constant; state "
                "both or none"
            )
        elif keys.dcf_include and keys.eds is None:
            problems.append(
                f"bus {bus.name}: node {keys.id} has dcf_include, but no DCF; state it in eds"
            )
        elif keys.mapping == "lean" and (keys.homing or keys.move):
            problems.append(
                f"bus {bus.name}: node {keys.id}: homing and move change the mode, "
                "which needs mapping: full"
            )
        elif problem := _misread(axis, keys):
            problems.append(f"bus {bus.name}: {problem}")
        elif axis.causality == "impedance" and not 1 <= limit_permille(keys, axis) < INT16:
            problems.append(
                f"bus {bus.name}: {axis.name}: effort_limit {axis.effort_limit:g} is "
                f"{axis.effort_limit / scale(keys, axis).effort_quantum:.3g} per mille of rated; "
                "6071h holds 1 to 32766: correct rated_torque, gear_ratio or effort_limit"
            )
    problems += unused(bus, "node", known)
    if problems:
        raise ConfigError(problems)
    return [known[axis.device_id] for axis in bus.axes]


def _misread(axis: AxisSpec, node: Node) -> str:
    """Return what is wrong with what a node is to report of efforts; nothing if all is well."""
    keys = [key for key in ("effort_sensor", "report_torque") if getattr(node, key)]
    if axis.effort_sensor and node.effort_sensor is None:
        return (
            f"{axis.name} has an effort_sensor, but node {node.id} does not define it; add "
            f"effort_sensor: {{index: 0x6401, subindex: 1, effort: N m of one count}} to it"
        )
    if node.effort_sensor is not None and not axis.effort_sensor:
        return (
            f"node {node.id} reads an effort_sensor, but {axis.name} has none; add effort_sensor: "
            f"{{}} to the axis"
        )
    if node.effort_sensor is not None and node.effort_sensor.effort == 0.0:
        return f"node {node.id}: effort_sensor.effort (per count) must not be 0"
    if keys and axis.causality == "admittance":
        return (
            f"node {node.id}: {axis.name} is velocity-controlled and already "
            f"reports 6077h; remove {keys[0]}"
        )
    if keys and (node.mapping == "full" or len(keys) == 2):
        room = "one of both" if node.mapping == "lean" else "it only with mapping: lean"
        return f"node {node.id}: a TPDO has 8 bytes, room for {room} ({', '.join(keys)})"
    return ""


def limit_permille(node: Node, axis: AxisSpec) -> int:
    """Return the rig's effort_limit as the greatest per mille that does not exceed it."""
    return limit_counts(axis.effort_limit, scale(node, axis).effort_quantum)
