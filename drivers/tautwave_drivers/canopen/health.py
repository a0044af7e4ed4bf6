"""What a bus and its nodes tell besides process data: heartbeat, EMCY, error frames, full queues.

Source: CiA 301 v4.2, 7.2.7 (EMCY) and 7.2.8 (NMT, heartbeat).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from tautwave.types import Fault
from tautwave_drivers.canopen.axis import Axis
from tautwave_drivers.canopen.frames import ERROR_FRAME, Port, error_words
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.cia402.emergency import decode_emergency

SYNC_ID = 0x80
BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0, 4, 5, 127
NODE_STATES = {0: "boot-up", 4: "stopped", 5: "operational", 127: "pre-operational"}
DEAD_CYCLES, DEAD_BEATS = 5, 1.5
"""A full queue with nothing received for so many cycles and heartbeats is that of a dead bus."""


def state_words(state: int | None) -> str:
    """Return an NMT state as a person reads it."""
    if state is None:
        return "no heartbeat yet"
    return NODE_STATES.get(state, f"state {state}")


class Health:
    """Watches one bus.

    Attributes
    ----------
    running : bool
        Nodes have to be operational, and their heartbeats are watched.
    lost : str
        Why the bus is of no more use, else ''.
    """

    def __init__(self, options: CanopenOptions, axes: Sequence[Axis], period_ns: int) -> None:
        self._options = options
        self._axes = {axis.node.id: axis for axis in axes}
        self._timeout_ns = options.heartbeat_timeout_ms * 1_000_000
        # udp_multicast gives back what one has sent.
        self._sync_is_ours = options.sync and options.interface != "udp_multicast"
        beats = DEAD_BEATS * options.heartbeat_ms * 1e6 / period_ns
        self._dead_cycles = max(DEAD_CYCLES, round(beats))
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self.running = False
        self.lost = ""
        self.faults: list[Fault] = []
        self.states: dict[int, int] = {}
        self.received = 0
        self.full_cycles = 0
        self.full_frames = 0
        self._received_then = 0
        self._told: dict[str, int] = {}

    def tell(self, text: str, *, fatal: bool = False) -> None:
        """Note something about the bus; what is repeated is told again at 1, 10, 100 ... times."""
        count = self._told[text] = self._told.get(text, 0) + 1
        if fatal or str(count).strip("0") == "1":
            times = f" ({count} times)" if count > 1 else ""
            self.faults.append(Fault("", text + times, fatal))

    def lose(self, text: str) -> None:
        """The bus is of no more use: every axis stops."""
        if self.lost:
            return
        self.lost = text
        self.tell(text, fatal=True)
        for axis in self._axes.values():
            axis.failed = True
            axis.rest(self._options.stop)

    def take(self, can_id: int, data: bytes, arrival_ns: int) -> None:
        """Take a frame that is no process data. Bytes never raise."""
        if can_id & ERROR_FRAME:
            words, lost = error_words(can_id, data)
            if lost:
                self.lose(words)
            else:
                self.tell(f"CAN: {words}")
            return
        axis = self._axes.get(can_id & 0x7F)
        if axis is None:
            if can_id == SYNC_ID and self._sync_is_ours:
                self.tell(
                    "CAN: somebody else sends SYNC (80h) on this bus, and drives act on it too; "
                    "end the other master, or give each its own bus"
                )
            return
        service = can_id & ~0x7F
        if service == 0x700 and data:
            self._heartbeat(axis, data[0] & 0x7F, arrival_ns)
        elif service == 0x80:
            self._emergency(axis, data)
        elif service == 0x580 and len(data) >= 5 and data[1:4] == b"\x61\x60\x00":
            self._mode_display(axis, data)

    def _heartbeat(self, axis: Axis, state: int, arrival_ns: int) -> None:
        axis.heard_ns = arrival_ns
        before = self.states.get(axis.node.id)
        self.states[axis.node.id] = state
        if not self.running or state == OPERATIONAL:
            return
        if state == BOOT_UP:
            axis.fail(
                "it was reset behind our back (boot-up frame): its mapping and its position "
                "reference are gone; look at its supply, then run again",
                self._options.stop,
            )
        elif before != state:
            axis.fail(
                f"it left NMT operational for {state_words(state)}: another master, or its "
                "reaction to an error (1029h); it no longer takes commands",
                self._options.stop,
            )

    def _emergency(self, axis: Axis, data: bytes) -> None:
        told = decode_emergency(data)
        if told is None:
            self.tell(f"{axis.label}: EMCY with {len(data)} bytes, not understood")
            return
        axis.error_code = 0 if told.cleared else told.code
        axis.shake()
        if told.cleared or told.code in self._options.tolerated_emergencies or not self.running:
            axis.errors.append(Fault(axis.spec.name, f"{axis.label}: EMCY {told.words}", False))
        else:
            axis.fail(f"EMCY {told.words}", self._options.stop)

    def _mode_display(self, axis: Axis, data: bytes) -> None:
        if data[0] == 0x4F:  # one byte, expedited (CiA 301, 7.2.4.3.6)
            axis.display = data[4] - 256 if data[4] > 127 else data[4]
            axis.shake()

    def watch(self, now_ns: int) -> None:
        """Compare each heartbeat's age with what is allowed."""
        oldest = now_ns - self._timeout_ns
        for axis in self._axes.values():
            if axis.heard_ns < oldest and axis.watched and not axis.failed:
                axis.fail(
                    f"heartbeat lost: none for {(now_ns - axis.heard_ns) / 1e6:.0f} ms "
                    f"(allowed {self._options.heartbeat_timeout_ms} ms); look at its supply and "
                    "cable",
                    self._options.stop,
                )

    # -- a queue that is full -----------------------------------------------------------------

    def refused(self) -> None:
        """The queue did not take a frame."""
        if not self.full_cycles:
            self.full_cycles = 1
            self._received_then = self.received
        self.full_frames += 1

    def may_send(self, port: Port) -> bool:
        """Return whether frames may be sent in this cycle; called once a cycle while full.

        Congested: others are heard, so the bus works and the queue will drain. Dead: nothing is.
        """
        self.full_cycles += 1
        if self.received == self._received_then and self.full_cycles > self._dead_cycles:
            self.lose(
                f"CAN: dead bus: the transmit queue is full for {self.full_cycles} cycles and "
                "nothing is received; look at cable, termination, power and bit rate"
            )
            return False
        purge: Any = getattr(port, "purge", None)
        if purge is not None:
            purge()
        pending: Any = getattr(port, "pending", None)
        return pending is None or pending() == 0

    def rearmed(self) -> None:
        """The queue takes frames again."""
        self.tell(
            f"CAN: congested: the transmit queue was full for {self.full_cycles} cycles; commands "
            "of that time were dropped, and zero sent before the next SYNC"
        )
        self.full_cycles = 0
