"""Options of a Modbus bus, and what they mean for each axis of the rig."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import AxisFacts, AxisSpec, BusSpec
from tautwave.errors import ConfigError
from tautwave_drivers.adapter import adapter_of
from tautwave_drivers.cia402.units import INT16, INT32, limit_counts
from tautwave_drivers.modbus.profile import Keys, Profile, Register, load_profile
from tautwave_drivers.modbus.protocol.registers import bounds


class SensorRegister(Keys):
    """A register with what an effort sensor shows, such as an analogue input."""

    register_name: Annotated[str, Field(alias="register", description="Its name in the profile.")]
    effort: float
    """[N m | N] of one count, as the effort from outside on the axis; may be negative."""
    zero: int = 0
    """Counts without an effort."""


def check_reports(
    axis: AxisSpec, unit: int, sensor: SensorRegister | None, torque: bool, profile: Profile
) -> None:
    """Refuse sensors and reports that an axis, its unit and its profile do not agree on.

    Raises
    ------
    ConfigError
        It says what to add or remove.
    """
    if axis.effort_sensor and sensor is None:
        raise ConfigError(
            f"it has an effort_sensor, but unit {unit} does not define it; add effort_sensor: "
            f"{{register: NAME, effort: N m of one count}} to the device"
        )
    if sensor is not None:
        if not axis.effort_sensor:
            raise ConfigError(
                f"unit {unit} reads an effort_sensor, but the axis has none; add effort_sensor: "
                f"{{}} to it"
            )
        if sensor.register_name not in profile.registers:
            raise ConfigError(
                f"profile {profile.family} has no register {sensor.register_name!r} for "
                "effort_sensor; add it there"
            )
        if sensor.effort == 0.0:
            raise ConfigError("effort_sensor.effort (per count) must not be 0")
    if torque:
        if axis.causality == "admittance":
            raise ConfigError(
                "it is velocity-controlled and already reports its torque; remove report_torque"
            )
        if profile.register_of("effort") is None:
            raise ConfigError(
                f"profile {profile.family} has no register with role effort for report_torque"
            )


Positive = Annotated[float, Field(gt=0.0)]
Pause = Annotated[float, Field(gt=0.0, le=60.0)]
"""[s] More than a minute is a typing error."""
WRAP_S = 0.05
"""[s] That much may pass between two samples of a position of 16 bits, at least."""
TCP = "tcp://"
PORT = 502


class Block(BaseModel):
    """Strict and frozen, like the rest of a rig file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class DeviceOptions(Block):
    """One drive."""

    unit: Annotated[int, Field(ge=0, le=255)]
    """Unit id (RTU address); the `id` of the axis. Drives with a TCP server of their own often have
    0 or 255; 1 to 247 with `link: rtu`."""
    profile: str = "generic"
    """generic, dsy-rs, cia402, or the path of a profile's YAML file."""
    endpoint: str | None = None
    """tcp://HOST:PORT of a drive with a connection of its own; the bus' endpoint if not given."""
    rated_torque: Positive | None = None
    """[N m] At the motor's shaft; compared with the drive's own where it can be read."""
    torque_constant: Positive | None = None
    """[N m/A] Of the motor, where the drive measures or takes current."""
    counts_per_revolution: Positive | None = None
    """Position counts per turn of the motor; the profile's if not given."""
    gear_ratio: Positive = 1.0
    """Turns of the motor per turn of the output."""
    feed: Positive | None = None
    """[m] per turn of the output; required for a linear axis."""
    direction: Literal[1, -1] = 1
    """-1: the axis counts against the drive."""
    function_codes: list[Literal[1, 2, 3, 4, 5, 6, 15, 16, 23]] | None = None
    """Those this drive accepts, where they are not the profile's."""
    effort_sensor: SensorRegister | None = None
    """Of an axis with `effort_sensor`; read in every cycle."""
    report_torque: bool = False
    """The profile's register `effort` of an axis that takes torque, recorded as `motor_effort`."""


class ModbusOptions(Block):
    """Options of a Modbus bus."""

    link: Literal["tcp", "rtu"] = "tcp"
    """rtu: RTU frames, on a serial line or passed on by a serial server at tcp://HOST:PORT."""
    endpoint: str = "sim"
    """tcp://HOST:PORT, a serial device, or `sim`: simulated drives."""
    baud: Annotated[int, Field(ge=300, le=10_000_000)] = 115_200
    parity: Literal["N", "E", "O"] = "N"
    stop_bits: Annotated[int, Field(ge=1, le=2)] = 1
    turnaround_s: Annotated[float, Field(ge=0.0, le=10.0)] | None = None
    """[s] From the end of a request until the drive responds; for TCP including the network.
    Not given: 0 on a serial line, where the silence it needs is counted apart, 1 ms on TCP."""
    gap_s: Annotated[float, Field(gt=0.0, le=1.0)] | None = None
    """[s] Silence between frames on a serial line; 3.5 characters, 1.75 ms above 19200 baud, if
    not given."""
    usb_latency_s: Annotated[float, Field(ge=0.0, le=0.1)] | None = None
    """[s] Latency timer of the USB adapter; not given: of the device that `endpoint` leads to,
    0.001 on USB, more where an FTDI timer may not be set, 0 on a UART or pty."""
    echo: bool = False
    """The adapter of a serial line returns what is sent, as some for RS-485 do: it is taken off."""
    late_s: Pause = 0.02
    """[s] Longest time a drive ever takes to respond. After a request without a response its
    drive is left alone that long, since a late response could be taken for the next one's."""
    comm_timeout_s: Pause = 0.1
    """[s] Silence after which a drive shall stop by itself, where it can."""
    reconnect: Literal["stop", "reconnect"] = "stop"
    """When the link is lost: end the run, or try again while the loop counts missing samples."""
    silence_s: Pause = 0.25
    """[s] Without any response, after which a link counts as dead although it is not closed."""
    connect_timeout_s: Pause = 2.0
    devices: Annotated[list[DeviceOptions], Field(min_length=1)]
    simulator: dict[str, Any] = Field(default_factory=dict)
    """For simulated drives only."""

    @property
    def bits(self) -> int:
        """Bits of a character: start, eight of data, parity, stop."""
        return 9 + (self.parity != "N") + self.stop_bits

    @property
    def gap(self) -> float:
        """[s] Silence between frames (MODBUS over Serial Line V1.02, 2.5.1.1)."""
        if self.gap_s is not None:
            return self.gap_s
        return 1.75e-3 if self.baud > 19200 else 3.5 * self.bits / self.baud

    @property
    def turnaround(self) -> float:
        """[s] What a drive takes to respond."""
        if self.turnaround_s is not None:
            return self.turnaround_s
        return 0.0 if self.link == "rtu" and not self.endpoint.startswith(TCP) else 1e-3

    @property
    def latency_s(self) -> float:
        """[s] Latency timer of a USB adapter."""
        if self.usb_latency_s is not None:
            return self.usb_latency_s
        if self.link == "tcp" or self.endpoint == "sim" or self.endpoint.startswith(TCP):
            return 0.0
        return adapter_of(self.endpoint).latency_s


class Scale(NamedTuple):
    """Value of one count at the axis in SI; `direction` is -1 where the drive counts backwards.

    `position` [rad or m], `velocity` and `velocity_command` [rad/s or m/s], `effort` and
    `effort_command` [N m or N]; 0 where the drive has no such register.
    """

    position: float
    velocity: float
    velocity_command: float
    effort: float
    effort_command: float
    direction: int


class Device(NamedTuple):
    """One axis of the rig with the drive that moves it.

    `functions` are those it accepts; `command` its register for torque or velocity, `quantum` and
    `most` the value of one count and how many counts the rig allows.
    """

    axis: AxisSpec
    options: DeviceOptions
    profile: Profile
    scale: Scale
    functions: tuple[int, ...]
    endpoint: str
    command: Register
    quantum: float
    most: int

    @property
    def impedance(self) -> bool:
        """Whether it takes torque."""
        return self.axis.causality == "impedance"

    @property
    def unit(self) -> int:
        """Unit id."""
        return self.options.unit

    @property
    def read_names(self) -> list[str]:
        """Registers that are read in every cycle, by their names in the profile."""
        roles = ["position", "status"]
        if not self.impedance or self.options.report_torque:
            roles.append("effort")
        names = [self.profile.roles[role] for role in roles]  # type: ignore[index]
        sensor = self.options.effort_sensor
        return names if sensor is None else [*names, sensor.register_name]

    @property
    def label(self) -> str:
        """Axis and unit, for messages."""
        return f"{self.axis.name} (unit {self.unit})"


def scale_of(axis: AxisSpec, options: DeviceOptions, profile: Profile) -> Scale:
    """Return what a drive's counts are worth; torque passes the gear without loss.

    Raises
    ------
    ConfigError
        A property of the drive is missing.
    """
    counts = options.counts_per_revolution or profile.counts_per_revolution
    rated = options.rated_torque
    problems = []
    if counts is None:
        problems.append("counts_per_revolution is required; its profile does not have it")
    used = [profile.register_of("effort"), profile.register_of("command_effort")]
    if rated is None and any(one is not None and one.unit == "rated" for one in used):
        problems.append("rated_torque [N m] is required: the drive reports effort as a share of it")
    constant = options.torque_constant
    if constant is None and any(one is not None and one.unit == "A" for one in used):
        problems.append("torque_constant [N m/A] is required: the drive reports effort in amperes")
    if axis.kind == "linear" and options.feed is None:
        problems.append("feed [m per turn of the output] is required for a linear axis")
    if axis.kind == "rotary" and any(one is not None and one.unit == "N" for one in used):
        problems.append("the drive reports effort in N, which is for linear axes")
    if axis.kind == "rotary" and options.feed is not None:
        problems.append("feed is for linear axes; remove it, or make the axis linear")
    if problems:
        raise ConfigError(problems)
    assert counts is not None
    travel = math.tau if options.feed is None else options.feed
    position = travel / (counts * options.gear_ratio)

    def velocity(register: Register | None) -> float:
        if register is None:
            return 0.0
        if register.unit == "rpm":
            return register.scale / 60.0 * travel / options.gear_ratio
        return register.scale * position

    def effort(register: Register | None) -> float:
        if register is None:
            return 0.0
        if register.unit == "N":  # of a linear motor
            return register.scale * options.gear_ratio
        per_unit = {"N m": 1.0, "A": constant, "rated": rated}.get(register.unit)
        of_motor = (per_unit or 0.0) * register.scale
        return of_motor * options.gear_ratio * (math.tau / travel)

    return Scale(
        position,
        velocity(profile.register_of("velocity")),
        velocity(profile.register_of("command_velocity")),
        effort(profile.register_of("effort")),
        effort(profile.register_of("command_effort")),
        options.direction,
    )


def match_devices(options: ModbusOptions, bus: BusSpec) -> list[Device]:
    """Return the drive of each axis, in the bus' order.

    Raises
    ------
    ConfigError
        Options and axes do not match, or a drive cannot do what its axis needs; all problems
        at once.
    """
    problems = _link_problems(options, bus)
    by_unit: dict[tuple[str, int], DeviceOptions] = {}
    by_id: dict[int, DeviceOptions] = {}
    for one in options.devices:
        key = (one.endpoint or "", one.unit)
        if key in by_unit or one.unit in by_id:
            problems.append(f"bus {bus.name}: unit {one.unit} is listed twice in options.devices")
        by_unit[key] = by_id[one.unit] = one
    devices = []
    for axis in bus.axes:
        where = f"bus {bus.name}: {axis.name}: "
        device = by_id.get(axis.device_id)
        if device is None:
            listed = ", ".join(str(unit) for unit in sorted(by_id))
            problems.append(
                f"{where}has id {axis.device_id}, but options.devices lists units {listed}; add "
                "it there, or correct the id"
            )
            continue
        try:
            devices.append(_matched(options, axis, device))
        except ConfigError as err:
            problems += [f"{where}{problem}" for problem in err.problems]
    if problems:
        raise ConfigError(problems)
    return devices


def _link_problems(options: ModbusOptions, bus: BusSpec) -> list[str]:
    endpoints = [one.endpoint for one in options.devices if one.endpoint is not None]
    problems = []
    if options.link == "rtu":
        behind = [options.endpoint, *endpoints]
        if endpoints and not all(one.startswith(TCP) for one in behind):
            problems.append(
                "endpoint of a device is for TCP; on a serial line all drives share that of the bus"
            )
        units = [one.unit for one in options.devices if not 1 <= one.unit <= 247]
        if units:
            problems.append(
                f"unit {units[0]} is for a TCP server; with link: rtu units are 1 to 247"
            )
    elif options.echo:
        problems.append("echo is for serial lines; remove it, or use link: rtu")
    for one in {options.endpoint, *endpoints} - {"sim"}:
        if options.link == "tcp" or one.startswith(TCP):
            try:
                host_port(one)
            except ConfigError as err:
                problems += err.problems
    return [f"bus {bus.name}: {problem}" for problem in problems]


def host_port(endpoint: str) -> tuple[str, int]:
    """Return host and port of tcp://HOST:PORT; the port may be left out.

    Raises
    ------
    ConfigError
        It is none.
    """
    host, colon, port = endpoint.removeprefix(TCP).rpartition(":")
    if not colon:
        host, port = port, str(PORT)
    if not endpoint.startswith(TCP) or not host or not port.isdigit() or int(port) > 0xFFFF:
        raise ConfigError(f"endpoint {endpoint} should be tcp://HOST:PORT, e.g. tcp://10.0.0.7:502")
    return host.strip("[]"), int(port)


def _matched(options: ModbusOptions, axis: AxisSpec, device: DeviceOptions) -> Device:
    profile = load_profile(device.profile)
    register = _command(axis, profile)
    scale = scale_of(axis, device, profile)
    functions = tuple(device.function_codes or profile.functions)
    if not {3, 4} & set(functions) or not {6, 16} & set(functions):
        raise ConfigError(
            f"function_codes {list(functions)}: one that reads (3, 4) and one that writes (6, 16) "
            "are required"
        )
    if register.words == 2 and 16 not in functions:
        raise ConfigError("a command of 32 bits needs function code 16")
    low, high = bounds(register.type)
    room = min(high, -low - 1) if low < 0 else 0
    if room < 1:
        raise ConfigError(f"profile {profile.family}: its command register is unsigned")
    _check_wrap(axis, profile, scale)
    check_reports(axis, device.unit, device.effort_sensor, device.report_torque, profile)
    impedance = axis.causality == "impedance"
    quantum = scale.effort_command if impedance else scale.velocity_command
    limit = axis.effort_limit if impedance else axis.velocity_limit
    most = min(limit_counts(limit, quantum, INT32 if room > INT16 else INT16), room)
    if most < 1:
        what = "effort_limit" if impedance else "velocity_limit"
        raise ConfigError(
            f"{what} {limit:g} is less than one count of its command ({quantum:.4g}); raise it, "
            "or correct rated_torque and gear_ratio"
        )
    endpoint = device.endpoint or options.endpoint
    return Device(axis, device, profile, scale, functions, endpoint, register, quantum, most)


def _check_wrap(axis: AxisSpec, profile: Profile, scale: Scale) -> None:
    """Refuse a position of 16 bits whose number of wraps would be ambiguous.

    Raises
    ------
    ConfigError
        Its counts come round within the axis' range, or faster than a sample follows another.
    """
    register = profile.registers[profile.roles["position"]]
    if register.words != 1:
        return
    span = (1 << 16) * scale.position
    low, high = axis.position_range
    unit = "m" if axis.kind == "linear" else "rad"
    if not high - low < span:
        raise ConfigError(
            f"its position register has 16 bits, which come round after {span:.4g} {unit}, within "
            f"position_range: where it is when switched on would be ambiguous; narrow the range to "
            "less than that, or use a register of 32 bits"
        )
    if axis.velocity_limit * WRAP_S >= 0.5 * span:
        raise ConfigError(
            f"its position register has 16 bits, which come round after {span:.4g} {unit}: at "
            f"velocity_limit {axis.velocity_limit:g} {unit}/s half of that passes in less than "
            f"{WRAP_S:g} s, so a wrap could be mistaken; lower velocity_limit to "
            f"{0.49 * span / WRAP_S:.3g}, or use a register of 32 bits"
        )


def _command(axis: AxisSpec, profile: Profile) -> Register:
    """Return the register that the axis commands; a position servo is refused."""
    effort = profile.register_of("command_effort")
    velocity = profile.register_of("command_velocity")
    if effort is None and velocity is None:
        raise ConfigError(
            f"profile {profile.family} takes positions only: a stiff position servo is neither an "
            "impedance nor an admittance port, so it cannot be coupled; use a drive that takes "
            "torque, or velocity with measured torque"
        )
    if axis.causality == "impedance":
        if effort is None:
            raise ConfigError(
                f"profile {profile.family} takes no torque; make the axis causality: admittance"
            )
        return effort
    if velocity is None:
        raise ConfigError(
            f"profile {profile.family} takes no velocity; make the axis causality: impedance"
        )
    if profile.register_of("effort") is None:
        raise ConfigError(
            f"profile {profile.family} does not measure torque or current, which an admittance "
            "port needs; make the axis causality: impedance, or add a register with role effort"
        )
    return velocity


def facts(options: ModbusOptions, bus: BusSpec) -> list[AxisFacts]:
    """Return the steps of each axis' sensors and commands [SI]."""
    return [
        AxisFacts(one.scale.position, one.quantum, 0.0)
        if one.impedance
        else AxisFacts(one.scale.position, one.scale.effort, one.quantum)
        for one in match_devices(options, bus)
    ]
