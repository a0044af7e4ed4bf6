"""One drive inside the cycle: its PDOs as bytes, its state machine, and what it last reported.

Velocity (606Ch) and torque (6077h) are read by SDO while the bus runs (`Told`), for the motion
check of `tautwave accept`: neither is in the TPDO of an axis that takes effort. Source: CiA 402-2
v3.0, 606Ch and 6077h; CiA 301 v4.2, 7.2.4.3.5 (expedited upload).
"""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from tautwave.contracts import AxisSpec
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.canopen.mapping import RPDO_1, TPDO_1, Layout, mapping_of, sensor_entry
from tautwave_drivers.canopen.options import CanopenOptions, Node, limit_permille, scale
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.entry import Entry
from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.modes import Mode
from tautwave_drivers.cia402.states import MODE_BIT_12, State
from tautwave_drivers.cia402.terms import Quirks, Timeouts
from tautwave_drivers.cia402.units import INT16, INT32, to_counts

READ_VELOCITY = bytes.fromhex("406c600000000000")
READ_TORQUE = bytes.fromhex("4077600000000000")
TOLD_EVERY = 16
"""Cycles between two reads of the same object; the other comes half-way."""


class Told:
    """What one drive reported last; read while `wanted`."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Discard the values, and stop reading."""
        self.wanted = False
        self.velocity = self.torque = math.nan

    def request(self, cycle: int) -> bytes:
        """Return the SDO request of this cycle, b'' for none."""
        if not self.wanted:
            return b""
        return {1: READ_VELOCITY, 1 + TOLD_EVERY // 2: READ_TORQUE}.get(cycle % TOLD_EVERY, b"")

    def take(self, data: bytes) -> bool:
        """Take a response by SDO; return whether it is one of these."""
        if len(data) < 8 or data[1:4] not in (READ_VELOCITY[1:4], READ_TORQUE[1:4]):
            return False
        if data[0] & 0xE0 == 0x40:  # an abort says nothing
            if data[1:4] == READ_VELOCITY[1:4]:
                (self.velocity,) = struct.unpack_from("<i", data, 4)
            else:
                (self.torque,) = struct.unpack_from("<h", data, 4)
        return True


_HALF, _WHOLE = 1 << 31, 1 << 32
_ON_THE_WAY = (State.READY, State.SWITCHED_ON, State.OPERATION_ENABLED)


class ResponseTime(NamedTuple):
    """How soon a drive responds to SYNC, as measured [ns].

    Nothing comes before `floor`; it usually comes between `earliest` and `latest`.
    """

    floor_ns: int = 0
    earliest_ns: int = 0
    latest_ns: int = 1 << 62


class Axis:
    """One drive of the bus.

    Attributes
    ----------
    values : list of int
        Contents of the next RPDO; the controlword is at 0, the target at 1.
    fresh : bool
        The TPDO for the last SYNC has come.
    outstanding : int
        SYNCs without a TPDO so far.
    heard_ns : int
        When its last heartbeat came.
    doubtful : bool
        TPDOs are missing, and the next may belong to an older SYNC.
    late, short, lost : int
        TPDOs for an older SYNC, with too few bytes, or missing; `lost_then` a second ago or less.
    told : Told
        Velocity and torque that it reports, where they are requested.
    loans : dict of Entry to int
        What was found in objects that are changed while the bus is open: 6072h, watchdogs.
    unwatched : str
        What the drive does when this program stops, where no watchdog of it acts.
    """

    def __init__(self, spec: AxisSpec, node: Node, options: CanopenOptions, rate_hz: float) -> None:
        self.spec = spec
        self.node = node
        self.label = f"{spec.name} (node {node.id})"
        self.loans: dict[Entry, int] = {}
        self.scale = scale(node, spec)
        self.servo = spec.causality == "admittance"
        self.mode = Mode.CSV if self.servo else Mode.CST
        self.rate_hz = rate_hz
        self.fault_resets = options.fault_resets
        self.machine = self.new_machine(None)
        self.rpdo_id = RPDO_1 + node.id
        self.tpdo_id = TPDO_1 + node.id
        sensor = node.effort_sensor
        self._sensor_step = 0.0 if sensor is None else sensor.effort
        self._sensor_zero = 0 if sensor is None else sensor.zero
        self.map(*mapping_of(spec.causality, node))
        self.reports_motor = self._torque_at >= 0 and not self.servo
        sign = node.direction
        self._position_step = sign * self.scale.encoder_quantum
        # 6077h is the motor's torque; what the outside applies to the device is its reaction.
        self._effort_step = -sign * self.scale.effort_quantum
        self._sign = sign
        self._quantum = self.scale.velocity_quantum if self.servo else self.scale.effort_quantum
        self._most = INT32 if self.servo else min(INT16, limit_permille(node, spec))
        self.response_time = ResponseTime()
        self.errors: list[Fault] = []
        self.identity: dict[str, str] = {}
        self.told = Told()
        self.reset()

    def map(self, rpdo: Layout, tpdo: Layout) -> None:
        """Take the PDOs as the drive has them."""
        self.values = [0] * len(rpdo.entries)
        self.pack = rpdo.pack
        self._unpack = tpdo.unpack
        self._size = tpdo.size
        self._mode_at = rpdo.at(o.MODE)
        self._display_at = tpdo.at(o.MODE_DISPLAY)
        self._torque_at = tpdo.at(o.TORQUE)
        sensor = self.node.effort_sensor
        self._sensor_at = -1 if sensor is None else tpdo.at(sensor_entry(sensor))
        self.polls_mode = self._display_at < 0

    def new_machine(self, quick_stop_option: int | None) -> Machine:
        """Return a state machine at rest for this drive."""
        quirks = Quirks(
            quick_stop_option=quick_stop_option,
            fault_resets=self.fault_resets,
            mode_when_enabled=self.node.mode_display == "when_enabled",
            timeouts=Timeouts.at_rate(self.rate_hz),
        )
        return Machine(self.label, quirks)

    def reset(self) -> None:
        """Forget everything heard so far."""
        self.values[:] = [0] * len(self.values)
        self.reported: tuple[int, ...] = ()
        self.statusword = -1
        self.display: int | None = None
        self.error_code = 0
        self.mode_bits = 0
        self.failed = False
        self.fresh = False
        self.input_on = False
        self.input_ns = 0
        self.position = 0.0
        self._counts = self._wraps = 0
        self.effort = self.motor_effort = math.nan
        self.sampled_ns = 0
        self.arrived_ns = 0
        self.outstanding = 0
        self.heard_ns = 0
        self.watched = False
        self.unwatched = ""
        self.mode_since = 0
        self._mode_sent = 0
        self.late = self.short = self.lost = self.lost_then = 0
        self.doubtful = False
        self._gap = False
        self._last_state = State.NOT_READY
        self._strict = False
        self._backlog = False
        self._candidate: tuple[bytes, int] | None = None
        self._steady = False
        self.errors.clear()
        self.told.reset()

    # -- TPDOs --------------------------------------------------------------------------------

    def take(self, data: bytes, arrival_ns: int, sync_ns: int) -> bool:
        """Take a TPDO; return True if it makes the axis fresh.

        A TPDO carries no number of its SYNC. One that comes sooner than this drive can respond
        belongs to an older one. After a single SYNC without a TPDO, one at the usual time is kept
        as a candidate: if another follows, it was old; if none does, the missing one is lost. At
        any other time, or after several missing ones, it is not used at all: a cycle without SYNC
        has to show which are still on their way.
        (A delay of one period, within some 30 us, that sets in while running looks like a loss; one
        of ten, since what a cycle without SYNC lacks is then missing in the next such cycle.)
        """
        if len(data) < self._size:
            self.short += 1
            return False
        if self.fresh:
            self._accept(
                data, arrival_ns, sync_ns
            )  # the one taken before belonged to an older SYNC
            self.late += 1
            return False
        latency = arrival_ns - sync_ns
        waiting = self.outstanding
        if waiting > 0:
            self.outstanding = waiting - 1
        response_time = self.response_time
        if latency < response_time.floor_ns:
            self.late += 1
            return False
        if waiting > 1:
            usual = response_time.earliest_ns <= latency <= response_time.latest_ns
            if waiting == 2 and usual and not self._strict:
                self._candidate = (data, arrival_ns)
                return False
            self.doubtful = True
            self.late += 1
            return False
        self._strict = False
        self._accept(data, arrival_ns, sync_ns)
        return True

    def take_late(self, *, quiet: bool) -> None:
        """Count a TPDO that came after its cycle, or without any SYNC."""
        self._backlog = self._backlog or quiet
        if self.outstanding > 0:
            self.outstanding -= 1
        self.late += 1

    def resolve(self) -> bool:
        """After a cycle without SYNC: what did not come then is lost, what came was late.

        True if something came: this drive is late, and may be late again.
        """
        late = self._backlog
        if self.doubtful:
            self._strict = late
            if not late:
                self.outstanding = 0
        self.doubtful = self._backlog = False
        return late

    def take_event(self, data: bytes, arrival_ns: int) -> bool:
        """Take a TPDO on a bus without SYNC: the newest counts; True if it is the first."""
        if len(data) < self._size:
            self.short += 1
            return False
        first = not self.fresh
        self._accept(data, arrival_ns, arrival_ns)
        return first

    def _accept(self, data: bytes, arrival_ns: int, sampled_ns: int) -> None:
        self.reported = reported = self._unpack(data)
        self.fresh = True
        self.sampled_ns = sampled_ns
        self.arrived_ns = arrival_ns
        counts = reported[1]
        if not -_HALF <= counts - self._counts <= _HALF:  # past an end of its 32 bits
            self._wraps += _WHOLE if counts < self._counts else -_WHOLE
        self._counts = counts
        self.position = (counts + self._wraps) * self._position_step
        if self.reports_motor:
            self.motor_effort = -reported[self._torque_at] * self._effort_step
        elif self._torque_at >= 0:
            self.effort = reported[self._torque_at] * self._effort_step
        if self._sensor_at >= 0:
            self.effort = (reported[self._sensor_at] - self._sensor_zero) * self._sensor_step

    # -- state machine -----------------------------------------------------------------------

    def settle(self, cycle: int, sync_ns: int) -> None:
        """Step the state machine by what this cycle brought."""
        if not self.fresh and self._candidate is not None:
            self._accept(*self._candidate, sync_ns)
            self.outstanding = 0
        self._candidate = None
        machine = self.machine
        if not self.fresh:
            if self._steady:  # it was heard up to the last cycle, but not stepped
                self._step(cycle - 1)
            self._steady = False
            machine.step(None, None, cycle)
            self.lost += 1
        else:
            reported = self.reported
            word = reported[0]
            at = self._display_at
            display = reported[at] if at >= 0 else self.display
            if word == self.statusword and display == self.display and self._steady:
                return  # nothing has changed: neither does the controlword
            if self.polls_mode and self.statusword & ~word & MODE_BIT_12:
                display = None  # it no longer follows: read its mode at once
            self.statusword = word
            self.display = display
            self._step(cycle)
            self._steady = machine.commanding and machine.done and not self.mode_bits
        values = self.values
        values[0] = machine.controlword
        if machine.mode_wanted != self._mode_sent:
            self._mode_sent = machine.mode_wanted
            self.mode_since = cycle
            if self.polls_mode:
                self.display = None
        if self._mode_at >= 0:
            values[self._mode_at] = machine.mode_wanted or self.mode  # set-up wrote this one
        if not machine.commanding:
            values[1] = 0
        self._collect_events()

    def interrupted(self, cycle: int) -> bool:
        """Return whether it is back after what may have been a power dip: a gap, or back at start.

        Once it is enabled its state shows it: no drive comes up enabled.
        """
        if not self.fresh:
            self._gap = self._gap or cycle > 0
            return False
        state = self.machine.state
        back = state is State.SWITCH_ON_DISABLED and self._last_state in _ON_THE_WAY
        doubt, self._gap, self._last_state = self._gap or back, False, state
        return doubt

    def _step(self, cycle: int) -> None:
        display = self.display if self._mode_known(cycle) else None
        self.machine.step(self.statusword, display, cycle, self.mode_bits, self.error_code)

    def _mode_known(self, cycle: int) -> bool:
        """6061h is valid only once 6060h has had time to arrive."""
        return cycle >= self.mode_since + 2

    def enable(self, mode: int) -> None:
        """Work towards OPERATION ENABLED in `mode`."""
        self.machine.enable(mode)
        self._steady = False

    def force_step(self) -> None:
        """Step the state machine in the next cycle even if nothing changes."""
        self._steady = False

    def _collect_events(self) -> None:
        for event in self.machine.take_events():
            self.errors.append(Fault(self.spec.name, event.text, event.fatal))

    def fail(self, text: str, stop: str) -> None:
        """Stop this axis: zero in the next RPDO, and out of OPERATION ENABLED."""
        if not self.failed:
            self.failed = True
            self.errors.append(Fault(self.spec.name, f"{self.label}: {text}", True))
        self.stop_drive(stop)

    def stop_drive(self, stop: str) -> None:
        """Stop the drive with the rig's method; commands are zero from now on."""
        if stop == "quick_stop" and self.machine.commanding:
            self.machine.quick_stop()
            self.values[0] = 0x02
        else:
            self.machine.disable()
            self.values[0] = 0
        self.values[1] = 0
        self._steady = False

    def set_target(self, command: AxisCommand) -> None:
        """Put a command into the next RPDO; zero unless commanding."""
        if not self.machine.commanding:
            self.values[1] = 0
            return
        value = command.velocity if self.servo else command.effort
        self.values[1] = self._sign * to_counts(value, self._quantum, self._most)

    def history(self) -> str:
        """Return what was lost and late, for the notes; '' if nothing was."""
        reported = ((self.lost, "missing"), (self.late, "late"), (self.short, "too short"))
        words = ", ".join(f"{count} {word}" for count, word in reported if count)
        return f"{self.label}: TPDOs {words}" if words else ""

    def too_short(self) -> str:
        """Return what of its TPDOs were no samples, '' where none came too short."""
        if not self.short:
            return ""
        return (
            f"{self.label}: {self.short} TPDOs of fewer than {self._size} bytes, so with another "
            "mapping than was set; look for a power dip, or another master that maps it"
        )

    def witnessed(self) -> tuple[float, float]:
        """Return velocity and motor effort along the axis [SI], read from now on; NaN: not yet."""
        self.told.wanted = True
        return (
            self._sign * self.told.velocity * self.scale.velocity_quantum,
            self._sign * self.told.torque * self.scale.effort_quantum,
        )

    def state(self, now_ns: int) -> JointState:
        """Return what was measured in this cycle."""
        return JointState(
            self.position,
            math.nan,
            self.effort,
            self.fresh and not self.failed,
            now_ns - self.sampled_ns,
        )
