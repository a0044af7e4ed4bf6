"""One cycle on the bus: SYNC, heartbeat and RPDOs out, TPDOs matched to their SYNC."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import BusSpec, Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.enable_inputs import EVERY_S, READ_INPUTS
from tautwave_drivers.canopen.health import OPERATIONAL, SYNC_ID, Health
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.cia402.states import State

HEARTBEAT_ID = 0x700
NO_DATA = b""
MODE_POLL_S = 0.1
FIRST_BEATS = 4
"""Cycles from the first one on that have a heartbeat each: a drive's watchdog starts with the first
one, and has to run before it is enabled."""
QUIET_EVERY = 10
"""Least cycles between two cycles without SYNC, if drives were late. If frames were lost the next
may follow at once: it costs less than the doubt."""
_BEAT = bytes((OPERATIONAL,))
_READ_MODE_DISPLAY = bytes.fromhex("4061600000000000")  # SDO upload of 6061h (CiA 301, 7.2.4.3.5)


class Exchange:
    """Frames of one bus from `open` to `close`; errors of the port end in `health.lost`.

    Attributes
    ----------
    cycle : int
        Exchanges started.
    sync_ns : int
        When the last one began.
    """

    def __init__(
        self,
        port: FramePort,
        clock: Clock,
        axes: Sequence[Axis],
        health: Health,
        options: CanopenOptions,
        bus: BusSpec,
    ) -> None:
        self.port = port
        self._clock = clock
        self._now = clock.now_ns
        self._axes = axes
        self._by_tpdo = {axis.tpdo_id: axis for axis in axes}
        self._health = health
        self._sync = options.sync
        self._period_ns = bus.period_ns
        self._beat_id = HEARTBEAT_ID + options.master_id
        self._beat_every = max(1, options.heartbeat_ms * 1_000_000 // bus.period_ns)
        self._switched = [axis for axis in axes if axis.node.enable_input is not None]
        self._ask_every = 4 * max(1, round(EVERY_S * bus.rate_hz / 4))
        self._poll_every = max(len(axes), round(MODE_POLL_S * bus.rate_hz) // 4)
        self.cycle = 0
        self.sync_ns = self._now() - bus.period_ns
        self.missing = 0
        self._quiet = False
        self._quiet_from = 0

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False where it did not go out."""
        if self._health.lost:
            return False
        try:
            if self.port.send(can_id, data):
                return True
        except DriverError as err:
            self._health.lose(str(err))
            return False
        self._health.queue.refused(self._health.received)
        return False

    def drain(self) -> None:
        """Take in the frames left over from the last cycle; they belong to no later SYNC."""
        by_tpdo, health = self._by_tpdo, self._health
        # After a cycle without SYNC nothing may be left: that nothing came clears the drives.
        receive = self._arrived if self._quiet else self.port.receive
        try:
            while (frame := receive()) is not None:
                health.received += 1
                axis = by_tpdo.get(frame[0])
                if axis is None:
                    health.take(*frame)
                elif self._sync:
                    axis.take_late(quiet=self._quiet)
                else:
                    axis.take_event(frame[1], frame[2])
        except DriverError as err:
            health.lose(str(err))
        if self._sync:
            for axis in self._axes:
                axis.fresh = False

    def _arrived(self) -> tuple[int, bytes, int] | None:
        """Return the next frame that has arrived by now, None if there is none.

        A clock runs a simulated bus only to its next frame, so it is asked before every one.
        """
        frame = self.port.receive()
        if frame is None and self._clock.wait(self.port, self._now()):
            frame = self.port.receive()
        return frame

    def begin(self) -> None:
        """Begin a cycle: SYNC, and now and then a heartbeat and a read of the mode."""
        self.cycle = cycle = self.cycle + 1
        health = self._health
        self.missing = 0
        self.sync_ns = self._now()  # before SYNC is sent: TPDOs are matched to it by time
        if health.lost or (health.queue.cycles and not self._rearm()):
            return
        if not self._sync:
            self.missing = sum(not axis.fresh for axis in self._axes)
        elif not self._stay_quiet() and self.send(SYNC_ID, NO_DATA):
            for axis in self._axes:
                axis.outstanding += 1
            self.missing = len(self._axes)
        if cycle % self._beat_every == 0 or cycle <= FIRST_BEATS:
            self.send(self._beat_id, _BEAT)
        if cycle % 4 == 0:
            self._ask_modes(cycle)
        elif cycle % 2:
            self._ask_witnesses(cycle)
        elif self._switched and cycle % self._ask_every == 2:
            for axis in self._switched:
                self.send(0x600 + axis.node.id, READ_INPUTS)

    def _ask_witnesses(self, cycle: int) -> None:
        for axis in self._axes:
            if request := axis.told.request(cycle):
                self.send(0x600 + axis.node.id, request)

    def _stay_quiet(self) -> bool:
        """Leave one SYNC out if it is unclear to which one the TPDOs belong.

        What still comes belongs to an older one; if nothing comes, the older TPDOs are lost.
        """
        if self._quiet:
            late = [axis.resolve() for axis in self._axes]
            if any(late):
                self._quiet_from = self.cycle + QUIET_EVERY - 1
        wanted = self.cycle >= self._quiet_from and any(axis.doubtful for axis in self._axes)
        self._quiet = wanted
        return wanted

    def _ask_modes(self, cycle: int) -> None:
        """Read the mode of one drive if no PDO has it: often until it is known, then rarely."""
        for at, axis in enumerate(self._axes):
            if axis.polls_mode and cycle >= axis.mode_since + 2:
                unknown = axis.display != axis.machine.mode_wanted
                if unknown or (cycle // 4) % self._poll_every == at:
                    self.send(0x600 + axis.node.id, _READ_MODE_DISPLAY)

    def _rearm(self) -> bool:
        """Return whether a full queue has drained; then zero goes out before any command acts."""
        if not self._health.may_send(self.port):
            return False
        for axis in self._axes:
            axis.values[1] = 0
            if not self.send(axis.rpdo_id, axis.pack(*axis.values)):
                return False
        self._health.rearmed()
        return True

    def catch_up(self) -> None:
        """Take in everything that has arrived, without waiting, as of the last SYNC."""
        try:
            self._clock.wait(self.port, self._now())  # runs a simulated bus up to now
            while (frame := self.port.receive()) is not None:
                self._take(*frame)
        except DriverError as err:
            self._health.lose(str(err))

    def collect(self, timeout_ns: int) -> None:
        """Take TPDOs until those of all axes are in, or the time is up."""
        receive = self.port.receive
        by_tpdo = self._by_tpdo
        health = self._health
        sync_ns = self.sync_ns
        try:
            while self.missing:
                frame = receive()
                if frame is None:
                    if not self._clock.wait(self.port, timeout_ns):
                        return
                    continue
                can_id, data, arrival_ns = frame
                axis = by_tpdo.get(can_id)
                if axis is None or not self._sync:
                    self._take(can_id, data, arrival_ns)
                else:
                    health.received += 1
                    if axis.take(data, arrival_ns, sync_ns):
                        self.missing -= 1
        except DriverError as err:
            health.lose(str(err))

    def _take(self, can_id: int, data: bytes, arrival_ns: int) -> None:
        self._health.received += 1
        axis = self._by_tpdo.get(can_id)
        if axis is None:
            self._health.take(can_id, data, arrival_ns)
        elif self._sync:
            if axis.take(data, arrival_ns, self.sync_ns):
                self.missing -= 1
        elif axis.take_event(data, arrival_ns):
            self.missing -= 1

    def run_out(self, until_ns: int) -> None:
        """Cycle with zero commands until every drive has stopped, or the time is up."""
        axes = self._axes
        least = self.cycle + (1 if self._sync else 2)  # without SYNC a controlword may act later
        while not self._health.lost:
            for axis in axes:
                axis.values[1] = 0
                axis.fresh = axis.doubtful = False
                self.send(axis.rpdo_id, axis.pack(*axis.values))
            self.begin()
            end = self._now() + self._period_ns
            self.collect(end)
            while not self._health.lost and self._now() < end:
                if self._clock.wait(self.port, end):
                    self.catch_up()
            for axis in axes:
                axis.settle(self.cycle, self.sync_ns)
            stopped = all(
                axis.machine.done and axis.machine.state is not State.QUICK_STOP_ACTIVE
                for axis in axes
            )
            if (stopped and self.cycle >= least) or self._now() >= until_ns:
                return
