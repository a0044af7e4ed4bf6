"""What stands behind a CAN port, whatever is on the bus: its wire, its faults, its time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from tautwave.contracts import BusSpec
from tautwave.errors import ConfigError
from tautwave.truth import AxisModel
from tautwave_sim.wire.can import CanTiming
from tautwave_sim.wire.can_faults import CanFaultPlan, CanFaults
from tautwave_sim.wire.can_medium import CanMedium, MediumPort

Device = TypeVar("Device")
Planned = tuple[float | None, Callable[[int], None]]
"""When a fault of a device is due [s], None for never, and what is called with the time [ns]."""


class CanWorld(ABC):
    """A CAN bus with devices on it.

    Parameters
    ----------
    timing : CanTiming
        Time that frames take.
    plan : CanFaultPlan
        What goes wrong.
    period_ns : int
        Of the slots that the devices' axes move on.
    now_ns : int
        When everything is switched on.

    Attributes
    ----------
    extended : bool
        Its devices use identifiers of 29 bits.
    axes : sequence
        What the devices move, in the order of the bus' axes.
    arms : sequence
        The arms whose joints these axes are.
    """

    extended = False
    axes: Sequence[Any] = ()
    arms: Sequence[Any] = ()

    def __init__(self, timing: CanTiming, plan: CanFaultPlan, period_ns: int, now_ns: int) -> None:
        self.plan = plan
        self.medium = CanMedium(timing, now_ns, plan, self.elapsed_ns)
        self._period_ns = period_ns
        self._origin_ns: int | None = None
        self._slot = 0
        self._due: list[tuple[int, int, Callable[[int], None]]] = []

    def elapsed_ns(self, t_ns: int) -> int | None:
        """Return the time since the devices began to move [ns], None before."""
        return None if self._origin_ns is None else t_ns - self._origin_ns

    def port_fault(self, port: MediumPort) -> str:
        """Return the fault of the master's `port`: '', `queue_full`, `bus_off` or `bus_down`."""
        if self.plan.idle:
            return "bus_off" if port.off else ""
        fault = self.plan.port(self.elapsed_ns(self.medium.now_ns))
        self.medium.down = fault == "bus_down"
        if fault == "bus_off" and not port.off:
            port.leave(self.medium.now_ns)
        return "bus_off" if port.off and fault != "bus_down" else fault

    # -- events ---------------------------------------------------------------------------

    @abstractmethod
    def _device_event_ns(self) -> int | None:
        """Return when a device or a slot is next to act by itself."""

    @abstractmethod
    def _run(self, at_ns: int) -> None:
        """Let slots and devices act that are to act at `at_ns`."""

    def _befalls(self, at: int, planned: Iterable[Planned]) -> None:
        """Plan the faults of device `at`, counted from when the devices begin to move."""
        self._due += [
            (round(at_s * 1e9), at, action) for at_s, action in planned if at_s is not None
        ]
        self._due.sort(key=lambda due: due[:2])

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself."""
        return earlier(self.medium.next_event_ns(), self._own_event_ns())

    def next_heard_ns(self, port: MediumPort) -> int | None:
        """Return a time before which `port` hears nothing."""
        return earlier(self.medium.next_heard_ns(port), self._own_event_ns())

    def _own_event_ns(self) -> int | None:
        at_ns = self._device_event_ns()
        if self._due and self._origin_ns is not None:
            at_ns = earlier(at_ns, self._origin_ns + self._due[0][0])
        return at_ns

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns], in order."""
        while True:
            at_ns = self.next_event_ns()
            if at_ns is None or at_ns > to_ns:
                break
            self._step(at_ns)
        self.medium.advance(to_ns)

    def _step(self, at_ns: int) -> None:
        due = self.medium.next_event_ns()
        if due is not None and due <= at_ns:
            self.medium.step(due)
            return
        self.medium.now_ns = max(self.medium.now_ns, at_ns)
        while self._due and self._origin_ns is not None:
            if self._origin_ns + self._due[0][0] > at_ns:
                break
            _, _, action = self._due.pop(0)
            action(at_ns)
        self._run(at_ns)


def earlier(one: int | None, other: int | None) -> int | None:
    """Return the earlier of two times [ns], of which None is never."""
    if one is None or (other is not None and other < one):
        return other
    return one


class _SimulatorKeys(Protocol):
    @property
    def faults(self) -> CanFaults: ...

    @property
    def queue(self) -> int: ...


class CanOptions(Protocol):
    """Options of a bus of simulated devices."""

    @property
    def interface(self) -> str:
        """Of python-can."""

    @property
    def channel(self) -> str:
        """Its channel."""

    @property
    def bitrate(self) -> int:
        """[bit/s]."""

    @property
    def data_bitrate(self) -> int | None:
        """[bit/s] of the data phase of CAN FD, None for a classic bus."""

    @property
    def simulator(self) -> _SimulatorKeys:
        """Its faults, and the frames that the master's queue holds."""


def wire_of(options: CanOptions, truths: Sequence[AxisModel]) -> tuple[CanTiming, CanFaultPlan]:
    """Return the time that frames take on a bus, and what goes wrong on it."""
    seed = truths[0].seed[:1] if truths else ()
    plan = CanFaultPlan(options.simulator.faults, seed)
    return CanTiming(options.bitrate, options.data_bitrate), plan


def listed(bus: BusSpec, key: str, known: Mapping[int, Device]) -> list[Device]:
    """Return the device of each axis, by its id.

    Raises
    ------
    ConfigError
        `options.key` does not list one.
    """
    for spec in bus.axes:
        if spec.device_id not in known:
            raise ConfigError(
                f"bus {bus.name}: {spec.name} has id {spec.device_id}, which options.{key} "
                "does not list; add it there"
            )
    return [known[spec.device_id] for spec in bus.axes]
