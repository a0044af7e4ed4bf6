"""The driver the loop sees: Dynamixel X servos on one line.

A command that `write` takes goes out first in the next `request`, followed by the sync read
of that cycle's samples, and acts from there on: one whole period, the declared command delay.
Impedance axes run in current mode: effort = goal current * torque constant * gear ratio. Admittance
axes run in velocity mode and measure effort as motor current (see `units`). Followers run in
current-based position mode, their goal current the axis' effort limit, or in position mode.

The simulation agrees on this: torque is switched on with the goals at zero; slot 0 is the first
sync read after that; a sync write and the sync read behind it belong to one slot, the goals act
from it on.
"""

from __future__ import annotations

from collections.abc import Container, Sequence

from tautwave.contracts import BusSpec, BytePort, Clock, Row
from tautwave.driver_base import DriverBase
from tautwave.errors import DriverError
from tautwave.traffic import tapped
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.adapter import USB_S, set_latency_timer
from tautwave_drivers.causes import wrong_text
from tautwave_drivers.dynamixel.bringup import Bringup, Limits, watchdog_units
from tautwave_drivers.dynamixel.enabling import Enabling
from tautwave_drivers.dynamixel.exchange import Exchange, Staging, Timing
from tautwave_drivers.dynamixel.fast_path import FIELDS, STATUS_FIELDS
from tautwave_drivers.dynamixel.leaving import leave, leave_again, torque_packet
from tautwave_drivers.dynamixel.line.transactions import Line, PacketLine, Response, ping_all
from tautwave_drivers.dynamixel.listening import refuse_another_master
from tautwave_drivers.dynamixel.options import DynamixelOptions, Servo, match_servos, with_shadows
from tautwave_drivers.dynamixel.protocol import registers as reg
from tautwave_drivers.dynamixel.protocol.models import COUNTS_PER_TURN
from tautwave_drivers.dynamixel.protocol.units import (
    CURRENT_RANGE,
    Scale,
    doubt_of,
    scale_of,
    whole_turns,
)
from tautwave_drivers.dynamixel.state import FORGETS_NS, Errors, Remembered
from tautwave_drivers.dynamixel.watching import Watch
from tautwave_drivers.recorded import MOTOR_EFFORT
from tautwave_drivers.serial_port import SerialPort

COLUMNS = (MOTOR_EFFORT,)
NAN = float("nan")
MISSING = JointState(0.0, NAN, NAN, False, 0)
KEEP_ALIVE_SHARE = 0.25
"""Share of the bus watchdog's time between two packets while other buses are enabling."""


class DynamixelDriver(DriverBase):
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
        super().__init__(bus)
        self._options = options
        self._clock = clock
        self._transport = transport
        self._axes = match_servos(options, bus)
        """The servos of the axes, in their order."""
        self._servos = with_shadows(self._axes)
        self._axis_of = [at for at, _ in enumerate(self._axes)]
        self._axis_of += [at for at, one in enumerate(self._axes) if one.options.shadow is not None]
        count = len(self._axes)
        self._shadows = list(enumerate(self._axis_of[count:], count))
        self._set_scales([scale_of(servo) for servo in self._axes])
        self._surveyed = False
        self._ids = [servo.options.id for servo in self._servos]
        self._limits = [Limits(0, 0)] * len(self._axes)
        self._port: BytePort | None = None
        self._enabling: Enabling | None = None
        self._sent_ns = 0
        self._status_block = options.status_block
        self._marked: Container[int] = ()
        self._armed: list[int | None] = [watchdog_units(options)] * len(self._servos)
        self._held: list[Remembered] = [{} for _ in self._servos]
        self._errors = [Errors(options.tolerated)] * len(self._servos)
        self._first = False
        self._watchdog_ns = round(options.watchdog_s * 1e9)
        self._lost = ""
        self.watchdog_s = {
            axis.name: watchdog_units(options) * reg.WATCHDOG_UNIT_S for axis in bus.axes
        }
        self._torques = [at for at, servo in enumerate(self._axes) if servo.impedance]
        self.columns = [f"{bus.axes[at].name}.{MOTOR_EFFORT.name}" for at in self._torques]
        self._motor_steps = [
            self._scales[at].direction * self._scales[at].effort for at in self._torques
        ]

    def _set_scales(self, scales: Sequence[Scale]) -> None:
        self._scales = scales
        self._units = [_units(*pair) for pair in zip(self._axes, scales, strict=True)]

    # -- before the loop --------------------------------------------------------------------

    def _bring_up(self) -> None:
        """Open the line, check and set every servo with its torque off; see `Bringup`."""
        self._lost = ""
        port = self._port = self._open_port()
        self._line = PacketLine(port, self._clock, self._options.baud, self._options.latency_s)
        slow: Line = self._line
        if self._options.transport == "sdk":
            from tautwave_drivers.dynamixel.line.sdk import SdkLine

            slow = SdkLine(port, self._clock, self._options.baud, self._options.latency_s)
        everyone: list[tuple[int, Response]] = []
        if not self._surveyed:  # it takes most of a second: not again where a run resets a device
            everyone = ping_all(port, self._clock, self._options.baud)
        bringup = Bringup(slow, self._options, self._bus, self.notes, everyone)
        self._set_scales([scale_of(servo) for servo in self._axes])
        scales = [self._scales[at] for at in self._axis_of]
        self._limits = bringup.run(self._servos, scales)[: len(self._axes)]
        self._surveyed = True
        self.identities.update(bringup.identities)
        units = watchdog_units(self._options)
        self._armed[:] = [
            None if servo.axis.name in bringup.unwatched else units for servo in self._servos
        ]
        self._errors[:] = [bringup.errors[one] for one in self._ids]
        if self._options.status_block:
            for servo in self._servos:
                bringup.map_status(servo)
        self._build(port)
        self._try_reading()
        self._unwind()
        for servo in self._servos:
            bringup.mark(servo)
            bringup.arm(servo)
        self._marked = bringup.marked
        bringup.verify(self._servos)
        mapped = self._options.status_block
        self._held[:] = [bringup.remember(servo, mapped=mapped) for servo in self._servos]
        self.watchdog_s, self.unwatched = bringup.watchdog_s, bringup.unwatched

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
            port = SerialPort(path, self._options.baud)
        except DriverError as err:
            raise DriverError(f"bus {self._bus.name}: {err}") from err
        if not self._surveyed:
            try:
                refuse_another_master(port, self._clock, self._bus.name)
            except BaseException:
                port.close()
                raise
        tap: BytePort = tapped(self._bus.name, port, self._clock)
        return tap

    def _build(self, port: BytePort) -> None:
        """Build what every cycle uses."""
        options = self._options
        status = options.status_block
        self._exchange = Exchange(
            port,
            self._clock,
            self._ids,
            self._servos[0].model.indirect_data if status else reg.PRESENT.address,
            STATUS_FIELDS if status else FIELDS,
            Timing(options.baud, options.return_delay_s, options.latency_s),
            fast=options.read == "fast_sync",
        )
        self._staging = Staging(self._axes, self._scales, self._limits)
        self._watch = Watch(
            self._line,
            self._clock,
            self._servos,
            self._bus,
            options,
            self._armed,
            self._held,
            self._errors,
        )

    def _unwind(self) -> None:
        """Take whole turns off that a servo counts since it was last switched on.

        Raises
        ------
        DriverError
            More than one number of turns would bring an axis into its range.
        """
        scales = list(self._scales)
        for at, (servo, scale) in enumerate(zip(self._axes, scales, strict=True)):
            values = self._exchange.values[at]
            if values is None or servo.mode == reg.POSITION_MODE:
                continue
            where = f"{servo.axis.name} (bus {self._bus.name}, servo {servo.options.id})"
            turns = whole_turns(scale, values[3], servo.axis.position_range)
            if turns is None:
                raise DriverError(
                    f"{where}: it is whole turns off, and its position_range has room for more "
                    "than one number of turns; switch the servo off and on"
                )
            if turns:
                scales[at] = scale._replace(zero_counts=scale.zero_counts + turns * COUNTS_PER_TURN)
                self.notes.append(
                    f"{where}: counts {turns:+d} whole turn{'' if abs(turns) == 1 else 's'} since "
                    "it was switched on; taken off: only so it is within position_range"
                )
            elif open_turns := doubt_of(scale, values[3], servo.axis.position_range):
                self.notes.append(f"{where}: {open_turns}")
        self._set_scales(scales)
        self._staging = Staging(self._axes, self._scales, self._limits)

    def attach(self, port: BytePort) -> None:
        """Take a line with servos taken for enabled, without a packet: to measure a cycle."""
        self._line = PacketLine(port, self._clock, self._options.baud, self._options.latency_s)
        self._limits = [Limits(CURRENT_RANGE, CURRENT_RANGE)] * len(self._axes)
        self._port = port
        self._build(port)
        self._sent_ns = self._clock.now_ns()
        self._opened = self._on = True

    def _try_reading(self) -> None:
        """Read once as every cycle will: old firmware has no fast sync read."""
        exchange = self._exchange
        for _ in range(3):
            now = self._clock.now_ns()
            exchange.send(b"", now)
            until = now + round(1e9 * (self._options.latency_s + 0.03))
            if not exchange.collect(until):
                exchange.on_wire = exchange.takes_wire_time(self._clock.now_ns())
                if not exchange.on_wire:
                    self.notes.append(
                        f"bus {self._bus.name}: responses come faster than {self._options.baud} "
                        "baud allows, so this is not a real line; late ones cannot be distinguished"
                    )
                return
        silent = [
            f"{servo.axis.name} (servo {servo.options.id})"
            for servo, values in zip(self._servos, exchange.values, strict=True)
            if values is None
        ]
        wrong = "; ".join(self.misses.values())
        remedy = "check its cable, and that no id is used twice"
        if self._options.read == "fast_sync":
            remedy = "its firmware may be too old for a fast sync read: use read: sync"
        raise DriverError(
            f"bus {self._bus.name}: no response to a {self._options.read.replace('_', ' ')} read "
            f"from {', '.join(silent)}" + (f": {wrong}" if wrong else f"; {remedy}")
        )

    def _enable(self) -> bool:
        """Switch torque on and verify it, packet by packet; then keep the watchdogs fed."""
        assert self._port is not None
        if self._enabling is None:
            self._enabling = Enabling(
                self._port,
                self._clock,
                self._servos,
                self._bus,
                lambda ids: torque_packet(1, ids),
                self._staging.packet(),  # zero since they were made
                round(KEEP_ALIVE_SHARE * self._watchdog_ns),
                self._armed,
                self._errors,
                self._marked,
            )
            return False
        ready = self._enabling.step()
        self._on = self._first = self._on or ready
        return ready

    @property
    def misses(self) -> dict[str, str]:
        """What came instead of the samples of an axis, as text."""
        if self._port is None:
            return {}
        texts = map(wrong_text, self._exchange.wrong)
        causes = zip(self._axis_of, self._ids, texts, strict=True)
        return {
            self._axes[at].axis.name: f"servo {one}: {text}" for at, one, text in causes if text
        }

    # -- every cycle ----------------------------------------------------------------------

    def request(self) -> None:
        """Send the staged goals and request the samples."""
        if self._port is None or self._lost:
            return
        try:
            now, before = self._clock.now_ns(), self._sent_ns
            if not self._on:
                self._exchange.send(b"", now)
                return
            self._sent_ns = now
            if self._first and self._enabling is not None:
                self._first = False
                for index, verified_ns in enumerate(self._enabling.verified_ns):
                    self._watch.note_gap(index, now - verified_ns)
            elif now - before > FORGETS_NS:
                self._watch.note_silence(now - before)
            if self._watch.requests and self._watch.urgent:
                self._port.write(self._staging.packet())
            else:
                self._exchange.send(self._staging.packet(), now)
        except DriverError as err:
            self._lose(err)

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the measured states; not valid where no response came by the deadline."""
        if self._port is None or self._lost:
            return [MISSING] * len(self._axes)
        watch = self._watch
        try:
            if watch.requests and watch.urgent:
                watch.read_pending(deadline_ns, self._faults)
                return [MISSING] * len(self._axes)
            self._exchange.collect(watch.samples_until(self._exchange.due_ns, deadline_ns))
            states = []
            alert = 0
            for (position, velocity, effort, zero), values in zip(
                self._units, self._exchange.values, strict=False
            ):
                if values is None:
                    states.append(MISSING)
                    continue
                alert |= values[0]
                states.append(
                    JointState(
                        (values[3] - zero) * position,
                        values[2] * velocity,
                        values[1] * effort,
                        True,
                        0,
                    )
                )
            if self._shadows:
                alert |= self._join(states)
            if self._exchange.returned:
                if self._on:
                    watch.note_returned(self._exchange.returned)
                self._exchange.returned.clear()
            if self._on and (alert or watch.requests or self._exchange.refusals):
                watch.alerts(self._exchange.values, self._exchange.refusals)
                watch.read_pending(deadline_ns, self._faults)
            if self._status_block and self._on:
                watch.status(self._exchange.values, self._faults)
        except DriverError as err:
            self._lose(err)
            return [MISSING] * len(self._axes)
        for index in watch.unseen:
            states[self._axis_of[index]] = MISSING
        return states

    def _join(self, states: list[JointState]) -> int:
        """Put what the shadows measure to the axes they move; return their alerts.

        An axis of which one motor is not heard is not seen.
        """
        alert = 0
        values = self._exchange.values
        for at, axis in self._shadows:
            first, second = values[axis], values[at]
            if second is None:
                states[axis] = MISSING
                continue
            alert |= second[0]
            if first is not None:
                mean = 0.5 * (first[1] + second[1])
                states[axis] = states[axis]._replace(effort=mean * self._units[axis][2])
        return alert

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Stage one command per axis for the next request."""
        if self._watch.failed:
            failed = {self._axis_of[index] for index in self._watch.failed}
            commands = [
                SAFE_COMMAND if index in failed else command
                for index, command in enumerate(commands)
            ]
        self._staging.put(commands)

    def fill(self, row: Row, at: int) -> None:
        """Record the present current of axes that take effort, as effort; NaN: no sample."""
        values = self._exchange.values if self._port is not None and not self._lost else ()
        for place, step in zip(self._torques, self._motor_steps, strict=True):
            current = values[place] if values else None
            row[at] = NAN if current is None else current[1] * step
            at += 1

    # -- afterwards -----------------------------------------------------------------------

    def disable(self) -> None:
        """Goals to zero, torque off, then its watchdog off; a lost line is left alone."""
        port = self._port
        if port is None or not (self._on or self._enabling is not None):
            return
        self._on = False
        self._enabling = None
        # Until each says that it is off: whatever happens here, what is not known is kept.
        why = self._lost or "torque off was not sent"
        self.unconfirmed = dict.fromkeys((servo.axis.name for servo in self._servos), why)
        if not self._lost:
            self._staging.zero()
            goals = self._staging.packet()
            self.unconfirmed = leave(
                port, self._line, goals, self._servos, self.watchdog_s, self._marked
            )

    def _end(self) -> None:
        if self._port is not None and self.unconfirmed:
            self.unconfirmed = leave_again(
                self._clock, self._reconnect, self._servos, self.watchdog_s, self._marked,
                self.unconfirmed,
            )  # fmt: skip

    def _release(self) -> None:
        self._enabling = None
        port, self._port = self._port, None
        if port is not None and self._transport is None:
            port.close()

    def _reconnect(self) -> tuple[BytePort, Line]:
        """Return the line, opened anew if it was lost."""
        if self._lost and self._transport is None and self._port is not None:
            self._port.close()
            self._port = self._open_port()
            options = self._options
            self._line = PacketLine(self._port, self._clock, options.baud, options.latency_s)
        assert self._port is not None
        return self._port, self._line

    # -- parts ------------------------------------------------------------------------------

    def _lose(self, err: DriverError) -> None:
        """Report once that the line is lost; the loop then stops passively."""
        self._lost = str(err)
        self._faults.append(Fault("", self._lost, fatal=True))


def _units(servo: Servo, scale: Scale) -> tuple[float, float, float, int]:
    """Return position, velocity and measured effort of one count, and the count at zero."""
    sign = scale.direction
    effort = NAN if servo.impedance else -sign * scale.effort
    return sign * scale.position, sign * scale.velocity, effort, scale.zero_counts
