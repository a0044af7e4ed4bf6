"""Options of simulated Modbus drives: what they need of a bus' block, and what is theirs."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from tautwave.errors import ConfigError

Positive = Annotated[float, Field(gt=0.0)]
Seconds = Annotated[float, Field(ge=0.0)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
Unit = Annotated[int, Field(ge=0, le=255)]

RequestFault = Literal[
    "request_lost",
    "answer_lost",
    "answer_late",
    "noise",
    "wrong_unit",
    "truncated",
    "corrupted",
    "exception",
]
LinkFault = Literal["reset", "refused", "half_open", "gone", "unplugged"]
DriveFault = Literal["drive_fault", "power_cycle"]

REQUEST_FAULTS: tuple[RequestFault, ...] = (
    "request_lost",
    "answer_lost",
    "answer_late",
    "noise",
    "wrong_unit",
    "truncated",
    "corrupted",
    "exception",
)
DRIVE_FAULTS: tuple[DriveFault, ...] = ("drive_fault", "power_cycle")
LINK_FAULTS: tuple[LinkFault, ...] = ("reset", "refused", "half_open", "gone", "unplugged")


class _Keys(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class _Shared(BaseModel):
    """The driver's model of the same block is the strict one; here only what is needed is read."""

    model_config = ConfigDict(extra="ignore", strict=True, frozen=True, allow_inf_nan=False)


class FaultEvent(_Keys):
    """Something that goes wrong once, at a time or at a request."""

    kind: RequestFault | LinkFault | DriveFault
    """`request_lost`: no drive gets it; `answer_lost`: the write acts, but no response comes;
    `answer_late`: by `late_s`; `noise`: random bytes before the response; `wrong_unit`: the
    response has another address; `truncated`: its end is missing; `corrupted`: one bit is wrong
    (RTU: detected by the CRC; TCP: in the transaction id); `exception`: exception `code` instead.
    `reset`: the TCP connection is reset; `refused`: new ones are; `half_open`: nothing comes any
    more, and no end either; `gone`: reset, then refused; `unplugged`: the serial adapter is gone.
    `drive_fault`: the drive has a fault, `code` in its fault register; `power_cycle`: it begins
    anew, with the values of its power-on."""
    at_s: Seconds | None = None
    """[s] after the drives began to move: from then on."""
    nth: Annotated[int, Field(ge=1)] | None = None
    """The n-th request since power-on, of those to `unit` where that is given."""
    unit: Unit | None = None
    times: Annotated[int, Field(ge=1)] = 1
    """So many requests in a row, of those meant."""
    duration_s: Seconds = 0.0
    """[s] How long it lasts; 0: `times` requests, or permanently for a link failure."""
    code: Annotated[int, Field(ge=1, le=0xFFFF)] | None = None
    """Of an exception (4 if not given) or of a drive's fault."""


class ModbusFaults(_Keys):
    """What goes wrong on the line; each key is a probability per request."""

    seed: Annotated[int, Field(ge=0)] = 0
    request_lost: Probability = 0.0
    answer_lost: Probability = 0.0
    answer_late: Probability = 0.0
    noise: Probability = 0.0
    wrong_unit: Probability = 0.0
    truncated: Probability = 0.0
    corrupted: Probability = 0.0
    exception: Probability = 0.0
    late_s: Positive = 0.02
    """[s] How late a late response is."""
    exception_code: Annotated[int, Field(ge=1, le=255)] = 6
    events: Annotated[tuple[FaultEvent, ...], Field(strict=False)] = ()


class Quirks(_Keys):
    """How one drive differs."""

    registers: dict[str, int] = Field(default_factory=dict)
    """Values at power-on, by the name of the register."""
    answer_s: Seconds | None = None
    """[s] From the end of a request to its response, instead of `turnaround_s`."""
    enable_s: Seconds = 0.0
    """[s] From the command until it is on."""
    refuses_to_enable: bool = False
    starts_in_fault: bool = False
    resets: Annotated[int, Field(ge=1)] = 1
    """Fault resets that a fault needs."""
    busy_after_write_s: Seconds = 0.0
    """[s] It responds with exception 6 that long after each write to its EEPROM."""
    eeprom_life: Annotated[int, Field(ge=1)] | None = None
    """Writes to EEPROM that it survives; from then on they end in exception 4."""
    gaps_read_zero: bool = False
    """Addresses between registers read as 0 instead of exception 2."""
    keeps_comm_timeout: bool = False
    """A write to the register of the comm-loss timeout is confirmed and has no effect."""


class SimulatorKeys(_Keys):
    """The `simulator` block in a Modbus bus' options."""

    faults: ModbusFaults = ModbusFaults()
    devices: dict[Annotated[int, Field(strict=False)], Quirks] = Field(default_factory=dict)
    """By unit; a drive not listed behaves."""
    server: Literal["own", "pymodbus"] = "own"
    """The TCP server, in a process of its own; only `own` has line faults."""
    silent_s: Seconds | None = None
    """[s] Silence that ends an RTU frame, instead of the standard's."""
    strict: bool = False
    """Whether a drive on RTU needs that silence after its own response too."""
    latency_s: Seconds = 0.0
    """[s] Latency timer of the serial adapter."""


class SensorKeys(_Shared):
    """The register of an effort sensor, and what one count of it is."""

    register_name: Annotated[str, Field(alias="register")]
    effort: float
    zero: int = 0


class DeviceKeys(_Shared):
    """One drive and its motor."""

    unit: Unit
    profile: str = "generic"
    endpoint: str | None = None
    rated_torque: Positive | None = None
    torque_constant: Positive | None = None
    counts_per_revolution: Positive | None = None
    gear_ratio: Positive = 1.0
    feed: Positive | None = None
    direction: Literal[1, -1] = 1
    function_codes: Annotated[tuple[int, ...] | None, Field(strict=False)] = None
    effort_sensor: SensorKeys | None = None


class SimulatedModbusOptions(_Shared):
    """Options of a Modbus bus, as far as its simulated drives need them."""

    link: Literal["tcp", "rtu"] = "tcp"
    endpoint: str = "sim"
    baud: Annotated[int, Field(ge=300)] = 115200
    parity: Literal["N", "E", "O"] = "N"
    stop_bits: Annotated[int, Field(ge=1, le=2)] = 1
    turnaround_s: Seconds | None = None
    devices: Annotated[tuple[DeviceKeys, ...], Field(strict=False)]  # a list, where it was dumped
    simulator: SimulatorKeys = SimulatorKeys()

    @property
    def bits(self) -> int:
        """Bits of a character: start, eight of data, parity, stop."""
        return 9 + (self.parity != "N") + self.stop_bits


class ModbusBenchOptions(BaseModel):
    """`tautwave sim modbus`."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    profile: str = Field("generic", description="generic, dsy-rs, cia402, or a profile's file")
    tcp: str | None = Field(None, description="HOST:PORT to listen on; port 0 picks any free port")
    rtu: bool = Field(False, description="serve RTU on a pseudo-terminal")
    units: tuple[Unit, ...] = Field((1,), min_length=1, description="unit ids")
    baud: int = Field(115200, ge=300, description="of the RTU line")
    parity: Literal["N", "E", "O"] = Field(
        "N", description="of the RTU line's time; a pseudo-terminal has none: open it with N"
    )
    stop_bits: int = Field(1, ge=1, le=2, description="of the RTU line")
    turnaround_s: float = Field(0.0, ge=0.0, description="time a drive takes to respond [s]")
    silent_s: float | None = Field(
        None, ge=0.0, description="silence that ends an RTU frame [s], if not the standard's"
    )
    causality: Literal["impedance", "admittance"] = Field(
        "impedance", description="torque drives, or velocity drives with measured torque"
    )
    rate_hz: float = Field(1000.0, gt=0.0, description="physics steps per second")
    inertia: float = Field(1e-3, gt=0.0, description="of each motor [kg m2]")
    damping: float = Field(1e-3, ge=0.0, description="of each motor [N m s/rad]")
    server: Literal["own", "pymodbus"] = Field("own", description="TCP server")


def host_port(endpoint: str) -> tuple[str, int]:
    """Return host and port of `tcp://HOST:PORT`, with or without what is in front.

    Raises
    ------
    ConfigError
        It is none.
    """
    host, _, port = endpoint.removeprefix("tcp://").rpartition(":")
    if not host or not (port.isascii() and port.isdigit()) or int(port) > 0xFFFF:
        raise ConfigError(
            f"modbus: {endpoint!r} is not HOST:PORT to listen on; port 0 picks any free port"
        )
    return host, int(port)
