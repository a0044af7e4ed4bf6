"""The driver: SYNC out, TPDOs in, RPDOs out, in the control thread and without waiting for others.

One cycle: `request` sends SYNC, on which every drive latches its position and begins to use the
RPDO it got before; `read` matches TPDOs until all are in or the patience is over and steps each
state machine; `write` sends the RPDOs at once. With synchronous RPDOs a command acts one period
after it was written, with event-driven ones on receipt.
"""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tautwave.contracts import BusSpec, Clock, Row
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.budget import exchange_s
from tautwave_drivers.canopen.frames import Port, RawPort, open_port
from tautwave_drivers.canopen.health import OPERATIONAL, Health
from tautwave_drivers.canopen.options import CanopenOptions, nodes_of
from tautwave_drivers.canopen.startup import StartUp
from tautwave_drivers.cia402.states import State

if TYPE_CHECKING:
    from tautwave_drivers.canopen.network import PolledNetwork

SYNC_ID = 0x80
HEARTBEAT_ID = 0x700
NO_DATA = b""
MODE_POLL_S = 0.1
STOP_LIMIT_S = {"disable_voltage": 0.25, "quick_stop": 1.0}
_OPERATIONAL_BEAT = bytes((OPERATIONAL,))
_READ_MODE_DISPLAY = bytes.fromhex("4061600000000000")  # SDO upload of 6061h (CiA 301, 7.2.4.3.5)


class CanopenDriver:
    """Driver for CiA 402 drives on one CAN bus.

    Parameters
    ----------
    options : CanopenOptions
        The rig's options block.
    bus : BusSpec
        Axes and rate.
    clock : Clock
        All waiting goes through it.
    transport : FramePort, socket or None
        The simulated bus, or a datagram socket that carries `struct can_frame`; None to open the
        real one in `open`.

    Raises
    ------
    ConfigError
        Options and axes do not belong together.
    """

    def __init__(self, options: CanopenOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        self._options = options
        self._bus = bus
        self._clock = clock
        self._now = clock.now_ns
        self._transport: Port | socket.socket | None = transport
        self._port: Port | None = None
        self._net: PolledNetwork | None = None
        self._period_ns = bus.period_ns
        self._axes = [
            Axis(spec, node, options, bus.rate_hz)
            for spec, node in zip(bus.axes, nodes_of(options, bus), strict=True)
        ]
        self._by_tpdo = {axis.tpdo_id: axis for axis in self._axes}
        self._rpdos = [(axis, axis.rpdo_id) for axis in self._axes]
        self._health = Health(options, self._axes, bus.period_ns)
        self._startups = [StartUp(axis, options, bus.period_ns) for axis in self._axes]
        self._sync = options.sync
        self._patience_ns = int(options.answer_share * bus.period_ns)
        self._beat_id = HEARTBEAT_ID + options.master_id
        self._beat_every = max(1, options.heartbeat_ms * 1_000_000 // bus.period_ns)
        self._poll_every = max(len(self._axes), round(MODE_POLL_S * bus.rate_hz) // 4)
        self._cycle = 0
        self._sync_ns = 0
        self._synced = False
        self._missing = 0
        self._enabled = False
        self._quiet = True  # no SYNC went out in this cycle
        self.notes: list[str] = []
        self.columns = [f"{axis.spec.name}.answer_us" for axis in self._axes]
        if options.sync and options.rpdo == "sync":
            self.command_delay = CommandDelay(1, 0.0)
        else:
            wire_s = exchange_s(options, bus)
            self.command_delay = CommandDelay(0, min(wire_s, 0.999 / bus.rate_hz))

    # -- before and after ---------------------------------------------------------------------

    def open(self) -> None:
        """Bring every drive up to NMT operational, torque off, all written and read back.

        Raises
        ------
        DriverError
            The bus cannot be opened, or a drive is missing, is another one, or refuses.
        """
        from tautwave_drivers.canopen.bringup import bring_up

        if self._options.data_bitrate is not None:
            raise DriverError(
                f"bus {self._bus.name}: data_bitrate is for `tautwave check` only, drives are "
                "spoken to in classic CAN; remove it to run"
            )
        if self._port is not None:
            self.close()
        self._reset()
        self._port = self._connect()
        try:
            self._net, self.notes = bring_up(
                self._options, self._bus, self._axes, self._health, self._port, self._clock
            )
        except BaseException:
            self._release()
            raise
        now = self._now()
        for axis in self._axes:
            axis.heard_ns = now
            axis.errors.clear()
        self._sync_ns = now - self._period_ns

    def _connect(self) -> Port:
        if isinstance(self._transport, socket.socket):  # frames of SocketCAN on any datagram socket
            return RawPort(self._transport.dup(), self._clock, self._bus.name)
        return self._transport or open_port(self._options, self._clock)

    def attach(self, port: Port) -> None:
        """Take a port whose drives are set up already, or are none: measurements, tests."""
        self._reset()
        self._port = port
        self._sync_ns = self._now() - self._period_ns

    def detach(self) -> None:
        """Close the port and leave its drives as they are."""
        self._release()

    def _reset(self) -> None:
        self._health.reset()
        for axis, startup in zip(self._axes, self._startups, strict=True):
            axis.reset()
            startup.reset()
        self._cycle = 0
        self._enabled = False
        self._synced = False
        self.notes = []

    def enable_step(self) -> bool:
        """Take in what came, step every drive's start, send RPDOs and SYNC. Never waits.

        Raises
        ------
        DeviceFault
            A drive cannot be enabled; the sentence has its state and its error.
        DriverError
            The bus is lost, or the driver is not open.
        """
        port = self._port
        if port is None:
            raise DriverError(f"bus {self._bus.name}: enabled before it was opened")
        self._health.running = True
        self._catch_up(port)
        for axis, startup in zip(self._axes, self._startups, strict=True):
            startup.step(self._cycle)
            axis.settle(self._cycle, self._sync_ns)
        self._raise_failures()
        done = all(startup.done for startup in self._startups)
        self._enabled = self._enabled or done
        for axis, startup in zip(self._axes, self._startups, strict=True):
            self._send(axis.rpdo_id, axis.pack(*axis.values))
            if startup.second_pdo is not None:
                self._send(*startup.second_pdo)
        for axis in self._axes:
            axis.fresh = False
        self._begin(port)
        self._synced = True
        return done

    def _catch_up(self, port: Port) -> None:
        """Take in everything that has arrived, as answers to the last SYNC."""
        try:
            self._clock.wait(port, self._now())  # runs a simulated bus up to now
            while (frame := port.receive()) is not None:
                self._take(*frame)
        except DriverError as err:
            self._health.lose(str(err))

    def _raise_failures(self) -> None:
        told = [fault for axis in self._axes for fault in axis.errors]
        fatal = [fault.text for fault in told if fault.fatal]
        if self._health.lost:
            raise DriverError(f"bus {self._bus.name}: {self._health.lost}")
        if fatal:
            raise DeviceFault(f"bus {self._bus.name}: " + "; ".join(fatal))
        for startup in self._startups:
            if startup.failure:
                raise BusTimeout(f"bus {self._bus.name}: {startup.failure}")

    # -- the cycle ----------------------------------------------------------------------------

    def request(self) -> None:
        """Put aside what is left of the last cycle, then send SYNC."""
        port = self._port
        if port is None:
            return
        if self._synced:
            self._synced = False
            if self._now() - self._sync_ns < self._period_ns // 2:
                return  # enabling has sent the SYNC of this cycle
        axes = self._axes
        try:
            while (frame := port.receive()) is not None:
                axis = self._by_tpdo.get(frame[0])
                self._health.received += 1
                if axis is None:
                    self._health.take(*frame)
                elif self._sync:
                    axis.take_old(frame[1])
                else:
                    axis.take_event(frame[1], frame[2])
        except DriverError as err:
            self._health.lose(str(err))
        if self._sync:
            for axis in axes:
                axis.fresh = False
        self._begin(port)

    def _begin(self, port: Port) -> None:
        """Begin a cycle: SYNC, and now and then a heartbeat and a question for the mode."""
        self._cycle += 1
        health = self._health
        self._missing = 0
        if health.lost:
            return
        if health.full_cycles and not self._rearm(port):
            self._sync_ns = self._now()
            return
        if self._sync:
            # Before, not after: an answer is matched to it by time.
            self._sync_ns = self._now()
            if self._send(SYNC_ID, NO_DATA):
                for axis in self._axes:
                    axis.outstanding += 1
                self._missing = len(self._axes)
        else:
            self._sync_ns = self._now()
            self._missing = sum(not axis.fresh for axis in self._axes)
        cycle = self._cycle
        if cycle % self._beat_every == 0:
            self._send(self._beat_id, _OPERATIONAL_BEAT)
        if cycle % 4 == 0:
            self._ask_modes(cycle)

    def _ask_modes(self, cycle: int) -> None:
        """Ask one drive for its mode where no PDO tells: often until it is known, then seldom."""
        for at, axis in enumerate(self._axes):
            if axis.polls_mode and cycle >= axis.mode_since + 2:
                unknown = axis.display != axis.machine.mode_wanted
                if unknown or (cycle // 4) % self._poll_every == at:
                    self._send(0x600 + axis.node.id, _READ_MODE_DISPLAY)

    def _rearm(self, port: Port) -> bool:
        """Return whether a full queue has drained; then zero goes out before anything acts."""
        if not self._health.may_send(port):
            return False
        for axis, can_id in self._rpdos:
            axis.values[1] = 0
            if not self._send(can_id, axis.pack(*axis.values)):
                return False
        self._health.rearmed()
        return True

    def _send(self, can_id: int, data: bytes) -> bool:
        port = self._port
        if port is None or self._health.lost:
            return False
        try:
            if port.send(can_id, data):
                return True
        except DriverError as err:
            self._health.lose(str(err))
            return False
        self._health.refused()
        return False

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Match TPDOs until all are in or the patience is over; step the state machines."""
        port = self._port
        axes = self._axes
        if port is not None:
            if self._missing:
                patience = self._sync_ns + self._patience_ns
                try:
                    self._collect(port, deadline_ns if deadline_ns < patience else patience)
                except DriverError as err:
                    self._health.lose(str(err))
            now = self._now()
            if not self._health.lost:
                self._health.watch(now)
                cycle, sync_ns = self._cycle, self._sync_ns
                for axis in axes:
                    axis.settle(cycle, sync_ns)
        else:
            now = self._now()
        return [axis.state(now) for axis in axes]

    def _collect(self, port: Port, patience_ns: int) -> None:
        receive = port.receive
        by_tpdo = self._by_tpdo
        while self._missing:
            frame = receive()
            if frame is None:
                if not self._clock.wait(port, patience_ns):
                    return
                continue
            can_id, data, arrival_ns = frame
            axis = by_tpdo.get(can_id)
            if axis is None or not self._sync:
                self._take(can_id, data, arrival_ns)
            else:
                self._health.received += 1
                if axis.take(data, arrival_ns, self._sync_ns):
                    self._missing -= 1

    def _take(self, can_id: int, data: bytes, arrival_ns: int) -> None:
        self._health.received += 1
        axis = self._by_tpdo.get(can_id)
        if axis is None:
            self._health.take(can_id, data, arrival_ns)
        elif self._sync:
            if axis.take(data, arrival_ns, self._sync_ns):
                self._missing -= 1
        elif axis.take_event(data, arrival_ns):
            self._missing -= 1

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Send one RPDO per axis at once; ignored until all drives are enabled.

        Raises
        ------
        DriverError
            Not one command per axis.
        """
        if len(commands) != len(self._rpdos):
            raise DriverError(
                f"bus {self._bus.name}: {len(commands)} commands for {len(self._rpdos)} axes; "
                "write one command per axis, in the order of the rig file"
            )
        health = self._health
        if not self._enabled or health.full_cycles:
            return
        for (axis, can_id), command in zip(self._rpdos, commands, strict=True):
            axis.set_target(command)
            self._send(can_id, axis.pack(*axis.values))
        if not self._sync:
            for axis in self._axes:
                axis.fresh = False

    def faults(self) -> Sequence[Fault]:
        """Return what was told since the last call: EMCY, heartbeats, states, the bus itself."""
        found = self._health.faults
        for axis in self._axes:
            if axis.errors:
                found = [*found, *axis.errors]
                axis.errors.clear()
        if not found:
            return ()
        self._health.faults = []
        return found

    def fill(self, row: Row, at: int) -> None:
        """Record how long after SYNC each answer came [us]; NaN where none did."""
        for axis in self._axes:
            delay = axis.arrived_ns - self._sync_ns
            row[at] = delay * 1e-3 if axis.fresh else float("nan")
            at += 1

    # -- the end ------------------------------------------------------------------------------

    def disable(self) -> None:
        """Zero commands, then stop as the rig says, until the drives confirm or time is up."""
        port = self._port
        self._enabled = False
        if port is None or self._net is None:
            return
        health = self._health
        health.full_cycles = 0
        for way in dict.fromkeys((self._options.stop, "disable_voltage")):
            for axis in self._axes:
                axis.rest(way)
            self._run_out(port, self._now() + round(STOP_LIMIT_S[way] * 1e9))
        health.running = False

    def _run_out(self, port: Port, until_ns: int) -> None:
        """Cycle with zero commands until every drive has stopped."""
        axes = self._axes
        least = self._cycle + (1 if self._sync else 2)  # without SYNC a word may be taken up later
        while not self._health.lost:
            for axis in axes:
                axis.values[1] = 0
                axis.fresh = False
                self._send(axis.rpdo_id, axis.pack(*axis.values))
            self._begin(port)
            end = self._now() + self._period_ns
            try:
                self._collect(port, end)
                while self._now() < end and self._clock.wait(port, end):
                    while (frame := port.receive()) is not None:
                        self._take(*frame)
            except DriverError as err:
                self._health.lose(str(err))
            for axis in axes:
                axis.settle(self._cycle, self._sync_ns)
            stopped = all(
                axis.machine.done and axis.machine.state is not State.QUICK_STOP_ACTIVE
                for axis in axes
            )
            if (stopped and self._cycle >= least) or self._now() >= until_ns:
                return

    def close(self) -> None:
        """Disable, disarm the drives' watchdogs, NMT pre-operational, release; never raises."""
        if self._port is None:
            return
        try:
            self.disable()
            if self._net is not None and not self._health.lost:
                from tautwave_drivers.canopen.bringup import lay_down

                lay_down(self._net, self._axes, self._period_ns)
        except Exception as err:  # noqa: BLE001  the way out must not end in the middle
            self._health.tell(f"closing: {err}")
        self._release()

    def _release(self) -> None:
        port, self._port, self._net = self._port, None, None
        self._enabled = False
        if port is not None and port is not self._transport:
            try:
                port.close()
            except Exception as err:  # noqa: BLE001  whatever a vendor's driver raises
                self._health.tell(f"closing: {err}")
