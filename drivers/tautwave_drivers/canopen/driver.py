"""The driver: SYNC out, TPDOs in, RPDOs out, in the control thread and without waiting for others.

One cycle: `request` sends SYNC, on which every drive latches its position and begins to use the
RPDO it got before; `read` matches TPDOs until all are in or the time is up and steps each
state machine; `write` sends the RPDOs at once. With synchronous RPDOs a command acts one period
after it was written, with event-driven ones on receipt.
"""

from __future__ import annotations

import math
import socket
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from tautwave.contracts import BusSpec, Clock, FramePort
from tautwave.driver_base import DriverBase
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave.traffic import tapped
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.can.opening import open_port
from tautwave_drivers.can.raw import RawPort
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.budget import exchange_s
from tautwave_drivers.canopen.enable_inputs import enable_inputs
from tautwave_drivers.canopen.exchange import Exchange
from tautwave_drivers.canopen.health import Health
from tautwave_drivers.canopen.options import CanopenOptions, nodes_of
from tautwave_drivers.canopen.setup.startup import StartUp
from tautwave_drivers.recorded import ANSWER, MOTOR_EFFORT, read_by

if TYPE_CHECKING:
    from tautwave_drivers.canopen.network import PolledNetwork

ANSWERED = read_by(ANSWER, lambda of: of[0].answered_us(of[1]))
EFFORT = read_by(MOTOR_EFFORT, lambda axis: axis.motor_effort if axis.fresh else math.nan)
COLUMNS = (ANSWERED, EFFORT)

STOP_LIMIT_S = {"disable_voltage": 0.25, "quick_stop": 1.0}


class CanopenDriver(DriverBase):
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
        Options and axes do not match.
    """

    def __init__(self, options: CanopenOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        super().__init__(bus)
        self._options = options
        self._clock = clock
        self._now = clock.now_ns
        self._transport: FramePort | socket.socket | None = transport
        self._exchange: Exchange | None = None
        self._net: PolledNetwork | None = None
        self._period_ns = bus.period_ns
        self._axes = [
            Axis(spec, node, options, bus.rate_hz)
            for spec, node in zip(bus.axes, nodes_of(options, bus), strict=True)
        ]
        self._rpdos = [(axis, axis.rpdo_id) for axis in self._axes]
        self.dead_man = enable_inputs(self._axes, clock.now_ns)
        self._health = Health(options, self._axes, bus.period_ns)
        self._startups = [StartUp(axis, options, bus.period_ns) for axis in self._axes]
        self._sync = options.sync
        self._timeout_ns = int(options.answer_share * bus.period_ns)
        self._synced = False
        self.watchdog_s = dict.fromkeys(
            (axis.spec.name for axis in self._axes), options.heartbeat_timeout_ms * 1e-3
        )
        for axis in self._axes:
            self.record(axis.spec.name, (self, axis), [ANSWERED])
        for axis in self._axes:
            self.record(axis.spec.name, axis, [EFFORT] if axis.reports_motor else [])
        if options.sync and options.rpdo == "sync":
            self.command_delay = CommandDelay(1, 0.0)
        else:
            wire_s = exchange_s(options, bus)
            self.command_delay = CommandDelay(0, min(wire_s, 0.999 / bus.rate_hz))

    # -- before and after ---------------------------------------------------------------------

    def _bring_up(self) -> None:
        """Bring every drive up to NMT operational, torque off, all written and read back.

        Raises
        ------
        DriverError
            The bus cannot be opened, or a drive is missing, not the expected one, or refuses.
        """
        from tautwave_drivers.canopen.setup.bringup import bring_up

        if self._options.data_bitrate is not None:
            raise DriverError(
                f"bus {self._bus.name}: data_bitrate is for `tautwave check` only; this driver "
                "uses classic CAN: remove it to run"
            )
        port = self._connect()
        if port is not self._transport:  # behind an open one is nobody else, or it is a test's
            self._listen(port)
        self.attach(port)
        self._net, self.notes = bring_up(
            self._options, self._bus, self._axes, self._health, port, self._clock
        )
        self.identities.update((axis.spec.name, axis.identity) for axis in self._axes)
        self.unwatched = {axis.spec.name: axis.unwatched for axis in self._axes if axis.unwatched}
        timeout_s = self._options.heartbeat_timeout_ms * 1e-3
        names = (axis.spec.name for axis in self._axes)
        self.watchdog_s = {name: timeout_s for name in names if name not in self.unwatched}
        now = self._now()
        for axis in self._axes:
            axis.heard_ns = now
            axis.errors.clear()

    def _listen(self, port: FramePort) -> None:
        """Refuse a bus that another master drives, with nothing sent."""
        from tautwave_drivers.canopen.setup.listening import refuse_another_master

        try:
            refuse_another_master(
                port,
                self._clock,
                self._bus.name,
                self._axes,
                master_id=self._options.master_id,
                sync=self._sync,
            )
        except BaseException:
            port.close()
            raise

    def _connect(self) -> FramePort:
        if isinstance(self._transport, socket.socket):  # frames of SocketCAN on any datagram socket
            return RawPort(self._transport.dup(), self._clock, self._bus.name)
        if self._transport is not None:
            return self._transport
        try:
            port = open_port(self._options, self._clock)
            tap: FramePort = tapped(self._bus.name, port, self._clock)
            return tap
        except DriverError as err:
            raise DriverError(f"bus {self._bus.name}: {err}") from err

    def attach(self, port: FramePort) -> None:
        """Take a port whose drives are already set up: measurements, tests."""
        self._reset()
        self._exchange = Exchange(
            port, self._clock, self._axes, self._health, self._options, self._bus
        )
        self._opened = True

    def _reset(self) -> None:
        self._health.reset()
        for axis, startup in zip(self._axes, self._startups, strict=True):
            axis.reset()
            startup.reset()
        self._on = self._synced = False

    def _enable(self) -> bool:
        """Take in what came, step every drive's start, send RPDOs and SYNC. Never waits.

        Raises
        ------
        DeviceFault
            A drive cannot be enabled; the message has its state and its error.
        DriverError
            The bus is lost.
        """
        exchange = self._exchange
        assert exchange is not None
        self._health.running = True
        exchange.catch_up()
        for axis, startup in zip(self._axes, self._startups, strict=True):
            startup.step(exchange.cycle)
            axis.settle(exchange.cycle, exchange.sync_ns)
        self._raise_failures()
        doubts = [axis.interrupted(exchange.cycle) for axis in self._axes]
        if any(doubts) and not self._on:
            self._read_back()
        done = all(startup.done for startup in self._startups)
        if not self._on:
            self._on = done
            for axis in self._axes:
                axis.lost = axis.lost_then = axis.late = 0  # counted from the first cycle on
        for axis, startup in zip(self._axes, self._startups, strict=True):
            exchange.send(axis.rpdo_id, axis.pack(*axis.values))
            if startup.second_pdo is not None:
                exchange.send(*startup.second_pdo)
            axis.fresh = False
        exchange.begin()
        self._synced = True
        return done

    def _read_back(self) -> None:
        """Read once more what was set in every drive: one may have lost it with its power.

        Raises
        ------
        DeviceFault
            One has.
        """
        from tautwave_drivers.canopen.setup.settings import verify

        if self._net is not None:
            for drive in self._net.drives.values():
                verify(drive)

    def _raise_failures(self) -> None:
        reported = [fault for axis in self._axes for fault in axis.errors]
        fatal = [fault.text for fault in reported if fault.fatal]
        if self._health.lost:
            raise DriverError(f"bus {self._bus.name}: {self._health.lost}")
        if fatal:
            raise DeviceFault(f"bus {self._bus.name}: " + "; ".join(fatal))
        for startup in self._startups:
            if startup.failure:
                kind = DeviceFault if startup.faulted else BusTimeout
                raise kind(f"bus {self._bus.name}: {startup.failure}")

    # -- the cycle ----------------------------------------------------------------------------

    def request(self) -> None:
        """Drain what is left of the last cycle, then send SYNC."""
        exchange = self._exchange
        if exchange is None:
            return
        if self._synced:
            self._synced = False
            if self._now() - exchange.sync_ns < self._period_ns // 2:
                return  # enabling has sent the SYNC of this cycle
        exchange.drain()
        exchange.begin()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Match TPDOs until all are in or the time is up; step the state machines."""
        exchange = self._exchange
        axes = self._axes
        if exchange is None:
            now = self._now()
            return [axis.state(now) for axis in axes]
        sync_ns = exchange.sync_ns
        if exchange.missing:
            timeout_ns = sync_ns + self._timeout_ns
            exchange.collect(deadline_ns if deadline_ns < timeout_ns else timeout_ns)
        now = self._now()
        if not self._health.lost:
            self._health.watch(now)
            cycle = exchange.cycle
            for axis in axes:
                axis.settle(cycle, sync_ns)
            self._health.watch_samples(cycle)
        return [axis.state(now) for axis in axes]

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Send one RPDO per axis at once."""
        exchange = self._exchange
        if exchange is None or self._health.queue.cycles:
            return
        for (axis, can_id), command in zip(self._rpdos, commands, strict=True):
            axis.set_target(command)
            exchange.send(can_id, axis.pack(*axis.values))
        if not self._sync:
            for axis in self._axes:
                axis.fresh = False

    def faults(self) -> Sequence[Fault]:
        """Return the reports since the last call: EMCY, heartbeats, states, the bus itself."""
        faults = self._health.faults
        for axis in self._axes:
            if axis.errors:
                faults = [*faults, *axis.errors]
                axis.errors.clear()
        if not faults:
            return ()
        self._health.faults = []
        return faults

    @property
    def misses(self) -> dict[str, str]:
        """Return what kept samples away, by axis: a full transmit queue, or TPDOs too short."""
        full = self._health.queue.kept_away()
        causes = {axis.spec.name: full or axis.too_short() for axis in self._axes if not axis.fresh}
        return {name: why for name, why in causes.items() if why}

    def witness(self, name: str) -> tuple[float, float]:
        """Return velocity and motor effort of a drive [SI], read from now on; NaN: not yet."""
        (axis,) = (axis for axis in self._axes if axis.spec.name == name)
        return axis.witnessed()

    def answered_us(self, axis: Axis) -> float:
        """Return how long after SYNC an axis' TPDO came [us]; NaN: none did."""
        begun_ns = 0 if self._exchange is None else self._exchange.sync_ns
        return (axis.arrived_ns - begun_ns) * 1e-3 if axis.fresh else math.nan

    # -- the end ------------------------------------------------------------------------------

    def disable(self) -> None:
        """Zero commands, then stop as the rig says, until the drives confirm or time is up."""
        exchange = self._exchange
        self._on = False
        if exchange is None or self._net is None:
            return
        health = self._health
        health.queue.cycles = 0
        for method in dict.fromkeys((self._options.stop, "disable_voltage")):
            for axis in self._axes:
                axis.stop_drive(method)
            exchange.run_out(self._now() + round(STOP_LIMIT_S[method] * 1e9))
        health.running = False
        self.unconfirmed = {
            axis.spec.name: health.lost or f"it was last seen in {axis.machine.state.value}"
            for axis in self._axes
            if not axis.machine.done
        }

    def close(self) -> None:
        """Disable, disarm the drives' watchdogs, NMT pre-operational, release; never raises."""
        if self._exchange is not None:
            self.notes += [text for axis in self._axes if (text := axis.history())]
        super().close()

    def _end(self) -> None:
        if self._net is not None and not self._health.lost:
            from tautwave_drivers.canopen.setup.bringup import shut_down

            self.unconfirmed = shut_down(self._net, self._axes, self._bus)

    def _not_closed(self, err: Exception) -> None:
        self._health.report(f"closing: {err}")

    def _release(self) -> None:
        exchange, self._exchange, self._net = self._exchange, None, None
        if exchange is not None and exchange.port is not self._transport:
            try:
                exchange.port.close()
            except Exception as err:  # noqa: BLE001  whatever a vendor's driver raises
                self._not_closed(err)
