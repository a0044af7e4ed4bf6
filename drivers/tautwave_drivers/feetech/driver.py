"""The driver the loop sees: Feetech servos of the STS, SMS and HLS series on one line.

A command that `write` takes goes out first in the next `request`, followed by the sync read of that
cycle's samples, and acts from there on: one whole period, the declared command delay. On HLS an
effort is a current; on STS and SMS a voltage, by the supply that each servo last measured, and the
motor's back-EMF is damping of the axis. Followers take positions.

No servo of these notices that the host has stopped. What shows in every cycle that one was switched
off and on is read with the samples: torque, torque limit, lock and goal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from tautwave.contracts import BusSpec, BytePort, Clock, Row
from tautwave.driver_base import DriverBase
from tautwave.errors import DriverError
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.adapter import USB_S, set_latency_timer
from tautwave_drivers.causes import wrong_text
from tautwave_drivers.echo import Unechoed
from tautwave_drivers.feetech import tables
from tautwave_drivers.feetech.bringup import AGAIN, Bringup, Found
from tautwave_drivers.feetech.enabling import Enabling
from tautwave_drivers.feetech.exchange import Exchange, Goals, Sample, Timing
from tautwave_drivers.feetech.keeper import Keeper
from tautwave_drivers.feetech.leaving import leave, leave_again, stop_packet
from tautwave_drivers.feetech.line import ServoLine, refuse_another_master
from tautwave_drivers.feetech.options import FeetechOptions, Servo, match_servos
from tautwave_drivers.feetech.tables import status_text
from tautwave_drivers.recorded import (
    MOTOR_EFFORT,
    MOTOR_TEMPERATURE,
    SUPPLY_VOLTAGE,
    read_by,
)
from tautwave_drivers.serial_port import SerialPort

NAN = math.nan
MISSING = JointState(0.0, NAN, NAN, False, 0)
COLUMNS = (
    read_by(MOTOR_EFFORT, lambda axis, sample: axis.motor_effort(sample)),
    read_by(SUPPLY_VOLTAGE, lambda axis, sample: sample.voltage * tables.VOLT),
    read_by(MOTOR_TEMPERATURE, lambda axis, sample: sample.temperature),
)
VALUES = [one.value for one in COLUMNS if one.value is not None]
UNHEARD = 10
"""Samples in a row that show another goal than was sent, which is then no lost packet."""


class Axis:
    """One servo between two exchanges: its counts, and what it has to hold."""

    def __init__(self, servo: Servo) -> None:
        self.servo = servo
        self.fault = ""
        self.unheard = 0
        self._speed = tables.COARSE
        self.limit = 0
        self.supply = -1
        self.take_supply(round(servo.supply_v / tables.VOLT))

    def take(self, found: Found) -> None:
        """Take what bring-up found and set."""
        self.fault = ""
        self.unheard = 0
        self._speed = found.speed
        self.limit = found.limit
        self.take_supply(round(found.volts / tables.VOLT))

    def take_supply(self, counts: int) -> None:
        """Take the supply that the servo measured, by which a voltage is an effort."""
        if counts == self.supply:
            return
        self.supply = counts
        servo = self.servo
        self.scale = scale = servo.scale(max(counts, 1) * tables.VOLT)
        self.most = 0
        if servo.impedance:
            most = math.floor(min(servo.axis.effort_limit / scale.effort, 1e9) + 1e-9)
            self.most = min(most, servo.table.most)

    def state(self, sample: Sample) -> JointState:
        """Return what a sample says, SI."""
        scale = self.scale
        position = scale.position_of(signed(sample.position, 15))
        speed = signed(sample.speed, 15) * self._speed * scale.position * scale.direction
        return JointState(position, speed, NAN, True, 0)

    def motor_effort(self, sample: Sample) -> float:
        """Return the effort of the motor by its current [N m]."""
        return signed(sample.current, 15) * self.scale.current * self.scale.direction

    def judge(self, sample: Sample, goal: int) -> str:
        """Return why a servo that was switched on must not be driven any more, '' while it may.

        `goal` is what its register of the goal has to hold.
        """
        status = sample.error | sample.status
        if status:
            return f"{status_text(status)} (status {status:#04x})"
        if sample.torque != tables.ON:
            return f"{tables.TORQUE} reads {sample.torque} instead of 1: {AGAIN}"
        if sample.torque_limit != self.limit or sample.lock != tables.LOCKED:
            held = (
                (tables.TORQUE_LIMIT, sample.torque_limit, self.limit)
                if sample.torque_limit != self.limit
                else (tables.LOCK, sample.lock, tables.LOCKED)
            )
            return "{} reads {} instead of {}: ".format(*held) + AGAIN
        holds = sample.goal if self.servo.impedance else sample.goal_position
        self.unheard = self.unheard + 1 if holds != goal else 0
        if self.unheard >= UNHEARD:
            return (
                f"its goal reads {holds} instead of the {goal} that it was sent, {UNHEARD} samples "
                "in a row: another program writes to it, or it does not hear; end that program, "
                "check its cable"
            )
        return ""


def signed(held: int, sign: int) -> int:
    """Return the value of sign and magnitude with the sign at a bit."""
    return held if held >> sign == 0 else -(held & (1 << sign) - 1)


class FeetechDriver(DriverBase):
    """Driver of the servos on one line.

    Parameters
    ----------
    options : FeetechOptions
        The bus' options.
    bus : BusSpec
        Its axes.
    clock : Clock
        What waits.
    transport : BytePort, optional
        The line, when it is simulated in this process; else the device in `options.port`.

    Raises
    ------
    ConfigError
        The axes do not go with the servos.
    """

    command_delay = CommandDelay(1, 0.0)

    def __init__(
        self, options: FeetechOptions, bus: BusSpec, clock: Clock, transport: BytePort | None
    ) -> None:
        super().__init__(bus)
        self._options = options
        self._clock = clock
        self._transport = transport
        self._servos = match_servos(options, bus)
        self._axes = [Axis(servo) for servo in self._servos]
        self._ids = [servo.options.id for servo in self._servos]
        self._stop = tables.DAMPED if options.stop == "damped" else tables.OFF
        self._port: Unechoed | None = None
        self._line: ServoLine | None = None
        self._enabling: Enabling | None = None
        self._keeper: Keeper | None = None
        self._surveyed = self._spoken = False
        self._lost = ""
        self._efforts = [at for at, one in enumerate(self._servos) if one.impedance]
        self._places = [at for at, one in enumerate(self._servos) if not one.impedance]
        self._new_goals()
        self.columns = [f"{axis.name}.{one.name}" for axis in bus.axes for one in COLUMNS]
        self.unwatched = {
            servo.axis.name: f"(servo {servo.options.id}) goes on with its last goal, since it has "
            f"no watchdog; cut its power by hand: {options.power_cut.strip()}"
            for servo in self._servos
        }

    def _new_goals(self) -> None:
        """Stage no effort, and no position: followers stay where torque finds them."""
        self._goals = Goals([(self._ids[at], self._servos[at].table.goal) for at in self._efforts])
        self._positions = Goals([(self._ids[at], tables.GOAL_POSITION) for at in self._places])
        self._placed = False

    # -- before the loop --------------------------------------------------------------------

    def _bring_up(self) -> None:
        """Open the line, check and set every servo with its torque off; see `Bringup`."""
        self._lost = ""
        self._spoken = False
        self._new_goals()
        line = self._connect()
        port = self._port
        assert port is not None
        if not self._surveyed:
            refuse_another_master(port, self._clock, self._bus.name)
        self._spoken = True
        line.find_echo()
        if port.echoes:
            self.notes.append(
                f"bus {self._bus.name}: the adapter returns what it sends; those bytes are dropped"
            )
        everyone = self._ids if self._surveyed else line.ping_all()
        bringup = Bringup(line, self._options, self._bus, self.notes)
        for axis, identity in zip(self._axes, bringup.run(self._servos, everyone), strict=True):
            axis.take(identity)
        self._surveyed = True
        self.identities.update(bringup.identities)
        self._exchange = Exchange(port, self._clock, self._ids, self._timing())
        self._try_reading()
        bringup.verify(self._servos)
        self.unwatched = bringup.unwatched
        if hasattr(port, "fileno"):
            stop = stop_packet(self._stop)
            self._keeper = Keeper(port.fileno(), stop, self._options.host_watchdog_s)
            self.notes.append(
                f"bus {self._bus.name}: a process beside this one switches all servos off after "
                f"{self._options.host_watchdog_s:g} s without a cycle, and at once if this one is "
                "killed; nothing does if the machine stops or the cable is pulled"
            )

    def _timing(self) -> Timing:
        options = self._options
        delay_s = options.return_delay_s + options.turn_around_s
        return Timing(options.baud, delay_s, options.latency_s)

    def _connect(self) -> ServoLine:
        self._port = Unechoed(self._open_port())
        options = self._options
        self._line = ServoLine(self._port, self._clock, options.baud, options.latency_s)
        return self._line

    def _open_port(self) -> BytePort:
        if self._transport is not None:
            return self._transport
        path = self._options.port
        if path == "sim":
            raise DriverError(
                f"bus {self._bus.name}: port: sim needs simulated servos, but this rig has none; "
                "add a simulation block, or name a device"
            )
        given_s = self._options.usb_latency_s
        note = set_latency_timer(path, USB_S if given_s is None else given_s)
        if note:
            self.notes.append(note)
        try:
            return SerialPort(path, self._options.baud)
        except DriverError as err:
            raise DriverError(f"bus {self._bus.name}: {err}") from err

    def attach(self, port: BytePort) -> None:
        """Take a line with servos taken for enabled, without a packet: to measure a cycle."""
        self._port = Unechoed(port)
        self._line = ServoLine(self._port, self._clock, self._options.baud, 0.0)
        self._exchange = Exchange(self._port, self._clock, self._ids, self._timing())
        for axis in self._axes:
            axis.limit = tables.FULL_TORQUE
        self._opened = self._on = True

    def _try_reading(self) -> None:
        """Read once as every cycle will: SCS and some firmware have no sync read."""
        exchange = self._exchange
        for _ in range(3):
            now = self._clock.now_ns()
            exchange.send(b"", now)
            if not exchange.collect(now + round(1e9 * (self._options.latency_s + 0.03))):
                exchange.on_wire = exchange.takes_wire_time(self._clock.now_ns())
                if not exchange.on_wire:
                    self.notes.append(
                        f"bus {self._bus.name}: answers come faster than {self._options.baud} baud "
                        "allows, so this is not a real line; late ones cannot be distinguished"
                    )
                return
        silent = [
            f"{servo.axis.name} (servo {servo.options.id})"
            for servo, sample in zip(self._servos, exchange.samples, strict=True)
            if sample is None
        ]
        wrong = "; ".join(self.misses.values())
        raise DriverError(
            f"bus {self._bus.name}: no answer to a sync read from {', '.join(silent)}"
            + (f": {wrong}" if wrong else "; check cables, and that no id is used twice")
        )

    def _enable(self) -> bool:
        """Switch torque on and verify it, packet by packet."""
        self._feed()
        if self._on:
            return True
        assert self._port is not None
        if self._enabling is None:
            limits = [axis.limit for axis in self._axes]
            self._enabling = Enabling(self._port, self._clock, self._servos, limits, self._bus)
        self._on = self._enabling.step()
        return self._on

    def _feed(self) -> None:
        """Tell the process beside this one that the run goes on."""
        if self._keeper is not None and not self._keeper.feed():
            self._keeper.end()
            self._keeper = None
            text = "the process that stops the servos if this one is killed has ended; run again"
            self._faults.append(Fault("", text, fatal=True))

    @property
    def misses(self) -> dict[str, str]:
        """What came instead of the samples of an axis, as text."""
        if self._port is None:
            return {}
        texts = map(wrong_text, self._exchange.wrong)
        causes = zip(self._servos, texts, strict=True)
        return {one.axis.name: f"servo {one.options.id}: {text}" for one, text in causes if text}

    # -- every cycle ----------------------------------------------------------------------

    def request(self) -> None:
        """Send the staged goals and request the samples."""
        if self._port is None or self._lost:
            return
        if self._on:
            self._feed()
        try:
            self._exchange.send(self._packet() if self._on else b"", self._clock.now_ns())
        except DriverError as err:
            self._lose(err)

    def _packet(self) -> bytes:
        packet = self._goals.packet() if self._efforts else b""
        return packet + self._positions.packet() if self._placed else packet

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the measured states; not valid where no answer came by the deadline."""
        if self._port is None or self._lost:
            return [MISSING] * len(self._axes)
        try:
            self._exchange.collect(deadline_ns)
        except DriverError as err:
            self._lose(err)
            return [MISSING] * len(self._axes)
        samples = self._exchange.samples
        if self._on:
            self._judge(samples)
        return [
            MISSING if sample is None or axis.fault else axis.state(sample)
            for axis, sample in zip(self._axes, samples, strict=True)
        ]

    def _judge(self, samples: Sequence[Sample | None]) -> None:
        """Check that each servo is still as it was set, and how high its supply is."""
        for some, goals in ((self._efforts, self._goals), (self._places, self._positions)):
            for place, at in enumerate(some):
                axis, sample = self._axes[at], samples[at]
                if sample is None or axis.fault:
                    continue
                goal = goals.held[place]
                if not axis.servo.impedance and not self._placed:
                    goal = sample.goal_position
                text = axis.judge(sample, goal)
                if text:
                    axis.fault = f"servo {axis.servo.options.id}: {text}"
                    self._faults.append(Fault(axis.servo.axis.name, axis.fault, fatal=True))
                elif axis.servo.by_voltage:
                    axis.take_supply(sample.voltage)

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Stage one command per axis for the next request."""
        for place, at in enumerate(self._efforts):
            axis = self._axes[at]
            effort = 0.0 if axis.fault else commands[at].effort
            self._goals.put(place, axis.scale.goal_of(effort, axis.most))
        places = [commands[at].position for at in self._places]
        if places and all(map(math.isfinite, places)):
            for place, (at, position) in enumerate(zip(self._places, places, strict=True)):
                self._positions.put(place, self._axes[at].scale.counts_of(position))
            self._placed = True

    def witness(self, name: str) -> tuple[float, float]:
        """Return velocity [rad/s] and motor effort [N m] that a servo reports; NaN: no answer."""
        at = [servo.axis.name for servo in self._servos].index(name)
        sample = self._exchange.samples[at] if self._port is not None else None
        if sample is None:
            return NAN, NAN
        axis = self._axes[at]
        return axis.state(sample).velocity, axis.motor_effort(sample)

    def fill(self, row: Row, at: int) -> None:
        """Record motor effort [N m], supply [V] and temperature [degC]; NaN: no sample."""
        here = self._port is not None and not self._lost
        samples = self._exchange.samples if here else [None] * len(self._axes)
        for axis, sample in zip(self._axes, samples, strict=True):
            for value in VALUES:
                row[at] = NAN if sample is None else value(axis, sample)
                at += 1

    # -- afterwards -----------------------------------------------------------------------

    def disable(self) -> None:
        """Goals to zero, torque off in all that is on the line; a lost line is left alone."""
        if self._port is None or self._line is None:
            return
        was_on = self._on or self._enabling is not None
        self._on = False
        self._enabling = None
        if not was_on:
            if self._spoken and not self._lost:
                self._spoken = False
                self._line.tell(stop_packet(self._stop))
            return
        self._spoken = False
        why = self._lost or "torque off was not sent"
        self.unconfirmed = dict.fromkeys((servo.axis.name for servo in self._servos), why)
        if not self._lost:
            for place in range(len(self._efforts)):
                self._goals.put(place, 0)
            self._placed = False
            self.unconfirmed = leave(self._line, self._packet(), self._servos, self._stop)
        if self._keeper is not None and not self.unconfirmed:
            self._keeper.rest()

    def _end(self) -> None:
        if self._port is not None and self.unconfirmed:
            self.unconfirmed = leave_again(
                self._clock, self._again, self._servos, self._stop, self.unconfirmed
            )

    def _again(self) -> ServoLine:
        """Return the line, opened anew if it was lost."""
        if self._lost and self._transport is None and self._port is not None:
            if self._keeper is not None:  # it has the line open, exclusively, as long as it lives
                self._keeper.end(stop=True)
                self._keeper = None
            self._port.close()
            echoes = self._port.echoes
            self._connect()
            self._port.echoes = echoes
        assert self._line is not None
        return self._line

    def _release(self) -> None:
        self._enabling = None
        keeper, self._keeper = self._keeper, None
        if keeper is not None:
            keeper.end()
        port, self._port = self._port, None
        if port is not None and self._transport is None:
            port.close()

    def _lose(self, err: DriverError) -> None:
        """Report once that the line is lost; the loop then stops passively."""
        self._lost = str(err)
        self._faults.append(Fault("", self._lost, fatal=True))
