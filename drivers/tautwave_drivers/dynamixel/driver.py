"""The driver the loop sees: Dynamixel X servos on one line.

A command that `write` takes goes out first in the next `request`, with the question for that
cycle's sample behind it, and acts from there on: one whole period, the declared command delay.
Impedance axes run in current mode: effort = goal current * torque constant * gear ratio. Admittance
axes run in velocity mode and measure effort as motor current (see `units`).

What is simulated agrees on this: torque is switched on with the goals at zero; slot 0 is the first
sync read after that; a sync write and the sync read behind it belong to one slot, the goals act
from it on.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence

from tautwave.contracts import BusSpec, BytePort, Clock
from tautwave.errors import DriverError
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.dynamixel import packet
from tautwave_drivers.dynamixel import registers as reg
from tautwave_drivers.dynamixel.bringup import Bringup, Limits
from tautwave_drivers.dynamixel.budget import STATUS_BLOCK
from tautwave_drivers.dynamixel.enabling import Enabling
from tautwave_drivers.dynamixel.exchange import Exchange, Goals
from tautwave_drivers.dynamixel.ftdi import set_latency_timer
from tautwave_drivers.dynamixel.indirect import map_status_block
from tautwave_drivers.dynamixel.line import Line, OwnLine
from tautwave_drivers.dynamixel.options import DynamixelOptions, match_servos
from tautwave_drivers.dynamixel.port import SerialPort
from tautwave_drivers.dynamixel.units import CURRENT_RANGE, scale_of
from tautwave_drivers.dynamixel.watching import Watch

NAN = float("nan")
MISSING = JointState(0.0, NAN, NAN, False, 0)
FEED_SHARE = 0.25
"""Of the bus watchdog's time, between two packets while other buses are still enabling."""


class DynamixelDriver:
    """Driver of the servos on one line.

    Parameters
    ----------
    options : DynamixelOptions
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
        self, options: DynamixelOptions, bus: BusSpec, clock: Clock, transport: BytePort | None
    ) -> None:
        self._options = options
        self._bus = bus
        self._clock = clock
        self._given = transport
        self._servos = match_servos(options, bus)
        self._scales = [scale_of(servo) for servo in self._servos]
        self._ids = [servo.options.id for servo in self._servos]
        self._limits = [Limits(0, 0)] * len(self._servos)
        self._port: BytePort | None = None
        self._enabling: Enabling | None = None
        self._on = False
        self._sent_ns = 0
        self._gone = ""
        self._faults: list[Fault] = []
        self.notes: list[str] = []

    # -- before the loop --------------------------------------------------------------------

    def open(self) -> None:
        """Open the line, check and set every servo with its torque off; see `Bringup`."""
        self.close()
        self._gone = ""
        self._faults.clear()
        self.notes = []
        port = self._port = self._open_port()
        try:
            self._line = OwnLine(port, self._clock, self._options.baud, self._options.latency_s)
            slow: Line = self._line
            if self._options.transport == "sdk":
                from tautwave_drivers.dynamixel.sdk import SdkLine

                slow = SdkLine(port, self._clock, self._options.baud, self._options.latency_s)
            bringup = Bringup(slow, self._options, self._bus)
            bringup.notes = self.notes
            self._limits = bringup.run(self._servos, self._scales)
            if self._options.status_block:
                map_status_block(slow, self._servos)
            self._build(port)
            self._try_reading()
            for servo in self._servos:
                bringup.arm(servo)
        except BaseException:
            self.close()
            raise

    def _open_port(self) -> BytePort:
        if self._given is not None:
            return self._given
        path = self._options.port
        if path == "sim":
            raise DriverError(
                f"bus {self._bus.name}: port: sim has no servos here; add a simulation block to "
                "the rig, or name a device"
            )
        note = set_latency_timer(path, self._options.latency_s)
        if note:
            self.notes.append(note)
        return SerialPort(path, self._options.baud)

    def _build(self, port: BytePort) -> None:
        """Make what every cycle uses."""
        options = self._options
        status = options.status_block
        self._exchange = Exchange(
            port,
            self._clock,
            self._ids,
            reg.PRESENT.address if not status else self._servos[0].model.indirect_data,
            reg.PRESENT.size if not status else STATUS_BLOCK,
            fast=options.read == "fast_sync",
            baud=options.baud,
            return_delay_s=options.return_delay_s,
            latency_s=options.latency_s,
        )
        self._goals: list[Goals] = []
        self._staged: list[tuple[Goals, int]] = []
        groups = {
            True: (reg.GOAL_CURRENT, [s.options.id for s in self._servos if s.impedance]),
            False: (reg.GOAL_VELOCITY, [s.options.id for s in self._servos if not s.impedance]),
        }
        made = {kind: Goals(register, ids) for kind, (register, ids) in groups.items() if ids}
        self._goals = list(made.values())
        places = {True: 0, False: 0}
        for servo in self._servos:
            self._staged.append((made[servo.impedance], places[servo.impedance]))
            places[servo.impedance] += 1
        self._watch = Watch(self._line, self._clock, self._servos, self._bus, options)

    def attach(self, port: BytePort) -> None:
        """Take a line as it is, enabled, without asking any servo: to measure a cycle."""
        self._line = OwnLine(port, self._clock, self._options.baud, self._options.latency_s)
        self._limits = [Limits(CURRENT_RANGE, CURRENT_RANGE)] * len(self._servos)
        self._port = port
        self._build(port)
        self._watch.began(self._clock.now_ns())
        self._on = True

    def detach(self) -> None:
        """Release such a line, saying nothing to any servo."""
        self._on = False
        port, self._port = self._port, None
        if port is not None:
            port.close()

    def _try_reading(self) -> None:
        """Read once as every cycle will: old firmware knows no fast sync read."""
        exchange = self._exchange
        for _ in range(3):
            exchange.send()
            until = self._clock.now_ns() + round(1e9 * (self._options.latency_s + 0.03))
            if not exchange.collect(until):
                return
        silent = [
            f"{servo.axis.name} (servo {servo.options.id})"
            for servo, data in zip(self._servos, exchange.data, strict=True)
            if data is None
        ]
        remedy = "check its cable, and that no id is used twice"
        if self._options.read == "fast_sync":
            remedy = "its firmware may be too old for a fast sync read: use read: sync"
        raise DriverError(
            f"bus {self._bus.name}: no answer to a {self._options.read.replace('_', ' ')} read "
            f"from {', '.join(silent)}; {remedy}"
        )

    def enable_step(self) -> bool:
        """Switch torque on and see that it is, a packet at a time; then keep the watchdogs fed."""
        port = self._port
        if port is None:
            raise DriverError(f"bus {self._bus.name}: enabled before it was opened")
        now = self._clock.now_ns()
        if self._on:
            if now - self._sent_ns > FEED_SHARE * 1e9 * self._options.watchdog_s:
                port.write(self._torque(1))
                self._sent_ns = now
            return True
        if self._enabling is None:
            self._zero_goals()
            port.write(self._packed_goals() + self._torque(1))
            self._enabling = Enabling(port, self._clock, self._servos, self._bus)
            return False
        self._on = self._enabling.step()
        self._sent_ns = now
        self._watch.began(now)
        return self._on

    # -- every cycle ----------------------------------------------------------------------

    def request(self) -> None:
        """Send the staged goals and ask for the samples."""
        if self._port is None or self._gone:
            return
        try:
            if not self._on:
                self._exchange.send()
                return
            now = self._clock.now_ns()
            self._watch.sends(now)
            self._sent_ns = now
            if self._watch.urgent:
                self._port.write(self._packed_goals())
            else:
                self._exchange.send(self._packed_goals())
        except DriverError as err:
            self._lose(err)

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return what the servos measured; who has not answered by the deadline is not valid."""
        if self._port is None or self._gone:
            return [MISSING] * len(self._servos)
        exchange, watch = self._exchange, self._watch
        try:
            if self._on and watch.urgent:
                watch.ask(deadline_ns, self._faults)
                return [MISSING] * len(self._servos)
            exchange.collect(deadline_ns)
            states = [
                self._state(index, data) if data is not None else MISSING
                for index, data in enumerate(exchange.data)
            ]
            if self._on and (watch.waiting or any(exchange.errors)):
                watch.alerts(exchange.errors)
                watch.ask(deadline_ns, self._faults)
        except DriverError as err:
            self._lose(err)
            return [MISSING] * len(self._servos)
        return states

    def _state(self, index: int, data: bytes) -> JointState:
        scale = self._scales[index]
        current = int.from_bytes(data[0:2], "little", signed=True)
        velocity = int.from_bytes(data[2:6], "little", signed=True)
        position = int.from_bytes(data[6:10], "little", signed=True)
        if len(data) > reg.PRESENT.size:
            self._watch.status(index, data[10], data[11], self._faults)
        direction = scale.direction
        return JointState(
            direction * (position - scale.zero_counts) * scale.position,
            direction * velocity * scale.velocity,
            NAN if self._servos[index].impedance else scale.outside_effort(current),
            True,
            0,
        )

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Stage one command per axis for the next request; ignored while not enabled."""
        if len(commands) != len(self._servos):
            raise DriverError(
                f"dynamixel: {len(commands)} commands for {len(self._servos)} axes; write one "
                "command per axis, in the order of the rig file"
            )
        if not self._on:
            return
        for index, command in enumerate(commands):
            goals, place = self._staged[index]
            scale, limits = self._scales[index], self._limits[index]
            if self._servos[index].impedance:
                goals.put(place, scale.current_counts(command.effort, limits.current))
            else:
                goals.put(place, scale.velocity_counts(command.velocity, limits.velocity))

    def faults(self) -> Sequence[Fault]:
        """Return what servos and line have reported since the last call."""
        if not self._faults:
            return ()
        found, self._faults = self._faults, []
        return found

    # -- afterwards -----------------------------------------------------------------------

    def disable(self) -> None:
        """Goals to zero, torque off, watchdogs off; a line that is gone is left alone."""
        port = self._port
        if port is None or not (self._on or self._enabling is not None):
            return
        self._on = False
        self._enabling = None
        if self._gone:
            return
        self._zero_goals()
        with contextlib.suppress(DriverError):
            port.write(self._packed_goals() + self._torque(0))
            for device_id in self._ids:
                self._line.write(device_id, reg.TORQUE_ENABLE.address, b"\x00")
                self._line.write(device_id, reg.BUS_WATCHDOG.address, b"\x00")

    def close(self) -> None:
        """Disable and release the line; idempotent, never raises."""
        with contextlib.suppress(Exception):
            self.disable()
        self._on = False
        self._enabling = None
        port, self._port = self._port, None
        if port is not None and self._given is None:
            port.close()

    # -- parts ------------------------------------------------------------------------------

    def _packed_goals(self) -> bytes:
        goals = self._goals
        return goals[0].packet() if len(goals) == 1 else b"".join(g.packet() for g in goals)

    def _zero_goals(self) -> None:
        for goals, place in self._staged:
            goals.put(place, 0)

    def _torque(self, on: int) -> bytes:
        pairs = [(device_id, bytes((on,))) for device_id in self._ids]
        return packet.sync_write_packet(reg.TORQUE_ENABLE.address, 1, pairs)

    def _lose(self, err: DriverError) -> None:
        """Note that the line is gone, once; the loop ends the run in its passive way."""
        self._gone = str(err)
        self._faults.append(Fault("", self._gone, fatal=True))
