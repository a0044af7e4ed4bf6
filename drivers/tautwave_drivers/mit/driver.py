"""The driver the loop sees: MIT motors on one bus, each command a request and each answer a sample.

A command that `write` takes goes out in the next `request`; the motor measures itself when it gets
it, follows it from there on, and answers: one whole period, the declared command delay. The frame
can also carry a spring, which is zero, and a damper, which is that of the options: it acts between
samples, and no code of a velocity is zero, so what it pushes at rest is taken off the torque.

Answers carry no sequence number. One that came when its cycle was over is dropped before the next
request, one that comes sooner after a request than the wire allows answers an older one. Every
answer has the motor's state, which a power cycle changes: a motor that is not enabled is not driven
any more.
"""

from __future__ import annotations

import math
import socket
from collections.abc import Sequence
from typing import Any

from tautwave.columns import Column
from tautwave.contracts import BusSpec, Clock, FramePort
from tautwave.driver_base import DriverBase
from tautwave.errors import DeviceFault, DriverError
from tautwave.traffic import tapped
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.can.batches import Frame
from tautwave_drivers.can.exchange import Exchange
from tautwave_drivers.can.framing import Framing
from tautwave_drivers.can.full_queue import queue_remedy
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.can.raw import RawPort
from tautwave_drivers.causes import wrong_text
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.axis import ABOUT_REGISTERS, MISSING, OF_ANOTHER, OUTDATED, Axis
from tautwave_drivers.mit.bringup import Bringup, timeout_counts
from tautwave_drivers.mit.enabling import Enabling
from tautwave_drivers.mit.leaving import leave, leave_again
from tautwave_drivers.mit.options import MitOptions, motors_of
from tautwave_drivers.mit.registers import Registers
from tautwave_drivers.recorded import (
    DRIVER_TEMPERATURE,
    MOTOR_EFFORT,
    ROTOR_TEMPERATURE,
    read_by,
)

REPORTED = (
    read_by(MOTOR_EFFORT, lambda axis: axis.torque if axis.fresh else math.nan),
    read_by(DRIVER_TEMPERATURE, lambda axis: axis.temperatures[0] if axis.fresh else math.nan),
    read_by(ROTOR_TEMPERATURE, lambda axis: axis.temperatures[1] if axis.fresh else math.nan),
)
DAMPED = (
    Column(
        "damper_absorbed",
        "J",
        "taken so far by the damper in the motor, as the motor reports its torque",
        lambda damper: damper.absorbed,
    ),
    Column(
        "damper_least",
        "J",
        "taken so far by the damper in the motor, at least, by its model",
        lambda damper: damper.least,
    ),
)

SHORTEST_BITS = 108
"""Of a classic frame with 8 bytes, without a stuffed bit and the pause after it."""
SHORTEST_FD = 27, 92
"""The same of an FD frame, at the nominal and at the data rate."""
WINDOW_S = 1.0
DAMPER_FAILED = (
    "its damper takes far less than it should, so walls that rely on it are not what was "
    "certified; check whether the motor limits its torque (supply, temperature), and damping"
)
KEEP_ALIVE_SHARE = 0.25
"""Share of the motors' watchdog between two frames while other buses are enabling."""


def shortest_ns(options: MitOptions) -> int:
    """Return the least time on the wire of a command and its answer [ns]."""
    if options.data_bitrate is None:
        return round(2e9 * SHORTEST_BITS / options.bitrate)
    nominal, fast = SHORTEST_FD
    return round(2e9 * (nominal / options.bitrate + fast / options.data_bitrate))


class MitDriver(DriverBase):
    """Driver of the MIT motors on one CAN bus.

    Parameters
    ----------
    options : MitOptions
        The bus' options.
    bus : BusSpec
        Its axes.
    clock : Clock
        What waits.
    transport : FramePort, socket or None
        The simulated bus, or a datagram socket that carries SocketCAN's frames; None to open the
        real one in `open`.

    Raises
    ------
    ConfigError
        The axes do not go with the motors.
    """

    command_delay = CommandDelay(1, 0.0)

    def __init__(self, options: MitOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        super().__init__(bus)
        self._options = options
        self._clock = clock
        self._now = clock.now_ns
        self._transport = transport
        self._motors = motors_of(options, bus)
        period = 1.0 / bus.rate_hz
        pairs = zip(bus.axes, self._motors, strict=True)
        self._axes = [Axis(spec, motor, period) for spec, motor in pairs]
        self._commands = [(at, axis.motor.id, axis.command) for at, axis in enumerate(self._axes)]
        self._samples = [axis.joint_state for axis in self._axes]
        self._damped = [axis for axis in self._axes if axis.damper is not None]
        self._numbers = [motor.id for motor in self._motors]
        self._by_id = {axis.motor.feedback_id: axis for axis in self._axes}
        self._exchange: Exchange | None = None
        self._enabling: Enabling | None = None
        self._armed: list[int | None] = [timeout_counts(options)] * len(self._axes)
        self._efforts = [0.0] * len(self._axes)
        self._wanted: list[bool] | None = None
        """Whether each motor is to damp, where that is commanded; None: as the options say."""
        if any(motor.damped == "at_wall" for motor in self._motors):
            self._wanted = [True] * len(self._axes)
        self._over = False
        """The cycle that answers are taken in for is over."""
        self._earliest_ns = 0
        """Before that no answer to this cycle's requests can be there."""
        self._shortest_ns = 0
        self._window = max(2, round(WINDOW_S * bus.rate_hz))
        self._cycle = 0
        self._failure: DriverError | None = None
        seconds = timeout_counts(options) * damiao.TIMEOUT_S
        self.watchdog_s = {axis.name: seconds for axis in bus.axes}
        for axis in self._axes:
            self.record(axis.spec.name, axis, REPORTED)
        for axis in self._damped:
            self.record(axis.spec.name, axis.damper, DAMPED)

    # -- before and after ---------------------------------------------------------------------

    def _bring_up(self) -> None:
        """Open the bus, check and set every motor with its torque off; see `Bringup`."""
        port = self._connect()
        self._attach(port)
        registers = Registers(port, self._clock)
        motors = Bringup(registers, self._options, self._bus, self.notes).run(self._motors)
        self._classic(port)
        listen: Any = getattr(port, "listen", None)
        if listen is not None:  # until here anybody may have answered
            listen(tuple(self._by_id))
        for axis, one in zip(self._axes, motors, strict=True):
            axis.rescale(one.scale)
            self.identities[axis.spec.name] = one.identity
        names = [axis.name for axis in self._bus.axes]
        self.watchdog_s = {
            name: one.watchdog_s
            for name, one in zip(names, motors, strict=True)
            if one.watchdog_s is not None
        }
        self.unwatched = {
            name: one.unwatched for name, one in zip(names, motors, strict=True) if one.unwatched
        }
        counts = timeout_counts(self._options)
        self._armed = [None if one.watchdog_s is None else counts for one in motors]
        self._shortest_ns = shortest_ns(self._options)
        if registers.quickest_ns is not None and registers.quickest_ns < self._shortest_ns:
            self._shortest_ns = 0
            self.notes.append(
                f"bus {self._bus.name}: answers come faster than the bit rate allows, so this is "
                "not a real wire; late ones cannot be distinguished"
            )

    def _classic(self, port: FramePort) -> None:
        """Refuse motors that answer in classic CAN on a bus of FD."""
        classic = getattr(port, "classic_ids", ())
        wrong = [f"{a.spec.name} ({a.label})" for a in self._axes if a.motor.feedback_id in classic]
        if wrong:
            raise DriverError(
                f"bus {self._bus.name}: {', '.join(wrong)} answered in classic CAN to CAN FD; set "
                f"{damiao.CAN_RATE} to 9 (5 Mbit/s) in the maker's tool, or remove data_bitrate"
            )

    def _connect(self) -> FramePort:
        framing = Framing(self._options.data_bitrate)
        if isinstance(self._transport, socket.socket):
            return RawPort(self._transport.dup(), self._clock, self._bus.name, framing)
        if self._transport is not None:
            port: FramePort = self._transport
            return port
        try:
            port = open_port(self._options, self._clock, framing)
            tap: FramePort = tapped(self._bus.name, port, self._clock)
            return tap
        except DriverError as err:
            raise DriverError(f"bus {self._bus.name}: {err}") from err

    def _attach(self, port: FramePort) -> None:
        for axis in self._axes:
            axis.reset()
        self._failure = None
        self._efforts = [0.0] * len(self._axes)
        self._exchange = Exchange(port, self._clock, self._hear, queue_remedy(self._options))

    def attach(self, port: FramePort) -> None:
        """Take a port with motors taken for enabled, without a frame: to measure a cycle."""
        self._attach(port)
        self._opened = self._on = True

    def _enable(self) -> bool:
        """Switch torque on and verify it; then keep the watchdogs fed."""
        assert self._exchange is not None
        if self._enabling is None:
            self._enabling = Enabling(
                self._exchange,
                self._clock,
                self._axes,
                self._armed,
                self._bus,
                max(
                    round(KEEP_ALIVE_SHARE * self._options.watchdog_s * 1e9),
                    2 * self._bus.period_ns,
                ),
            )
        done = self._enabling.step()
        if self._failure is not None:
            raise self._failure
        self._on = self._on or done
        return done

    # -- the cycle ----------------------------------------------------------------------------

    def _hear(self, frames: Sequence[Frame]) -> int:
        """Take frames; return how many were answers that are missing in this cycle."""
        find, earliest_ns, over = self._by_id.get, self._earliest_ns, self._over
        answers = 0
        for can_id, data, arrival_ns in frames:
            axis = find(can_id)
            if axis is None:
                assert self._exchange is not None
                self._exchange.strange(can_id, data)
            elif arrival_ns < earliest_ns:
                if damiao.feedback(data, axis.motor.id) is not None:
                    axis.late += 1
                    axis.miss(OUTDATED)
            elif axis.take(data, arrival_ns):
                if axis.fresh:
                    continue
                if over:
                    axis.late += 1
                    axis.miss(OUTDATED)
                else:
                    axis.fresh = True
                    answers += 1
            else:
                self._hear_other(axis, data)
        return answers

    def _hear_other(self, axis: Axis, data: bytes) -> None:
        """Take a frame on the id of a motor's feedback that is not feedback."""
        about = len(data) == 8 and damiao.is_parameter(data)
        axis.miss(ABOUT_REGISTERS if about else OF_ANOTHER)
        if self._enabling is not None and not self._on:
            try:
                self._enabling.heard(self._axes.index(axis), data)
            except DeviceFault as err:
                self._failure = err

    def request(self) -> None:
        """Send every motor its command, which is the request of its sample."""
        exchange = self._exchange
        if exchange is None:
            return
        self._over = True
        ready = exchange.begin()
        self._over = False
        for axis in self._axes:
            if axis.fresh and axis.wrong:
                axis.wrong.clear()
            axis.fresh = False
        self._cycle += 1
        if not self._on:  # it is asked by being switched off again
            self._earliest_ns = 0
            if ready:
                exchange.ask([(number, damiao.DISABLE) for number in self._numbers])
            return
        self._earliest_ns = self._now() + self._shortest_ns
        if ready:
            efforts, damped = self._efforts, self._wanted
            if damped is None:
                frames = [(number, command(efforts[at])) for at, number, command in self._commands]
            else:
                frames = [
                    (number, command(efforts[at], damped[at]))
                    for at, number, command in self._commands
                ]
            exchange.ask(frames)

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the measured states; not valid where no answer came by the deadline."""
        exchange = self._exchange
        if exchange is None:
            return [MISSING] * len(self._axes)
        exchange.collect(deadline_ns)
        if self._on:
            self._judge(exchange)
        now = self._now()
        return [sample(now) for sample in self._samples]

    def _judge(self, exchange: Exchange) -> None:
        """See whether each motor is still as it was set."""
        if exchange.lost:
            for axis in self._axes:
                axis.fault = axis.fault or exchange.lost
            if not self._failure:
                self._failure = DriverError(exchange.lost)
                self._faults.append(Fault("", exchange.lost, fatal=True))
            return
        for axis in self._damped:
            axis.book()
        enabled = damiao.ENABLED
        for axis in self._axes:
            if axis.state == enabled or not axis.fresh or axis.fault:
                continue
            text = axis.judge()
            if text:
                axis.fault = text
                self._faults.append(Fault(axis.spec.name, f"{axis.label}: {text}", fatal=True))
        if exchange.told:
            self._faults += [Fault("", text, fatal=False) for text in exchange.reports()]
        if self._cycle % self._window == 0:
            for axis in self._axes:
                if 2 * axis.late > self._window:
                    exchange.report(
                        f"{axis.label}: most of the last {self._window} answers came when their "
                        "cycle was over; check the bus load and the rate"
                    )
                axis.late = 0
            for axis in self._damped:
                if axis.damper is not None and axis.damper.lacks() and not axis.fault:
                    axis.fault = DAMPER_FAILED
                    text = f"{axis.label}: {DAMPER_FAILED}"
                    self._faults.append(Fault(axis.spec.name, text, fatal=True))

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Stage one command per axis for the next request."""
        self._efforts = [command[0] for command in commands]  # their efforts
        if self._wanted is not None:
            self._wanted = [
                motor.damped == "always" or command.damping > 0.0
                for motor, command in zip(self._motors, commands, strict=True)
            ]

    @property
    def misses(self) -> dict[str, str]:
        """What came instead of the sample of an axis, as text."""
        return {
            axis.spec.name: f"{axis.label}: {wrong_text(axis.wrong)}"
            for axis in self._axes
            if axis.wrong and not axis.fresh
        }

    def witness(self, name: str) -> tuple[float, float]:
        """Return velocity [rad/s] and torque [N m] that a motor reports; NaN: no answer."""
        (axis,) = (axis for axis in self._axes if axis.spec.name == name)
        return (axis.velocity, axis.torque) if axis.fresh else (math.nan, math.nan)

    # -- the end ------------------------------------------------------------------------------

    def disable(self) -> None:
        """Torque zero, then off, until each motor says that it is."""
        exchange = self._exchange
        if exchange is None or not (self._on or self._enabling is not None):
            return
        self._on = False
        self._enabling = None
        self._efforts = [0.0] * len(self._axes)
        self.unconfirmed = dict.fromkeys(self._names(), exchange.lost or "disable was not sent")
        if not exchange.lost:
            self.unconfirmed = leave(exchange.port, self._clock, self._axes)

    def _end(self) -> None:
        if self._exchange is not None and self.unconfirmed:
            self.unconfirmed = leave_again(
                self._clock, self._reconnect, self._axes, self.unconfirmed
            )

    def _reconnect(self) -> FramePort:
        """Return the port, opened anew if it was lost."""
        exchange = self._exchange
        assert exchange is not None
        if exchange.lost and exchange.port is not self._transport:
            exchange.port.close()
            self._exchange = exchange = Exchange(
                self._connect(), self._clock, self._hear, queue_remedy(self._options)
            )
        return exchange.port

    def _release(self) -> None:
        self._enabling = None
        exchange, self._exchange = self._exchange, None
        if exchange is not None and exchange.port is not self._transport:
            exchange.port.close()

    def _names(self) -> list[str]:
        return [axis.spec.name for axis in self._axes]
