"""The driver: torque to moteus controllers, a frame for each that commands, asks and watches."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tautwave.plugin import (
    AxisCommand,
    AxisSpec,
    BusSpec,
    Clock,
    Column,
    CommandDelay,
    DriverBase,
    DriverError,
    Fault,
    FramePort,
    JointState,
)
from tautwave_drivers.can.exchange import Exchange
from tautwave_drivers.can.framing import Framing
from tautwave_drivers.can.opening import open_port
from tautwave_example_moteus import frames
from tautwave_example_moteus.options import Device, Options, devices_of

ANSWER_NS = 10_000_000
"""Time for an answer outside of a run."""
TRIES = 3
MAP_VERSION = 5
"""Of the registers that the frames here are for."""
CHECK = "check its supply, its id, the wiring, and that its bit rates are those of the rig"
MISSING = JointState(0.0, math.nan, math.nan, False, 0)


class Axis:
    """One controller between two exchanges: what it last said, and whether in this cycle."""

    def __init__(self, spec: AxisSpec, device: Device) -> None:
        self.spec, self.device = spec, device
        self.reset()

    def reset(self) -> None:
        """Forget what it said."""
        self.said: dict[int, float] = {}
        self.fresh = False
        self.arrived_ns = 0
        self.torque = 0.0
        self.fault = ""
        self.wrong = ""

    def state(self, now_ns: int) -> JointState:
        """Return this cycle's sample; invalid without one, or once the device is in fault."""
        turns = self.said.get(frames.POSITION, math.nan)
        if not self.fresh or self.fault or not math.isfinite(turns):
            return MISSING
        speed = math.tau * self.device.direction * self.said.get(frames.VELOCITY, math.nan)
        place = self.device.direction * (math.tau * turns - self.device.zero)
        return JointState(place, speed, math.nan, True, max(now_ns - self.arrived_ns, 0))

    def command(self, watchdog_s: float) -> bytes:
        """Return the subframes of its torque, within the limit; zero for what is not a number."""
        limit = self.spec.effort_limit
        torque = self.torque if -limit <= self.torque <= limit else 0.0
        if abs(self.torque) > limit:
            torque = math.copysign(limit, self.torque)
        return frames.command(self.device.direction * torque, watchdog_s)

    def judge(self) -> str:
        """Return why a device that was engaged is not, '' while it is."""
        mode = self.said.get(frames.MODE, math.nan)
        if mode == frames.HOLDS_POSITION:
            return ""
        if mode == frames.STOPPED:
            return "stopped: it was switched off and on, or another program stopped it; run again"
        code = int(self.said.get(frames.FAULT, 0.0))
        why = frames.FAULTS.get(code, f"fault {code}") if mode == frames.FAULTED else ""
        name = frames.MODES.get(int(mode), f"mode {mode:g}") if math.isfinite(mode) else "no mode"
        return f"{name}{': ' + why if why else ''}; its torque is off: remove the cause, run again"

    @property
    def effort(self) -> float:
        """Torque of the motor on its axis [N m]; NaN before it said one."""
        return self.device.direction * self.said.get(frames.TORQUE, math.nan)


REPORTED = (
    Column(
        "motor_effort",
        "N m",
        "torque that the controller reports; NaN before the first answer",
        lambda axis: axis.effort,
    ),
)
"""What is recorded of each axis beside its sample."""


def _engaged(axis: Axis) -> bool:
    """Return whether a device was engaged before its last frame, which read its watchdog back."""
    return axis.said.get(frames.MODE) == frames.HOLDS_POSITION and frames.WATCHDOG in axis.said


class MoteusDriver(DriverBase):
    """Drives the controllers of one bus.

    Parameters
    ----------
    options, bus
        The `options` block, and the bus' axes.
    clock : Clock
        What waits.
    transport : FramePort or None
        The bus; None: it is opened by the options.
    """

    command_delay = CommandDelay(1, 0.0)
    """A command is the next cycle's request, and acts when the device gets it."""

    def __init__(
        self, options: Options, bus: BusSpec, clock: Clock, transport: FramePort | None
    ) -> None:
        super().__init__(bus)
        self._options, self._clock, self._given = options, clock, transport
        devices = devices_of(options, bus)
        self._axes = [Axis(spec, one) for spec, one in zip(bus.axes, devices, strict=True)]
        self._ids = [frames.request_id(one.id) for one in devices]
        self._by_answer = {frames.answer_id(axis.device.id): axis for axis in self._axes}
        self._port: FramePort | None = None
        self._exchange: Exchange | None = None
        self.watchdog_s = {axis.spec.name: options.watchdog_s for axis in self._axes}
        self.misses: dict[str, str] = {}
        for axis in self._axes:
            self.record(axis.spec.name, axis, REPORTED)

    # -- bring-up and end ---------------------------------------------------------------------

    def _bring_up(self) -> None:
        options = self._options
        framing = Framing(options.data_bitrate, extended=True, ids=list(self._by_answer))
        self._port = self._given or open_port(options, self._clock, framing)
        self._exchange = Exchange(self._port, self._clock, self._take_frames)
        for axis in self._axes:
            axis.reset()
        self._stop_all()
        if self.unconfirmed:
            who, why = next(iter(self.unconfirmed.items()))
            raise DriverError(f"{who}: controller {self._device(who).id} {why}; {CHECK}")
        for axis in self._axes:
            self._identify(axis)

    def _device(self, name: str) -> Device:
        return next(axis.device for axis in self._axes if axis.spec.name == name)

    def _identify(self, axis: Axis) -> None:
        """Read who it is, and refuse one whose registers may mean something else."""
        self._ask_each([axis], frames.IDENTITY, lambda axis: frames.MAP_VERSION in axis.said)
        version = axis.said.get(frames.MAP_VERSION)
        where = f"{axis.spec.name}: controller {axis.device.id}"
        if version != MAP_VERSION:
            has = "does not say its register map" if version is None else f"has map {version:g}"
            raise DriverError(
                f"{where} {has}; this driver knows {MAP_VERSION}: update its firmware"
            )
        words = [int(axis.said.get(frames.SERIAL + n, 0)) & 0xFFFFFFFF for n in range(3)]
        self.identities[axis.spec.name] = {
            "model": f"{axis.said[frames.MODEL]:g}",
            "firmware": f"{int(axis.said[frames.FIRMWARE]) & 0xFFFFFFFF:#x}",
            "serial": "-".join(f"{word:08x}" for word in words),
        }

    def _enable(self) -> bool:
        """Engage at no torque; on once each says that, and that its watchdog is the rig's."""
        if not self._on:
            self._send(lambda axis: axis.command(self._options.watchdog_s) + frames.READ_WATCHDOG)
            wanted = self._options.watchdog_s
            for axis in self._axes:
                if axis.said.get(frames.MODE) == frames.FAULTED:
                    raise DriverError(f"{axis.spec.name}: {axis.judge()}")
                armed = axis.said.get(frames.WATCHDOG, math.nan)
                if _engaged(axis) and abs(armed - wanted) > 1e-6 * wanted:
                    raise DriverError(f"{axis.spec.name}: watchdog {armed:g} s, not {wanted:g}")
            self._on = all(_engaged(axis) for axis in self._axes)
        else:
            self.request()
        return self._on

    def disable(self) -> None:
        """Stop all, and see who confirms it."""
        was_on, self._on = self._on, False
        for axis in self._axes:
            axis.torque = 0.0
        if self._exchange is not None and (was_on or self.unconfirmed or self._opened):
            self._stop_all()

    def _stop_all(self) -> None:
        if (
            self._exchange is None or not self._exchange.begin()
        ):  # what is still in confirms nothing
            self.unconfirmed = {axis.spec.name: "the bus is lost" for axis in self._axes}
            return
        for axis in self._axes:
            axis.said.pop(frames.MODE, None)
        stopped = lambda axis: axis.said.get(frames.MODE) == frames.STOPPED  # noqa: E731
        # The mode that a frame reads is the one before what it writes: so two frames.
        self._ask_each(self._axes, frames.STOP, lambda axis: False, tries=1)
        self._ask_each(self._axes, frames.STOP + frames.STATE, stopped)
        self.unconfirmed = {
            axis.spec.name: "does not answer" if frames.MODE not in axis.said else "stays engaged"
            for axis in self._axes
            if not stopped(axis)
        }

    def _release(self) -> None:
        if self._port is not None and self._port is not self._given:
            self._port.close()
        self._port = self._exchange = None

    # -- a cycle ------------------------------------------------------------------------------

    def request(self) -> None:
        """Send each its torque, or ask for its state."""
        wait = self._options.watchdog_s
        self._send(lambda a: a.command(wait) if self._on and not a.fault else frames.STATE)

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return what each measured, invalid where it did not answer by the deadline."""
        if self._exchange is not None:
            self._exchange.collect(deadline_ns)
            self._report()
        now_ns = self._clock.now_ns()
        return [axis.state(now_ns) for axis in self._axes]

    def _report(self) -> None:
        assert self._exchange is not None
        for axis in self._axes:
            if not axis.fresh:
                self.misses[axis.spec.name] = axis.wrong or "no answer"
            elif self._on and not axis.fault and (fault := axis.judge()):
                axis.fault = fault
                self._faults.append(Fault(axis.spec.name, f"{axis.spec.name}: {fault}", True))
        self._faults += [Fault("", text, False) for text in self._exchange.reports()]
        if self._exchange.lost:
            self._faults.append(Fault("", self._exchange.lost, True))

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        for axis, one in zip(self._axes, commands, strict=True):
            axis.torque = one.effort

    # -- frames -------------------------------------------------------------------------------

    def _send(self, data: Callable[[Axis], bytes]) -> None:
        """Send each axis a frame that it answers."""
        if self._exchange is None or not self._exchange.begin():
            return
        for axis in self._axes:
            axis.fresh, axis.wrong = False, ""
        pairs = zip(self._ids, self._axes, strict=True)
        self._exchange.ask([(can_id, frames.padded(data(axis))) for can_id, axis in pairs])

    def _ask_each(
        self, axes: Sequence[Axis], data: bytes, done: Callable[[Axis], bool], tries: int = TRIES
    ) -> None:
        """Send a frame to some axes until each is done, a few times; blocks through the clock."""
        assert self._exchange is not None
        for _ in range(tries):
            left = [axis for axis in axes if not done(axis)]
            if not left or not self._exchange.begin():
                return
            ids = [frames.request_id(axis.device.id) for axis in left]
            self._exchange.ask([(can_id, frames.padded(data)) for can_id in ids])
            self._exchange.collect(self._clock.now_ns() + ANSWER_NS)

    def _take_frames(self, received: Sequence[tuple[int, bytes, int]]) -> int:
        """Take frames; return how many missing answers are among them."""
        found = 0
        for can_id, data, arrival_ns in received:
            axis = self._by_answer.get(can_id)
            if axis is None:
                assert self._exchange is not None
                self._exchange.strange(can_id, data)
                continue
            said = frames.parsed(data)
            if said is None:
                axis.wrong = "an answer that is none: another device has its id, or it refuses"
                continue
            axis.said |= said
            axis.arrived_ns = arrival_ns
            found += not axis.fresh
            axis.fresh = frames.MODE in said and frames.POSITION in said
        return found
