"""What a bus and its nodes report besides process data: heartbeat, EMCY, errors, full queues.

Source: CiA 301 v4.2, 7.2.7 (EMCY) and 7.2.8 (NMT, heartbeat).
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import FramePort
from tautwave.types import Fault
from tautwave_drivers.can.errors import error_text
from tautwave_drivers.can.framing import ERROR_FRAME
from tautwave_drivers.can.full_queue import DEAD_CYCLES, FullQueue, queue_remedy
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.enable_inputs import take_inputs
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.cia402.emergency import decode_emergency

SYNC_ID = 0x80
BOOT_UP, OPERATIONAL = 0, 5
NODE_STATES = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}
MANUFACTURERS = 0xFF00
"""EMCY codes from here on are the manufacturer's own (CiA 301, 7.2.7.1)."""
DEAD_BEATS = 1.5
"""Heartbeats with a full queue and nothing received that mean a dead bus."""


def state_text(state: int | None) -> str:
    """Return an NMT state as text."""
    if state is None:
        return "no heartbeat yet"
    return NODE_STATES.get(state, f"state {state}")


class Health:
    """Watches one bus.

    Attributes
    ----------
    running : bool
        Nodes have to be operational, and their heartbeats are watched.
    queue : FullQueue
        The queue of what is sent.
    lost : str
        Why the bus cannot be used any more, else ''.
    booted : set of int
        Nodes that sent a boot-up frame while not `running`.
    """

    def __init__(self, options: CanopenOptions, axes: Sequence[Axis], period_ns: int) -> None:
        self._options = options
        self._axes = {axis.node.id: axis for axis in axes}
        self._timeout_ns = options.heartbeat_timeout_ms * 1_000_000
        self._window = max(2, round(1e9 / period_ns))
        beats = DEAD_BEATS * options.heartbeat_ms * 1e6 / period_ns
        self.queue = FullQueue(queue_remedy(options), max(DEAD_CYCLES, round(beats)))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.running = False
        self.lost = ""
        self.faults: list[Fault] = []
        self.states: dict[int, int] = {}
        self.booted: set[int] = set()
        self.received = 0
        self.queue.reset()
        self._reported: dict[str, int] = {}

    def report(self, text: str, *, fatal: bool = False) -> None:
        """Report something about the bus; repeats are reported at 10, 100, 1000 ... times."""
        count = self._reported[text] = self._reported.get(text, 0) + 1
        if fatal or str(count).strip("0") == "1":
            times = f" ({count} times)" if count > 1 else ""
            self.faults.append(Fault("", text + times, fatal))

    def lose(self, text: str) -> None:
        """Declare the bus lost: every axis stops."""
        if self.lost:
            return
        self.lost = text
        self.report(text, fatal=True)
        for axis in self._axes.values():
            axis.failed = True
            axis.stop_drive(self._options.stop)

    def take(self, can_id: int, data: bytes, arrival_ns: int) -> None:
        """Take a frame other than process data. Bytes never raise."""
        if can_id & ERROR_FRAME:
            text, lost = error_text(can_id, data)
            if lost:
                self.lose(text)
            else:
                self.report(f"CAN: {text}")
            return
        axis = self._axes.get(can_id & 0x7F)
        if axis is None:
            if can_id == SYNC_ID and self._options.sync:
                self.report(
                    "CAN: another master is sending SYNC (80h) on this bus, and the drives "
                    "respond to it too; stop it, or give each master its own bus"
                )
            return
        service = can_id & ~0x7F
        if service == 0x700 and data:
            self._heartbeat(axis, data[0] & 0x7F, arrival_ns)
        elif service == 0x80:
            self._emergency(axis, data)
        elif service == 0x580 and len(data) >= 5 and data[1:4] == b"\x61\x60\x00":
            self._mode_display(axis, data)
        elif service == 0x580 and not axis.told.take(data):
            take_inputs(axis, data, arrival_ns)

    def _heartbeat(self, axis: Axis, state: int, arrival_ns: int) -> None:
        axis.heard_ns = arrival_ns
        before = self.states.get(axis.node.id)
        self.states[axis.node.id] = state
        if not self.running and state == BOOT_UP:
            self.booted.add(axis.node.id)
        if not self.running or state == OPERATIONAL:
            return
        if state == BOOT_UP:
            axis.fail(
                "the drive restarted during the run (boot-up frame): its mapping and position "
                "reference are lost; check its supply, then run again",
                self._options.stop,
            )
        elif before != state:
            axis.fail(
                f"it went from NMT operational to {state_text(state)} and no longer takes "
                "commands; look for another master, or an error with a reaction by 1029h",
                self._options.stop,
            )

    def _emergency(self, axis: Axis, data: bytes) -> None:
        reported = decode_emergency(data)
        if reported is None:
            self.report(f"{axis.label}: EMCY with only {len(data)} bytes, ignored")
            return
        axis.error_code = 0 if reported.cleared else reported.code
        axis.force_step()
        if (
            reported.cleared
            or reported.code in self._options.tolerated_emergencies
            or not self.running
        ):
            axis.errors.append(Fault(axis.spec.name, f"{axis.label}: EMCY {reported.text}", False))
        else:
            hint = ""
            if reported.code >= MANUFACTURERS:
                hint = (
                    "; where the drive's manual calls it a warning, add "
                    f"0x{reported.code:X} to tolerated_emergencies of the bus"
                )
            axis.fail(f"EMCY {reported.text}{hint}", self._options.stop)

    def _mode_display(self, axis: Axis, data: bytes) -> None:
        if data[0] == 0x4F:  # one byte, expedited (CiA 301, 7.2.4.3.6)
            axis.display = data[4] - 256 if data[4] > 127 else data[4]
            axis.force_step()

    def watch_samples(self, cycle: int) -> None:
        """Say of an axis that most cycles of the last second had no sample, as they come."""
        if cycle % self._window:
            return
        for axis in self._axes.values():
            lost, axis.lost_then = axis.lost - axis.lost_then, axis.lost
            if 2 * lost > self._window:
                self.report(
                    f"{axis.label}: most of the last {self._window} cycles had no sample, so "
                    "control is that much coarser; check the drive's inhibit time, the bus load "
                    "and answer_share"
                )

    def watch(self, now_ns: int) -> None:
        """Compare each heartbeat's age with what is allowed."""
        oldest = now_ns - self._timeout_ns
        for axis in self._axes.values():
            if axis.heard_ns < oldest and axis.watched and not axis.failed:
                axis.fail(
                    f"heartbeat lost: none for {(now_ns - axis.heard_ns) / 1e6:.0f} ms "
                    f"(allowed {self._options.heartbeat_timeout_ms} ms); check its supply and "
                    "cable",
                    self._options.stop,
                )

    # -- a queue that is full -----------------------------------------------------------------

    def may_send(self, port: FramePort) -> bool:
        """Return whether frames may be sent in this cycle; called once a cycle while it is full."""
        drained = self.queue.drained(port, self.received)
        if self.queue.dead:
            self.lose(self.queue.dead)
        return drained

    def rearmed(self) -> None:
        """Report that the queue accepts frames again."""
        self.report(f"{self.queue.accepts_again()}, and zero was sent before the next SYNC")
