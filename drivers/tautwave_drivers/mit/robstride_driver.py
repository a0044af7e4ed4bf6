"""The driver of RobStride motors: each command a request, each answer a sample, on classic CAN.

What no motor of this family says of itself is its ranges. So the rig's `t_max` is held against the
motor's own torque limit, `p_max` against the position that it also reports as a number, and the
torque limit in the motor is set to the rig's `effort_limit`, whatever the codes stand for.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from math import floor
from typing import Any

from tautwave.contracts import AxisSpec, BusSpec, Clock, FramePort
from tautwave.driver_base import DriverBase
from tautwave.errors import DeviceFault, DriverError
from tautwave.traffic import tapped
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.can.batches import Frame
from tautwave_drivers.can.exchange import Exchange
from tautwave_drivers.can.framing import Framing
from tautwave_drivers.can.full_queue import queue_remedy
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.mit import robstride
from tautwave_drivers.mit.axis import MISSING
from tautwave_drivers.mit.options import MitOptions, Motor, motors_of
from tautwave_drivers.mit.robstride import Answer, Parameter
from tautwave_drivers.recorded import MOTOR_EFFORT, ROTOR_TEMPERATURE, read_by

REPORTED = (
    read_by(MOTOR_EFFORT, lambda axis: axis.torque if axis.fresh else math.nan),
    read_by(ROTOR_TEMPERATURE, lambda axis: axis.temperature if axis.fresh else math.nan),
)
ANSWER_NS = 5_000_000
"""Time for an answer outside of a run."""
TRIES = 3
LATE_ROUND_NS, LATE_ROUNDS = 50_000_000, 10
"""How long answers to stop are awaited at the end before it is sent again, and how often it is."""
ENABLE_TRIES = 50
CLOSE = 1e-3
"""Relative difference of numbers that is rounding."""
NEAR = 0.02
"""[rad] By which two readings of a position may differ while the arm is held."""
FORGOT = (
    "its CAN timeout has passed, it was switched off and on, or another program stopped it; run "
    "again"
)
CHECK = "check power, cable, termination, bit rate, its id, and that it is not in MIT mode"


class Axis:
    """State of one motor between two exchanges."""

    def __init__(self, spec: AxisSpec, motor: Motor) -> None:
        self.spec, self.motor = spec, motor
        self.label = f"motor {motor.id}"
        self._steps = tuple(2.0 * top / robstride.TOP for top in (motor.p_max, motor.v_max))
        self.step = 2.0 * motor.t_max / robstride.TOP
        self.reset()

    def reset(self) -> None:
        """Forget what the motor said."""
        self.fresh = self.upper = False
        self.state: int | None = None
        self.faults = 0
        self.fault = self.wrong = ""
        self.effort = 0.0
        self.arrived_ns = 0
        self.told: dict[int, bytes] = {}
        self.uids: list[bytes] = []
        self._said = (0, 0, 0, 0)

    def take(self, got: Answer, arrival_ns: int) -> bool:
        """Take what the motor said; whether it is a sample."""
        if got.kind == robstride.GET_ID:
            self.uids.append(got.data)
        elif got.kind == robstride.READ:
            self.told[int.from_bytes(got.data[:2], "little")] = got.data
        elif got.kind == robstride.FAULTS:
            self.faults |= 1 << 6
        else:
            self.state, self.faults = got.state, got.faults
            self._said = struct.unpack(">HHHH", got.data)
            self.arrived_ns = arrival_ns
            return True
        return False

    def _value(self, which: int) -> float:
        middle = 0.5 * robstride.TOP
        return self.motor.direction * self._steps[which] * (self._said[which] - middle)

    @property
    def position(self) -> float:
        """[rad] Of the axis."""
        return self._value(0) - self.motor.direction * self.motor.zero

    @property
    def velocity(self) -> float:
        """[rad/s] Of the axis."""
        return self._value(1)

    @property
    def torque(self) -> float:
        """[N m] On the axis."""
        return self.motor.direction * self.step * (self._said[2] - 0.5 * robstride.TOP)

    @property
    def temperature(self) -> float:
        """[degC] Of the motor."""
        return 0.1 * self._said[3]

    def command(self) -> tuple[int, bytes]:
        """Return identifier and bytes of its effort; zero for NaN, or once in fault.

        No code is zero torque, so those beside it alternate.
        """
        limit = self.spec.effort_limit
        effort = 0.0 if self.fault or math.isnan(self.effort) else self.effort
        effort = min(max(effort, -limit), limit)
        self.upper = not self.upper
        exact = 0.5 * robstride.TOP + self.motor.direction * effort / self.step
        code = floor(exact)
        rest = exact - code
        if rest > 0.75 or (rest > 0.25 and self.upper):
            code += 1
        bits, data = robstride.motion(min(max(code, 0), robstride.TOP))
        return robstride.frame_id(robstride.MOTION, self.motor.id, bits), data

    def judge(self) -> str:
        """Return why a motor that ran does not, '' while it does."""
        if self.faults:
            what = robstride.faults_text(self.faults) or "a fault"
            return f"{what}: its torque is off; remove the cause, then run again"
        if self.state == robstride.RUNS:
            return ""
        name = robstride.STATES.get(self.state if self.state is not None else -1, "in no state")
        return f"{name}: {FORGOT}"


class RobstrideDriver(DriverBase):
    """Driver of the RobStride motors on one CAN bus; parameters as those of `MitDriver`."""

    command_delay = CommandDelay(1, 0.0)

    def __init__(self, options: MitOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        super().__init__(bus)
        self._options, self._clock, self._transport = options, clock, transport
        motors = motors_of(options, bus)
        self._axes = [Axis(spec, motor) for spec, motor in zip(bus.axes, motors, strict=True)]
        self._host = motors[0].feedback_id if motors else 0
        self._by_motor = {axis.motor.id: axis for axis in self._axes}
        self._exchange: Exchange | None = None
        self._tries = 0
        for axis in self._axes:
            self.record(axis.spec.name, axis, REPORTED)

    # -- bring-up -----------------------------------------------------------------------------

    def _bring_up(self) -> None:
        """Stop every motor, see who it is, and set and read back what a run rests on."""
        for axis in self._axes:
            axis.reset()
        self._tries = 0
        self._exchange = self._opened_exchange()
        self._stop_all()
        if self.unconfirmed:
            silent = ", ".join(f"{name}: {why}" for name, why in self.unconfirmed.items())
            raise DriverError(f"bus {self._bus.name}: {silent}; {CHECK}")
        watched: dict[str, float] = {}
        unwatched: dict[str, str] = {}
        for axis in self._axes:
            self._meet(axis)
            self._healthy(axis)
            self._ranges(axis)
            self._set(axis, robstride.RUN_MODE, 0)
            self._set(axis, robstride.TORQUE_LIMIT, axis.spec.effort_limit)
            self._watch(axis, watched, unwatched)
        self.watchdog_s, self.unwatched = watched, unwatched

    def _opened_exchange(self) -> Exchange:
        return Exchange(self._connect(), self._clock, self._hear, queue_remedy(self._options))

    def _connect(self) -> FramePort:
        if self._transport is not None:
            given: FramePort = self._transport
            return given
        try:
            port = open_port(self._options, self._clock, Framing(extended=True))
        except DriverError as err:
            raise DriverError(f"bus {self._bus.name}: {err}") from err
        tap: FramePort = tapped(self._bus.name, port, self._clock)
        return tap

    def _where(self, axis: Axis) -> str:
        return f"{axis.spec.name}: {axis.label}"

    def _meet(self, axis: Axis) -> None:
        """Read its unique number; two of them would follow the same commands."""
        assert self._exchange is not None
        axis.uids = []
        self._exchange.begin()
        self._exchange.send(self._id(robstride.GET_ID, axis, self._host), bytes(8))
        self._exchange.missing = 2  # one more than there should be
        self._exchange.collect(self._clock.now_ns() + ANSWER_NS)
        if len(axis.uids) > 1:
            raise DriverError(
                f"{self._where(axis)}: {len(axis.uids)} motors answer to this id, and would follow "
                "the same commands; give each its own with the others' power off"
            )
        uid = axis.uids[0].hex() if axis.uids else "not told"
        self.identities[axis.spec.name] = {"family": "RobStride", "unique id": uid}

    def _healthy(self, axis: Axis) -> None:
        if axis.faults and self._options.clear_errors:
            clear = bytes((1, *bytes(7)))
            self._ask([axis], lambda one: (self._id(robstride.STOP, one, self._host), clear))
            self.notes.append(f"{self._where(axis)}: its faults were cleared")
        if axis.faults:
            raise DeviceFault(
                f"{self._where(axis)}: {robstride.faults_text(axis.faults)}; remove the cause, "
                "then switch it off and on, or set clear_errors: true"
            )

    def _ranges(self, axis: Axis) -> None:
        """Hold the rig's ranges against what the motor says in numbers."""
        most = self._need(axis, robstride.TORQUE_LIMIT)
        if most > axis.motor.t_max * (1.0 + CLOSE):
            raise DriverError(
                f"{self._where(axis)}: t_max is {axis.motor.t_max:g}, but its "
                f"{robstride.TORQUE_LIMIT} is {most:g}: codes of torque stand for more; write the "
                "range of this model"
            )
        place = self._need(axis, robstride.POSITION)
        told = axis.motor.direction * (axis.position + axis.motor.direction * axis.motor.zero)
        if abs(place - told) > NEAR:
            raise DriverError(
                f"{self._where(axis)}: {robstride.POSITION} reads {place:.4g} rad, its answers "
                f"{told:.4g} with p_max {axis.motor.p_max:g}: p_max is that of another model, or "
                "it is further from its zero than p_max, or it moves"
            )

    def _watch(self, axis: Axis, watched: dict[str, float], unwatched: dict[str, str]) -> None:
        counts = round(self._options.watchdog_s / robstride.TIMEOUT_S)
        self._write(axis, robstride.TIMEOUT, counts)
        armed = self._read(axis, robstride.TIMEOUT)
        if armed == counts:
            watched[axis.spec.name] = counts * robstride.TIMEOUT_S
            return
        has = "does not answer" if armed is None else f"stays at {armed:g}"
        text = f"its {robstride.TIMEOUT} {has}, so it goes on when the host stops"
        if not self._bus.allow_unwatched:
            raise DriverError(
                f"{self._where(axis)}: {text}; update its firmware, or use --allow-unwatched with "
                "a hand on the power switch"
            )
        unwatched[axis.spec.name] = f"{axis.label}: {text}"

    def _set(self, axis: Axis, parameter: Parameter, value: float) -> None:
        """Write a parameter, in the motor's RAM, and read it back."""
        self._write(axis, parameter, value)
        value_read = self._need(axis, parameter)
        if abs(value_read - value) > CLOSE * max(abs(value), 1e-3):
            raise DriverError(
                f"{self._where(axis)}: {parameter} stays at {value_read:g} when {value:g} is "
                "written; update its firmware"
            )

    def _need(self, axis: Axis, parameter: Parameter) -> float:
        value = self._read(axis, parameter)
        if value is None or not math.isfinite(value):
            raise DriverError(
                f"{self._where(axis)}: no answer about {parameter}; update its firmware, or {CHECK}"
            )
        return value

    def _read(self, axis: Axis, parameter: Parameter) -> float | None:
        assert self._exchange is not None
        axis.told.pop(parameter.number, None)
        for _ in range(TRIES):
            self._exchange.begin()
            can_id = self._id(robstride.READ, axis, self._host)
            self._exchange.send(can_id, robstride.parameter_bytes(parameter))
            until = self._clock.now_ns() + ANSWER_NS
            while parameter.number not in axis.told and self._clock.now_ns() < until:
                self._exchange.missing = 1
                self._exchange.collect(until)
            data = axis.told.get(parameter.number)
            if data is not None:
                return robstride.parameter_value(parameter, data)
        return None

    def _write(self, axis: Axis, parameter: Parameter, value: float) -> None:
        data = robstride.parameter_bytes(parameter, value)
        self._ask([axis], lambda one: (self._id(robstride.WRITE, one, self._host), data))

    def _id(self, kind: int, axis: Axis, data: int) -> int:
        return robstride.frame_id(kind, axis.motor.id, data)

    # -- the cycle ----------------------------------------------------------------------------

    def _enable(self) -> bool:
        """Switch on those that do not run, at no torque; then keep the watchdogs fed."""
        if not self._on:
            for axis in self._axes:
                axis.effort = 0.0
                if axis.faults:
                    raise DeviceFault(f"{self._where(axis)}: {axis.judge()}")
            off = [axis for axis in self._axes if axis.state != robstride.RUNS]
            self._on = not off
            self._tries += 1
            if off and self._tries > ENABLE_TRIES:
                raise DriverError(f"{self._where(off[0])}: stays {axis_state(off[0])}")
        enable = bytes(8)
        self._send(
            lambda axis: (
                axis.command()
                if axis.state == robstride.RUNS
                else (self._id(robstride.ENABLE, axis, self._host), enable)
            )
        )
        return self._on

    def request(self) -> None:
        """Send every motor its command; a motor in fault, or before enabling, is stopped."""
        stop = bytes(8)
        self._send(
            lambda axis: (
                axis.command()
                if self._on and not axis.fault
                else (self._id(robstride.STOP, axis, self._host), stop)
            )
        )

    def _send(self, frame: Callable[[Axis], tuple[int, bytes]]) -> None:
        if self._exchange is None:
            return
        ready = self._exchange.begin()
        for axis in self._axes:
            axis.fresh, axis.wrong = False, ""
        if ready:
            self._exchange.ask([frame(axis) for axis in self._axes])

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the measured states; not valid where no answer came by the deadline."""
        if self._exchange is None:
            return [MISSING] * len(self._axes)
        self._exchange.collect(deadline_ns)
        if self._on:
            self._judge(self._exchange)
        now = self._clock.now_ns()
        return [
            JointState(axis.position, axis.velocity, math.nan, True, max(now - axis.arrived_ns, 0))
            if axis.fresh and not axis.fault
            else MISSING
            for axis in self._axes
        ]

    def _judge(self, exchange: Exchange) -> None:
        """See whether each motor is still as it was set."""
        if exchange.lost and not all(axis.fault for axis in self._axes):
            self._faults.append(Fault("", exchange.lost, fatal=True))
        for axis in self._axes:
            text = exchange.lost or (axis.judge() if axis.fresh else "")
            if text and not axis.fault:
                axis.fault = text
                if not exchange.lost:
                    self._faults.append(Fault(axis.spec.name, f"{axis.label}: {text}", fatal=True))
        self._faults += [Fault("", text, fatal=False) for text in exchange.reports()]

    def _hear(self, frames: Sequence[Frame]) -> int:
        """Take frames; return how many were samples that are missing in this cycle."""
        count = 0
        for can_id, data, arrival_ns in frames:
            got = robstride.answer(can_id, data, self._host)
            axis = None if got is None else self._by_motor.get(got.motor)
            if got is None or axis is None:
                assert self._exchange is not None
                self._exchange.strange(can_id, data)
            elif axis.take(got, arrival_ns):
                count += not axis.fresh
                axis.fresh = True
            elif got.kind != robstride.FAULTS:
                axis.wrong = "an answer about a parameter: stop the other program that asks"
        return count

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        for axis, command in zip(self._axes, commands, strict=True):
            axis.effort = command.effort

    @property
    def misses(self) -> dict[str, str]:
        """What came instead of the sample of an axis, as text."""
        return {
            axis.spec.name: f"{axis.label}: {axis.wrong or 'no answer'}"
            for axis in self._axes
            if not axis.fresh
        }

    def witness(self, name: str) -> tuple[float, float]:
        """Return velocity [rad/s] and torque [N m] that a motor reports; NaN: no answer."""
        (axis,) = (axis for axis in self._axes if axis.spec.name == name)
        return (axis.velocity, axis.torque) if axis.fresh else (math.nan, math.nan)

    # -- the end ------------------------------------------------------------------------------

    def disable(self) -> None:
        """Stop all, until each motor says that it is."""
        if self._exchange is None or not (self._on or self._tries):
            return
        self._on, self._tries = False, 0
        self._stop_all()

    def _end(self) -> None:
        """Try again, on a port opened anew if it was lost; what came since then counts."""
        if self._exchange is None or not self.unconfirmed:
            return
        for _ in range(LATE_ROUNDS):
            until = self._clock.now_ns() + LATE_ROUND_NS
            try:
                self._stop(self._reconnect(), until)
            except DriverError as err:
                self.unconfirmed = dict.fromkeys(self.unconfirmed, str(err))
            if not self.unconfirmed:
                break
            self._clock.sleep_until(until)

    def _reconnect(self) -> Exchange:
        exchange = self._exchange
        assert exchange is not None
        if exchange.lost and exchange.port is not self._transport:
            exchange.port.close()
            self._exchange = exchange = self._opened_exchange()
        return exchange

    def _stop_all(self) -> None:
        """Stop all motors, and keep who does not confirm it."""
        exchange = self._exchange
        assert exchange is not None
        exchange.drain()  # what is still in from before confirms nothing
        for axis in self._axes:
            axis.state, axis.effort = None, 0.0
        self.unconfirmed = {axis.spec.name: "no answer" for axis in self._axes}
        for _ in range(TRIES):
            if self.unconfirmed:
                self._stop(exchange, self._clock.now_ns() + ANSWER_NS)

    def _stop(self, exchange: Exchange, until_ns: int) -> None:
        """Stop those that do not say they are; answers to older commands come in between."""
        left = [axis for axis in self._axes if axis.spec.name in self.unconfirmed]
        if exchange.begin():
            exchange.ask([(self._id(robstride.STOP, axis, self._host), bytes(8)) for axis in left])
        while left and not exchange.lost and self._clock.now_ns() < until_ns:
            for axis in left:
                axis.fresh = False
            exchange.missing = 1
            exchange.collect(until_ns)
            left = [axis for axis in left if axis.state != robstride.RESET]
        self.unconfirmed = {
            axis.spec.name: exchange.lost
            or ("no answer" if axis.state is None else f"it stays {axis_state(axis)}")
            for axis in left
        }

    def _ask(self, axes: Sequence[Axis], frame: Callable[[Axis], tuple[int, bytes]]) -> None:
        """Send each of some motors a frame, and wait a moment for their answers."""
        exchange = self._exchange
        if not axes or exchange is None or not exchange.begin():
            return
        for axis in axes:
            axis.fresh = False
        exchange.ask([frame(axis) for axis in axes])
        exchange.collect(self._clock.now_ns() + ANSWER_NS)

    def _release(self) -> None:
        exchange, self._exchange = self._exchange, None
        if exchange is not None and exchange.port is not self._transport:
            exchange.port.close()


def axis_state(axis: Axis) -> str:
    """Return the state that a motor reports, in a word."""
    return robstride.STATES.get(-1 if axis.state is None else axis.state, "silent")
