"""Every Protocol a plugin or a part of the loop has to fulfil. It fits on a card on purpose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol, runtime_checkable

from tautwave.types import AxisCommand, CommandDelay, Fault, JointState


class AxisSpec(NamedTuple):
    """What a driver has to know of one of its axes.

    `name` is `master.wrist` or `slave.wrist`; `device_id` the number on the bus; `kind` is
    `rotary` or `linear`; `causality` is `impedance` (takes effort) or `admittance` (takes
    velocity, measures effort); `effort_limit` [N m or N].
    """

    name: str
    device_id: int
    kind: str
    causality: str
    effort_limit: float


class Clock(Protocol):
    """Time of the loop, in ns. Drivers wait only through `wait`."""

    def now_ns(self) -> int: ...

    def sleep_until(self, deadline_ns: int) -> None: ...

    def wait(self, transport: Any, deadline_ns: int) -> bool:
        """Wait until `transport` has something to read (True) or the deadline passes (False)."""
        ...


@runtime_checkable
class Driver(Protocol):
    """One bus and the axes on it. Times are ns, everything else SI."""

    command_delay: CommandDelay

    def open(self) -> None: ...

    def enable_step(self) -> bool: ...

    def request(self) -> None: ...

    def read(self, deadline_ns: int) -> Sequence[JointState]: ...

    def write(self, commands: Sequence[AxisCommand]) -> None: ...

    def faults(self) -> Sequence[Fault]: ...

    def disable(self) -> None: ...

    def close(self) -> None: ...


class Budget(NamedTuple):
    """Bus time of one cycle: `time_s` needed, the greatest rate [Hz] that fits, the arithmetic."""

    time_s: float
    greatest_rate_hz: float
    arithmetic: str


class DriverPlugin(NamedTuple):
    """What a `tautwave.drivers` entry point names.

    `options` is the pydantic model of the bus' `options` block; `make(options, axes, clock,
    transport)` builds a driver and touches no device; `budget(options, axes, rate_hz)` is pure;
    `scan(options)` finds devices. `needs` names the extra's modules; `hardware` is True when
    motors may move, and then every limit has to be in the rig file.
    """

    options: type[Any]
    make: Callable[[Any, Sequence[AxisSpec], Clock, Any], Driver]
    budget: Callable[[Any, Sequence[AxisSpec], float], Budget]
    scan: Callable[[Any], Sequence[str]]
    needs: tuple[str, ...] = ()
    hardware: bool = True
    summary: str = ""


class Simulator(Protocol):
    """The other end of a driver: devices with physics behind them."""

    transport: Any

    def advance(self, to_ns: int) -> None: ...

    def close(self) -> None: ...


class SimulatorPlugin(NamedTuple):
    """What a `tautwave.simulators` entry point names: `make(options, axes, physics, clock)`."""

    options: type[Any]
    make: Callable[[Any, Sequence[AxisSpec], Sequence[Any], Clock], Simulator]
    summary: str = ""


class Row(Protocol):
    """A row of the recording: anything whose floats can be set by index."""

    def __setitem__(self, index: int, value: float, /) -> None: ...


class RowSource(Protocol):
    """Something that owns columns of the recording and fills them once a cycle."""

    @property
    def columns(self) -> Sequence[str]:
        """Names of the columns, fixed once built."""
        ...

    def fill(self, row: Row, at: int) -> None:
        """Write one float per column into `row`, beginning at index `at`."""
        ...
