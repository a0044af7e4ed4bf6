"""Options of a Feetech bus, and what they mean for each axis of the rig."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import AxisFacts, AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.adapter import adapter_of
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.models import MODELS, Model
from tautwave_drivers.feetech.tables import COUNTS_PER_TURN, CURRENT_UNIT, HLS, STS, Table

STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

Positive = Annotated[float, Field(gt=0.0)]
ServoId = Annotated[int, Field(ge=0, le=253)]

STEADY_A = 3.0
"""[A] Of an HLS servo: what its users took for safe."""
LEAST_PERIODS = 3
"""Of the bus, that the process beside the run has to wait: one late cycle is no fault."""
LOW_SUPPLY = 0.8
"""Share of the stated supply down to which a servo has to reach its effort_limit."""


class ServoOptions(BaseModel):
    """One servo on the line."""

    model_config = STRICT

    id: ServoId
    model: str
    """Name of the model, such as STS3215; checked against the servo."""
    series: Literal["STS", "HLS"] | None = None
    """Whose table its firmware has; the model says it where only one has it."""
    gear: Positive | None = None
    """Its own gear, such as 147 of an SO-101's leader; 345 for an STS3215 if not given."""
    torque_constant: Positive | None = None
    """[N m/A] At its horn, with that gear; the model's if not given."""
    resistance: Positive | None = None
    """[ohm] Of its winding, where it is driven by a voltage; the model's if not given."""
    gear_ratio: Positive = 1.0
    """Of what is mounted on the horn: turns of the horn per turn of the axis."""
    direction: Literal[1, -1] = 1
    """-1: the axis counts against the servo."""
    zero_counts: Annotated[int, Field(ge=0, le=4095)] = 2048
    """Position of the servo at the axis' zero."""
    offset: Annotated[int, Field(ge=-2047, le=2047)] = 0
    """Required value of offset(31): its positions, and `zero_counts`, include it."""


class FeetechOptions(BaseModel):
    """Options of a Feetech bus."""

    model_config = STRICT

    port: str
    """A serial device, or `sim`: simulated servos, served by the run."""
    servos: Annotated[list[ServoOptions], Field(min_length=1)]
    """Everything that is on the line and used."""
    power_cut: str = ""
    """How the servos' power is cut by hand, within reach, such as `switch on the supply, left
    hand`. Required: no servo of this kind notices that the host has stopped."""
    baud: Literal[1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400] = 1_000_000
    supply_v: Positive | None = None
    """[V] The supply; compared with what the servos measure. The model's if not given."""
    usb_latency_s: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    """[s] Latency of the USB adapter; 0: a real UART. Not given: of the device that `port` leads
    to, 0.001 on USB."""
    return_delay_s: Annotated[float, Field(ge=0.0, le=508e-6)] = 0.0
    """[s] Return delay(7), as `tautwave scan feetech` reads it, in steps of 2 us; set until power
    is off where it differs. HLS has none."""
    turn_around_s: Annotated[float, Field(ge=0.0, le=0.01)] = 5e-5
    """[s] From the end of a request to a servo's answer, beyond the return delay. Assumed: nobody
    has published it."""
    protection_s: Annotated[float, Field(ge=0.01, le=2.54)] = 0.5
    """[s] How long a current beyond that of `effort_limit` may flow before a servo itself cuts
    it (38)."""
    host_watchdog_s: Annotated[float, Field(ge=0.05, le=5.0)] = 0.5
    """[s] Silence of the run after which a process beside it sends torque off to all servos of the
    line; at once where the run is killed. Not where the machine stops or the cable is pulled."""
    stop: Literal["off", "damped"] = "off"
    """What servos are left in: without torque, or (HLS) damped."""
    simulator: dict[str, Any] = {}
    """For the simulated servos only."""

    @property
    def latency_s(self) -> float:
        """[s] Latency of the adapter."""
        if self.usb_latency_s is not None:
            return self.usb_latency_s
        return adapter_of(self.port).latency_s


class Scale(NamedTuple):
    """One count of a servo at its axis: position [rad], goal of effort [N m], current [N m]."""

    position: float
    effort: float
    current: float
    direction: int
    zero: int

    def position_of(self, counts: int) -> float:
        """Return the axis' position [rad]."""
        return self.direction * (counts - self.zero) * self.position

    def counts_of(self, position: float) -> int:
        """Return the counts nearest to a finite position [rad]."""
        return self.zero + self.direction * math.floor(position / self.position + 0.5)

    def goal_of(self, effort: float, limit: int) -> int:
        """Return the goal nearest to an effort [N m], at most `limit`; 0 where it is NaN."""
        goal = effort / self.effort
        if not -limit <= goal <= limit:
            goal = limit if goal > limit else -limit if goal < -limit else 0.0
        return self.direction * math.floor(goal + 0.5)


class Servo(NamedTuple):
    """One axis of the rig with the servo that moves it."""

    axis: AxisSpec
    options: ServoOptions
    model: Model
    table: Table
    supply_v: float

    @property
    def impedance(self) -> bool:
        """Whether it takes effort."""
        return self.axis.causality == "impedance"

    @property
    def by_voltage(self) -> bool:
        """Whether its effort is the voltage of its motor, not a current."""
        return self.impedance and self.table is not HLS

    @property
    def mode(self) -> int:
        """Mode(33) that its commands need."""
        return tables.EFFORT_MODE if self.impedance else tables.POSITION_MODE

    @property
    def torque_constant(self) -> float:
        """[N m/A] At the horn."""
        given = self.options.torque_constant
        if given is not None:
            return given
        gear = self.options.gear or self.model.gear
        return self.model.torque_constant * (gear / self.model.gear if self.model.gear else 1.0)

    @property
    def resistance(self) -> float:
        """[ohm] Of its winding."""
        return self.options.resistance or self.model.resistance

    @property
    def back_emf(self) -> float:
        """[N m s/rad] Damping of the axis by the motor as a generator, driven by a voltage."""
        if not self.by_voltage or not self.resistance:
            return 0.0
        return (self.torque_constant * self.options.gear_ratio) ** 2 / self.resistance

    def scale(self, supply_v: float) -> Scale:
        """Return its counts at the axis with a supply of so many volts."""
        ratio = self.options.gear_ratio
        constant = self.torque_constant * ratio
        current = CURRENT_UNIT * constant
        effort = current
        if self.by_voltage:
            effort = constant * supply_v / self.resistance / tables.FULL_TORQUE
        return Scale(
            math.tau / COUNTS_PER_TURN / ratio,
            effort,
            current,
            self.options.direction,
            self.options.zero_counts,
        )


def match_servos(options: FeetechOptions, bus: BusSpec) -> list[Servo]:
    """Return the servo of each axis, in the bus' order.

    Raises
    ------
    ConfigError
        An axis has no servo, a model is unknown or cannot do what the axis needs; all at once.
    """
    by_id: dict[int, ServoOptions] = {}
    problems = []
    if not options.power_cut.strip():
        problems.append(
            f"bus {bus.name}: Feetech servos have no watchdog: if the host stops they go on with "
            "their last goal; write how a person cuts their power, such as power_cut: switch on "
            "the supply, within reach"
        )
    least_s = LEAST_PERIODS / bus.rate_hz
    if options.host_watchdog_s < least_s * (1.0 - 1e-9):
        problems.append(
            f"bus {bus.name}: host_watchdog_s {options.host_watchdog_s:g} is less than "
            f"{LEAST_PERIODS} periods at {bus.rate_hz:g} Hz; use {least_s:.3g} or more"
        )
    for servo in options.servos:
        if servo.id in by_id:
            problems.append(f"bus {bus.name}: servo id {servo.id} is listed twice")
        by_id[servo.id] = servo
    servos = []
    for axis in bus.axes:
        one = by_id.get(axis.device_id)
        if one is None:
            listed = ", ".join(map(str, sorted(by_id)))
            problems.append(
                f"bus {bus.name}: {axis.name} has id {axis.device_id}, but options.servos lists "
                f"{listed}; add the servo or correct the id"
            )
            continue
        model = MODELS.get(one.model)
        if model is None:
            problems.append(_unknown(bus, one))
            continue
        table = HLS if (one.series or model.name[:3]) == "HLS" else STS
        driven = Servo(axis, one, model, table, options.supply_v or model.voltage)
        refusal = _refusal(options, driven)
        if refusal:
            problems.append(f"bus {bus.name}: {axis.name}: {refusal}")
        servos.append(driven)
    if problems:
        raise ConfigError(problems)
    return servos


def _unknown(bus: BusSpec, servo: ServoOptions) -> str:
    from difflib import get_close_matches

    close = get_close_matches(servo.model.upper(), MODELS, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(MODELS)}"
    return f"bus {bus.name}: servo {servo.id}: unknown model {servo.model!r}; {hint}"


def _refusal(options: FeetechOptions, servo: Servo) -> str:
    """Return what of an axis does not go with its servo, '' if all does."""
    axis, one = servo.axis, servo.options
    if axis.kind != "rotary":
        return f"is {axis.kind}, but a servo turns; use kind: rotary"
    if axis.effort_sensor:
        return "a servo measures no effort from outside; remove effort_sensor"
    if not servo.impedance and not axis.takes_position:
        return (
            "a servo in speed mode measures no effort; make the axis causality: impedance, or give "
            "it a follower, so that it takes positions"
        )
    if one.gear is not None and not servo.model.gear and one.torque_constant is None:
        return f"gear {one.gear:g} of a {one.model}: give torque_constant with that gear instead"
    if options.stop == "damped" and servo.table is not HLS:
        return f"stop: damped is of HLS servos, and this is a {one.model}; use stop: off"
    if servo.impedance and servo.torque_constant == 0.0:
        return (
            f"the torque constant of a {one.model} is not known; give torque_constant, at its horn"
        )
    if servo.by_voltage and not servo.resistance:
        return f"the resistance of a {one.model} is not known; give resistance, of its winding"
    if servo.by_voltage and not servo.supply_v:
        return f"the supply of a {one.model} is not known; give supply_v"
    return _beyond(servo)


def _beyond(servo: Servo) -> str:
    """Return which limit of an axis its servo does not reach, '' if it reaches all."""
    axis = servo.axis
    if servo.impedance:
        unit = servo.scale(servo.supply_v).effort
        most = servo.table.most * unit * (LOW_SUPPLY if servo.by_voltage else 1.0)
        if axis.effort_limit > most * (1.0 + 1e-9):
            why = (
                f"gives {most:.3g} N m at {LOW_SUPPLY:.0%} of {servo.supply_v:g} V"
                if servo.by_voltage
                else f"takes at most {most:.3g} N m as a goal"
            )
            return (
                f"effort_limit {axis.effort_limit:g} exceeds a {servo.options.model}, which {why}; "
                "lower effort_limit"
            )
        if axis.effort_limit < unit:
            return (
                f"effort_limit {axis.effort_limit:g} is less than one count of its goal "
                f"({unit:.3g}); raise it, or correct torque_constant and gear_ratio"
            )
    scale = servo.scale(servo.supply_v or 1.0)
    ends = sorted((scale.counts_of(end), end) for end in axis.position_range if math.isfinite(end))
    if ends and (ends[0][0] < 0 or ends[-1][0] >= COUNTS_PER_TURN):
        return (
            f"position_range goes over the seam of its encoder (counts {ends[0][0]} to "
            f"{ends[-1][0]}, it has 0 to 4095); narrow position_range, or shift the servo's zero "
            "with offset and zero_counts"
        )
    return ""


def facts(options: FeetechOptions, bus: BusSpec) -> Sequence[AxisFacts]:
    """Return the steps of each axis' position and effort [rad], [N m]."""
    by_axis = []
    for servo in match_servos(options, bus):
        scale = servo.scale(servo.supply_v or 1.0)
        by_axis.append(AxisFacts(scale.position, scale.effort if servo.impedance else 0.0))
    return by_axis


def foreseen(options: FeetechOptions, bus: BusSpec) -> Sequence[str]:
    """Return what is to be known of the servos before a run: no watchdog, back-EMF, current."""
    servos = match_servos(options, bus)
    sentences = [
        "the servos have no watchdog: a run needs --allow-unwatched; their power is cut by hand: "
        + options.power_cut.strip()
    ]
    for servo in servos:
        where = f"{servo.axis.name} (servo {servo.options.id})"
        if servo.by_voltage:
            sentences.append(
                f"{where}: driven by a voltage: its motor brakes with {servo.back_emf:.3g} N m "
                "s/rad of back-EMF as long as torque is on; `damping` of the axis has to include it"
            )
        current = servo.axis.effort_limit / servo.scale(1.0).current * CURRENT_UNIT
        if servo.impedance and not servo.by_voltage and STEADY_A < current < math.inf:
            sentences.append(
                f"{where}: effort_limit {servo.axis.effort_limit:g} is {current:.2g} A; users of "
                f"these servos took {STEADY_A:g} A for safe"
            )
    return sentences
