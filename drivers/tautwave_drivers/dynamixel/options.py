"""Options of a Dynamixel bus, and what they mean for each axis of the rig."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, BaseModel, ConfigDict, Field
from pydantic_core import PydanticCustomError

from tautwave.contracts import AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.adapter import adapter_of
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.models import MODELS, Model

STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

Positive = Annotated[float, Field(gt=0.0)]


def _known(version: float) -> float:
    if version not in (1.0, 2.0):
        raise PydanticCustomError("protocol", "should be 2.0 or 1.0")
    return version


Protocol = Annotated[float, AfterValidator(_known)]

ErrorName = Literal["input_voltage", "overheat", "encoder", "electrical_shock", "overload"]

ERROR_BITS: dict[str, int] = {
    "input_voltage": 0, "overheat": 2, "encoder": 3, "electrical_shock": 4, "overload": 5
}  # fmt: skip
"""Bits of Hardware Error Status(70), as `Shutdown(63)` of the e-manual has them."""

WATCHED_PERIODS = 3
"""Shortest watchdog, in periods of the bus."""

LAST_ID = 252
"""Greatest id of a servo."""


class ShadowOptions(BaseModel):
    """The second servo of a joint that two move: it obeys the goals of the first."""

    model_config = STRICT

    id: Annotated[int, Field(ge=0, le=LAST_ID)]
    opposite: bool = True
    """Whether it is mounted the other way round, so that Drive Mode(10) has to turn it."""
    homing_offset: int = 0
    """Homing Offset(20) that it is to have [pulse]."""


class ServoOptions(BaseModel):
    """One servo on the line."""

    model_config = STRICT

    id: Annotated[int, Field(ge=0, le=LAST_ID)]
    model: str
    """Name of the model, e.g. XM430-W350; checked against the servo."""
    torque_constant: Positive | None = None
    """[N m/A] At the horn; the stall slope of the model (+-20 %) if not given."""
    gear_ratio: Positive = 1.0
    """Of what is mounted on the horn: turns of the horn per turn of the axis; for a linear axis
    [rad/m]."""
    direction: Literal[1, -1] = 1
    """-1: the axis counts against the servo."""
    zero_counts: int = 2048
    """Position of the servo at the axis' zero [pulse]."""
    current_limit: Positive | None = None
    """[A] Current Limit(38) to set in the servo; if not given, the servo's own is only checked."""
    homing_offset: int = 0
    """Required value of Homing Offset(20) [pulse]: its positions, and `zero_counts`, include it."""
    reverse_mode: bool = False
    """Whether Drive Mode(10) reverses the servo's own counts and goals; `direction` applies on
    top of it."""
    shadow: ShadowOptions | None = None
    """A second servo on the same joint, with Secondary ID(12) of this one: both get the same goals
    and share the effort of the axis."""


class DynamixelOptions(BaseModel):
    """Options of a Dynamixel bus."""

    model_config = STRICT

    port: str
    """A serial device, or `sim`: simulated servos, served by the run."""
    servos: Annotated[list[ServoOptions], Field(min_length=1)]
    """Everything that is on the line and used."""
    baud: Annotated[int, Field(ge=9600, le=10_500_000)] = 1_000_000
    protocol: Protocol = 2.0
    read: Literal["sync", "fast_sync"] = "sync"
    """How the servos are read: one packet each, or one for all (newer firmware)."""
    status_block: bool = False
    """Read torque enable, hardware error and watchdog of every servo in every cycle too, through
    the indirect addresses; without it they are read when a servo raises its alert bit or nothing
    was heard of it for 20 ms."""
    usb_latency_s: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    """[s] Latency timer of the USB adapter; 0: a real UART. Not given: of the device that `port`
    leads to, 0.001 on USB, more where an FTDI timer may not be set, 0 on a UART or pty."""
    return_delay_s: Annotated[float, Field(ge=0.0, le=508e-6)] = 0.0
    """[s] Return Delay Time(9) to set in the servos, in steps of 2 us."""
    watchdog_s: Annotated[float, Field(ge=0.02, le=2.54)] = 0.1
    """[s] Bus Watchdog(98): a servo that gets no packet for that long stops."""
    tolerated_errors: list[ErrorName] = []
    """Hardware errors(70) that are reported without stopping the run: input_voltage, overheat,
    encoder, electrical_shock, overload. Only those that the servos' own Shutdown(63) leaves out:
    with the others their torque is off."""
    reboot: bool = False
    """Reboot a servo that reports a hardware error when the bus is opened; otherwise refuse it."""
    transport: Literal["own", "sdk"] = "own"
    """What talks to the servos before the loop: this package, or dynamixel-sdk. In the loop it is
    always this package."""
    simulator: dict[str, Any] = {}
    """For the simulated servos only."""

    @property
    def tolerated(self) -> int:
        """Bits of Hardware Error Status(70) that stop nothing."""
        return sum(1 << ERROR_BITS[name] for name in dict.fromkeys(self.tolerated_errors))

    @property
    def latency_s(self) -> float:
        """[s] Latency timer of the adapter."""
        if self.usb_latency_s is not None:
            return self.usb_latency_s
        return adapter_of(self.port).latency_s


class Servo(NamedTuple):
    """One axis of the rig with the servo that moves it."""

    axis: AxisSpec
    options: ServoOptions
    model: Model
    obeys: int | None = None
    """Id of the servo whose goals it follows, as its shadow."""

    @property
    def impedance(self) -> bool:
        """Whether it takes effort."""
        return self.axis.causality == "impedance"

    @property
    def mode(self) -> int:
        """Operating mode that its commands need; with a current, positions hold no harder."""
        if self.axis.takes_position:
            limited = self.model.current_unit > 0.0
            return reg.CURRENT_POSITION_MODE if limited else reg.POSITION_MODE
        return reg.CURRENT_MODE if self.impedance else reg.VELOCITY_MODE

    @property
    def torque_constant(self) -> float:
        """[N m/A] At the horn."""
        given = self.options.torque_constant
        return self.model.torque_constant if given is None else given


def with_shadows(servos: Sequence[Servo]) -> list[Servo]:
    """Return the servos of the axes, and behind them the shadows of those that have one."""
    shadows = []
    for servo in servos:
        given = servo.options.shadow
        if given is None:
            continue
        own = {
            "id": given.id,
            "homing_offset": given.homing_offset,
            "reverse_mode": servo.options.reverse_mode != given.opposite,
            "shadow": None,
        }
        options = servo.options.model_copy(update=own)
        shadows.append(servo._replace(options=options, obeys=servo.options.id))
    return [*servos, *shadows]


def match_servos(options: DynamixelOptions, bus: BusSpec) -> list[Servo]:
    """Return the servo of each axis, in the bus' order.

    Raises
    ------
    ConfigError
        An axis has no servo, a model is unknown or cannot do what the axis needs; all at once.
    """
    by_id: dict[int, ServoOptions] = {}
    problems = []
    timeout_s = WATCHED_PERIODS / bus.rate_hz
    if options.watchdog_s < timeout_s * (1.0 - 1e-9):
        problems.append(
            f"bus {bus.name}: watchdog_s {options.watchdog_s:g} is shorter than {WATCHED_PERIODS} "
            f"periods at {bus.rate_hz:g} Hz, so servos would stop during a run; set it to "
            f"{timeout_s:.3g} or more"
        )
    for servo in options.servos:
        if servo.id in by_id:
            problems.append(f"bus {bus.name}: servo id {servo.id} is listed twice")
        by_id[servo.id] = servo
    shadows: set[int] = set()
    for servo in options.servos:
        if servo.shadow is None:
            continue
        if servo.shadow.id in by_id or servo.shadow.id in shadows:
            problems.append(
                f"bus {bus.name}: servo {servo.shadow.id} is the shadow of servo {servo.id} and "
                "moves with it; list it once, and give it no axis of its own"
            )
        shadows.add(servo.shadow.id)
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
        if axis.effort_sensor:
            problems.append(
                f"bus {bus.name}: {axis.name}: a servo measures its motor's current, recorded as "
                "motor_effort, and no effort from outside; remove effort_sensor"
            )
        refusal = _refusal(bus, options, axis, one, model)
        if refusal:
            problems.append(refusal)
        servos.append(Servo(axis, one, model))
    if problems:
        raise ConfigError(problems)
    return servos


def _unknown(bus: BusSpec, servo: ServoOptions) -> str:
    from difflib import get_close_matches

    close = get_close_matches(servo.model.upper(), MODELS, n=1)
    hint = f"did you mean {close[0]!r}?" if close else f"known: {', '.join(MODELS)}"
    return f"bus {bus.name}: servo {servo.id}: unknown model {servo.model!r}; {hint}"


def _refusal(
    bus: BusSpec, options: DynamixelOptions, axis: AxisSpec, servo: ServoOptions, model: Model
) -> str:
    where = f"bus {bus.name}: {axis.name}: "
    if options.protocol < 1.5:
        return where + (
            "protocol 1.0 servos have neither torque control nor a bus watchdog, so no axis runs "
            "on them; `tautwave scan dynamixel` reads their position and load; update an MX servo "
            "to firmware with protocol 2.0"
        )
    if axis.causality == "impedance" and model.current_unit == 0.0:
        return where + (
            f"a {model.name} has no current control, so it cannot take effort; make the axis "
            "causality: admittance, perhaps with a follower, or use an XL330, XC330, XM, XH, XD "
            "or XW servo"
        )
    known = servo.torque_constant or model.torque_constant
    if known == 0.0:
        return where + f"the stall torque of a {model.name} is not known; give torque_constant"
    unit = model.current_unit
    count = unit * known * servo.gear_ratio * (1 if servo.shadow is None else 2)
    most = model.current_range * count
    if axis.causality == "impedance" and axis.effort_limit >= most + count:
        return where + (
            f"effort_limit {axis.effort_limit:g} exceeds a {model.name}, whose highest current "
            f"limit {model.current_range * unit:.3g} A gives {most:.3g}; lower effort_limit"
        )
    if axis.causality == "impedance" and axis.effort_limit < count:
        return where + (
            f"effort_limit {axis.effort_limit:g} is less than one count of a {model.name}'s goal "
            f"current ({count:.3g}); raise it, or correct torque_constant and gear_ratio"
        )
    if servo.current_limit is not None and servo.current_limit > (model.current_range + 0.5) * unit:
        return where + (
            f"current_limit {servo.current_limit:g} exceeds the {model.current_range * unit:.3g} "
            f"A of a {model.name}"
        )
    if options.baud > model.fastest_baud:
        return where + f"a {model.name} goes up to {model.fastest_baud} baud (got {options.baud})"
    return ""
