"""Protocols that plugins and parts of the loop implement. Deliberately short."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, runtime_checkable

from tautwave.columns import Column
from tautwave.types import (
    AxisCommand,
    BusElement,
    CommandDelay,
    Damper,
    Fault,
    Imposed,
    JointState,
    Survey,
)

READ_SHARE = 0.8
"""Share of a loop period after which a sample counts as missing, so that commands still go out."""

ScanProgress = Callable[[float, str], None]
"""Takes the fraction of a scan that is done (0 to 1) and its current step."""


class AxisSpec(NamedTuple):
    """What a driver needs to know about one of its axes.

    `name` is `master.wrist`; `device_id` the number on the bus; `kind` is `rotary` or `linear`;
    `causality` is `impedance` (takes effort) or `admittance` (takes velocity, measures effort).
    Limits of the rig file, SI, infinite where not given; whether it has an `effort_sensor`, and
    `takes_position`: commands are those of `AxisCommand.position`, its effort is not used.
    """

    name: str
    device_id: int
    kind: str
    causality: str
    effort_limit: float
    velocity_limit: float = math.inf
    position_range: tuple[float, float] = (-math.inf, math.inf)
    effort_sensor: bool = False
    takes_position: bool = False


class BusSpec(NamedTuple):
    """What a driver needs to know about its bus: axes, rate and permissions.

    `rate_hz` is the rig's over the bus' divisor. `allow_unwatched`: accept devices without a
    watchdog; `configure`: write lasting settings where they differ (`device_settings`). With a
    `divisor` above 1 `read` and `write` come in the last cycle before the next request: a command
    acts at least one bus period after the sample.
    """

    name: str
    axes: tuple[AxisSpec, ...]
    rate_hz: float
    allow_unwatched: bool = False
    configure: bool = False
    divisor: int = 1

    @property
    def period_ns(self) -> int:
        """[ns] Time between two exchanges, rounded."""
        return round(1e9 / self.rate_hz)


class AxisFacts(NamedTuple):
    """Properties of an axis given by the bus options.

    Sensor and command steps, SI, 0: unknown; and the damper that its motor always has, None: none.
    """

    encoder_quantum: float = 0.0
    effort_quantum: float = 0.0
    velocity_quantum: float = 0.0
    damper: Damper | None = None


class Clock(Protocol):
    """Time of the loop, in ns. Drivers wait only through `wait`."""

    def now_ns(self) -> int: ...
    def sleep_until(self, deadline_ns: int) -> None: ...

    def wait(self, transport: Any, deadline_ns: int) -> bool:
        """Wait until `transport` has something to read (True) or the deadline passes (False).

        `transport` has a `fileno()`, or is `InMemory`.
        """


class InMemory(Protocol):
    """A transport whose other end is simulated in this process: a clock runs it while it waits."""

    def next_event_ns(self) -> int | None:
        """Return the time of the next event [ns], None if there is none."""

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns`."""

    def readable(self) -> bool:
        """Return whether there is something to read now."""


class FramePort(Protocol):
    """One end of a CAN bus, as a driver's transport: `InMemory`, or with a `fileno()`.

    Ids are as Linux has them: bit 31 marks one of 29 bits, bit 29 an error frame.
    """

    def send(self, can_id: int, data: bytes) -> bool:
        """Queue a data frame; False: full. Raises `DriverError` without a bus."""

    def receive(self) -> tuple[int, bytes, int] | None:
        """Return the oldest frame received as id, data and arrival [ns]; None if there is none."""

    def close(self) -> None: ...


class BytePort(Protocol):
    """One end of a serial line or of a connection: `InMemory`, or with a `fileno()`."""

    def write(self, data: bytes) -> None:
        """Send bytes to the line; raises `DriverError` if it is lost."""

    def read(self) -> bytes:
        """Return all received bytes without waiting; raises `DriverError` if the line is lost."""

    def close(self) -> None: ...


@runtime_checkable
class Driver(Protocol):
    """One bus and the axes on it. Times are ns, everything else SI.

    A driver may also be a `RowSource`, whose columns are recorded, and have `notes`, sentences on
    what `open` found, and `warnings`, those to be read before torque. `poll()`, if any, is called
    between `request` and `read` on a bus with a divisor. `misses`: by axis without a sample, what
    came in its place. `dead_man`: `name` and `held()` of inputs held while engaged. `identities`:
    by axis, as are (or by joint behind it) the three on watchdogs: before `open` as the options
    have them.
    `witness(name)`: what an axis' device says beside its samples, velocity and motor effort along
    the axis, NaN where it says nothing; from the first call on it may ask for them on the bus.
    """

    command_delay: CommandDelay
    """Time from a sample until the resulting command acts, in periods of the bus."""

    @property
    def watchdog_s(self) -> Mapping[str, float]:
        """[s] Silence of the host after which a device acts by itself; absent: it never does."""

    @property
    def unwatched(self) -> Mapping[str, str]:
        """What it does when the host stops, after its name; none where a watchdog was read back."""

    @property
    def unconfirmed(self) -> Mapping[str, str]:
        """Why it may still be enabled after `disable`; kept until `open` finds it off."""

    def open(self) -> None:
        """Torque off; verify identity, limits and watchdog. Blocks only through the clock."""

    def enable_step(self) -> bool:
        """Advance one step without blocking; called once per period, on every bus until all are on.

        True when enabled; further calls keep watchdogs fed.
        """

    def request(self) -> None:
        """Start the exchange; never blocks."""

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return a state per axis by the deadline (at once after it), invalid if not fresh."""

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Take one command per axis; it may be staged for the next request."""

    def faults(self) -> Sequence[Fault]:
        """Return the faults reported since the last call."""

    def disable(self) -> None:
        """Safe command, then torque off; idempotent."""

    def close(self) -> None:
        """Disable and release the bus; idempotent, never raises."""


class Budget(NamedTuple):
    """Bus time of one cycle, the highest rate [Hz] that fits, the calculation, and remedies."""

    time_s: float
    greatest_rate_hz: float
    arithmetic: str
    remedy: str = ""


class CycleCost(NamedTuple):
    """Measured host cost of one exchange: `spent_us` [us], one per cycle.

    `floor_us` is that of a bare exchange of the same bytes, measured alternately, if available; a
    goal is [us] at the median (`goal_us`) or a ratio of medians. `why_not`: why without figures.
    """

    what: str
    spent_us: Sequence[float] = ()
    floor_us: Sequence[float] = ()
    goal_us: float | None = None
    goal_ratio: float | None = None
    why_not: str = ""


class Endpoint(NamedTuple):
    """The endpoint named by the options of a bus; `name` is for people, such as `/dev/ttyUSB0`.

    `real`: motors may be behind it, and runs open it unless `--simulate` is given. `virtual`: only
    software can be there (vcan, UDP multicast). `none`: nothing to open.
    """

    kind: Literal["real", "virtual", "none"]
    name: str = ""


def _no_costs(cycles: int) -> Sequence[CycleCost]:
    return ()


def _no_facts(options: Any, bus: BusSpec) -> Sequence[AxisFacts]:
    return [AxisFacts()] * len(bus.axes)


def no_progress(done: float, text: str) -> None:
    """Show nothing."""


@dataclass(frozen=True, slots=True)
class DescribedObject:
    """An object of a device as its file describes it, for a simulator.

    `kind` is U8 to U64, I8 to I64, BOOL, REAL or STR; `access` ro, wo, rw or const; `default` None
    where the file has none; `mapped` whether process data may carry it, None: not said.
    """

    index: int
    sub: int
    kind: str
    access: str
    default: int | bytes | None
    mapped: bool | None


class DriverPlugin(NamedTuple):
    """Declaration behind a `tautwave.drivers` entry point.

    `options` is the pydantic model of the bus' `options` block; `make(options, bus, clock,
    transport)` builds a driver and touches no device (`transport` is None: the driver opens the
    real one in `open`); `budget(options, bus)` is pure; `scan(scan_options, progress)` finds
    devices, one mapping of columns each, and `scan_options` is the pydantic model `tautwave scan`
    makes its command-line options of. `needs` names the extra's modules; `hardware` is True when
    motors may move, and then every limit has to be in the rig file. `facts(options, bus)`, pure,
    returns what the options determine for each axis; `measure(cycles)` measures the host's cost of
    that many exchanges of two axes, for `tautwave bench buses`. `endpoint(options)`, pure, returns
    the endpoint; without it `hardware` decides. `files` are the options that may be file paths,
    such as `("devices", "*", "profile")`, and arrive as absolute paths. `survey` makes the bus'
    part of a rig file for `tautwave new`, `imposed(options, bus)` the motions it forces on axes.
    `elements(options, bus, axes, late)`: verdicts of a driver with laws of its own; the rig's axes
    by full name, the command delay in periods. `plain`: only the live loop simulates its axes;
    `positions`: they may take positions. `foreseen(options, bus)`, pure, returns sentences on what
    a run would say or refuse of the devices as files in the options describe them, for `check`;
    `contents(path, id)` what such a file describes, for a device's simulator. `columns`: what its
    drivers record, of each axis by its last word, else by its whole name, or where that is
    declared, as `module:attribute`.
    """

    options: type[Any]
    make: Callable[[Any, BusSpec, Clock, Any], Driver]
    budget: Callable[[Any, BusSpec], Budget]
    scan: Callable[[Any, ScanProgress], Sequence[Mapping[str, Any]]]
    needs: tuple[str, ...] = ()
    hardware: bool = True
    summary: str = ""
    facts: Callable[[Any, BusSpec], Sequence[AxisFacts]] = _no_facts
    scan_options: type[Any] | None = None
    measure: Callable[[int], Sequence[CycleCost]] = _no_costs
    endpoint: Callable[[Any], Endpoint] | None = None
    files: Sequence[Sequence[str]] = ()
    survey: Survey | None = None
    imposed: Callable[[Any, BusSpec], Sequence[Imposed]] | None = None
    elements: Callable[..., Sequence[BusElement]] | None = None
    plain: bool = False
    positions: bool = False
    foreseen: Callable[[Any, BusSpec], Sequence[str]] | None = None
    contents: Callable[[str, int], Sequence[DescribedObject]] | None = None
    columns: Sequence[Column] | str = ()


class Simulator(Protocol):
    """The other end of a driver: simulated devices with physics."""

    transport: Any

    def advance(self, to_ns: int) -> None: ...
    def close(self) -> None: ...


class Bench(NamedTuple):
    """Devices to simulate without a rig: a bus, and the truth of each of its axes."""

    options: Any
    bus: BusSpec
    physics: Sequence[Any]


def _never(options: Any) -> bool:
    return False


def _as_they_are(options: Any) -> Mapping[str, Any]:
    return {}


class SimulatorPlugin(NamedTuple):
    """Declaration behind a `tautwave.simulators` entry point.

    `make(options, bus, physics, clock)` builds the devices in this process, `physics` one
    `AxisModel` per axis. On the real clock, where `served(options)` is True, they run in a separate
    process instead: `serve(options, bus, physics, announce, stopped)` runs them on the real
    endpoint until `stopped()`, and first calls `announce` with at least `driver`, `endpoint` (a
    word for people and scripts) and `options`, the bus options that lead a driver there.
    `instead(options)` returns the bus options that replace a real endpoint when its devices are
    simulated on the real clock. `bench_options` is the pydantic model that `tautwave sim DRIVER`
    makes its command-line options of, `bench(bench_options)` the devices to serve. `arms`: its axes
    may be joints of an arm, which it moves together. `loops`: its followers move by the position
    loop of their `AxisModel`.
    """

    options: type[Any]
    make: Callable[[Any, BusSpec, Sequence[Any], Clock], Simulator]
    summary: str = ""
    served: Callable[[Any], bool] = _never
    serve: (
        Callable[
            [Any, BusSpec, Sequence[Any], Callable[[Mapping[str, Any]], None], Callable[[], bool]],
            None,
        ]
        | None
    ) = None
    bench_options: type[Any] | None = None
    bench: Callable[[Any], Bench] | None = None
    instead: Callable[[Any], Mapping[str, Any]] = _as_they_are
    arms: bool = False
    loops: bool = False


class CouplingPlugin(NamedTuple):
    """Declaration behind a `tautwave.couplings` entry point: a law coupling master and slave.

    A string is a `module:attribute`, loaded on demand; the thing itself serves as well. `keys` is
    the block of the rig's `coupling`, a `tautwave.config.Coupling` with pairs of its own.

    `law` is a `Law` of `tautwave.controller.steps`: the steps that the controller calls, the state
    that they work on, its columns and guards. `end_constants(pair, side, axis)`, with a
    `CoupledAxis`, returns the constants of one end, SI of its device, and `link_constants(coupling,
    period)` those between the ends: NamedTuples of numbers.

    `linear(pair, side, device, site)` is one end of the pair, a `LinearEnd` of
    `tautwave.analysis.ports.sampled_loop`; without it no stability is predicted. `verdict` is a
    `CouplingVerdict` of `tautwave.certificate.data`, or only its `pair_elements`; without one
    nothing is ever certified. `messages` is a `CouplingMessages` of `tautwave.wording`. `carries`
    says what is exchanged: `waves` or `states`. `divisors`: a side may be on a slower bus;
    `causalities`: of its axes; `observes`: it has no use for an axis' velocity filter. `over_link`
    is the `Law` over a network, or makes it of `law`; `at_sites` a `SiteLaw` for either of two
    sites; `linked` makes their constants and table, as in `couplings.wave.link`.
    `claim(rig, axis_name, delays)`: what an end may deliver as it sees it [J]; `claim_terms`, of
    the same, the terms, a `tautwave.analysis.claim.Claim`, or the key without which it is
    unbounded. `resolve(rig)`: a `Choice` for each key left to the law, by path.
    `missing(document)`: why a rig whose law is `auto` cannot have this one, each the end of a
    sentence about the law. `variant(plugin, coupling)`: the declaration for a rig's keys.
    `tune(constants, state, key, value, period)`: a running end's, with another value of a key.
    """

    summary: str
    keys: Any
    law: Any
    end_constants: Any
    link_constants: Any = ""
    over_link: Any = ""
    at_sites: Any = ""
    linked: Any = ""
    carries: str = "states"
    divisors: bool = False
    causalities: tuple[str, ...] = ("impedance",)
    observes: bool = False
    linear: Any = ""
    verdict: Any = ""
    messages: Any = ""
    claim: Any = ""
    claim_terms: Any = ""
    resolve: Any = ""
    missing: Any = ""
    variant: Any = ""
    tune: Any = ""


class ControlPlugin(NamedTuple):
    """Declaration behind a `tautwave.controls` entry point: what stands in place of a coupling.

    The entry point's name is the key of the rig file that describes it. Every other field names a
    module, imported where a rig has that key and no sooner: what one room of tautwave asks of it,
    as the Protocol in `hooks.py` of that room says.
    """

    summary: str
    config: str
    rig: str
    certificate: str
    simulation: str
    session: str
    report: str
    bench: str


class CoupledAxis(NamedTuple):
    """Properties of an axis in the rig, for the constants of a coupling's end; SI.

    `period` of its bus; `gain` of its tracker; `inertia`: lower bound, None: it takes velocities;
    `mass`, `viscous`, `coulomb`: estimates; `delay` in periods until a command acts, `late` beyond;
    `outside_stiffness`: upper bound or 0; `noise_lags`, if known; `follows`: mean lag [s] behind
    its goal, None without; `effort_rate`: the coupling's share of `effort_rate_limit`.
    """

    period: float
    gain: float
    inertia: float | None
    encoder_quantum: float
    position_noise: float
    delay: int
    outside_stiffness: float
    late: float = 0.0
    velocity_limit: float = math.inf
    effort_quantum: float = 0.0
    noise_lags: tuple[float, ...] | None = None
    effort_limit: float = math.inf
    mass: float | None = None
    viscous: float = 0.0
    coulomb: float = 0.0
    senses: bool = False
    follows: float | None = None
    effort_rate: float = math.inf


class Row(Protocol):
    """A row of the recording: any object whose floats can be set by index."""

    def __setitem__(self, index: int, value: float, /) -> None: ...


@runtime_checkable
class RowSource(Protocol):
    """The owner of some columns of the recording, which it fills once per cycle."""

    @property
    def columns(self) -> Sequence[str]:
        """Names of the columns, fixed once built."""

    def fill(self, row: Row, at: int) -> None:
        """Write one float per column into `row`, beginning at index `at`."""
