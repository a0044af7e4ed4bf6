"""A CAN bus in memory, event by event: one frame at a time, and the lowest identifier goes first.

A port sends its frames in the order given; what competes for the free bus is the oldest frame of
each port, as with a controller that is fed from one queue.
"""

from __future__ import annotations

import heapq
from collections import deque
from collections.abc import Callable, Collection

from tautwave_sim.wire.can import ERROR_FRAME, CanTiming, priority
from tautwave_sim.wire.can_faults import CanFaultPlan, CanFaults

Frame = tuple[int, bytes, bool]
"""Identifier, data, and whether it is an FD frame."""
Receiver = Callable[[int, int, bytes], None]
"""Takes arrival [ns], identifier and data."""

PASSIVE, OFF = 128, 256
"""Error counts at which a controller becomes error-passive and bus-off (ISO 11898-1)."""

RECOVERY_BITS = 128 * 11


class MediumPort:
    """One controller on the bus.

    Parameters
    ----------
    medium : CanMedium
        The bus.
    receiver : callable
        Given what the others send.
    depth : int, optional
        Frames that its queue holds; unlimited if not given.
    recovers : bool
        Whether it comes back from bus-off by itself, as field devices do.

    Attributes
    ----------
    ids : collection of int or None
        Identifiers of the frames that its receiver is given; None: all.
    """

    def __init__(
        self, medium: CanMedium, receiver: Receiver, depth: int | None, recovers: bool
    ) -> None:
        self._medium = medium
        self._depth = depth
        self._recovers = recovers
        self._back_ns = 0
        self.receiver = receiver
        self.ids: Collection[int] | None = None
        self.queue: deque[Frame] = deque()
        self.errors = 0
        self.off = False

    @property
    def error_state(self) -> str:
        """`active`, `passive` or `off`."""
        if self.off:
            return "off"
        return "passive" if self.errors >= PASSIVE else "active"

    def send(self, can_id: int, data: bytes, fd: bool | None = None) -> bool:
        """Queue a frame at the medium's time; return False when the queue is full, or off.

        Without `fd` it is an FD frame where the bus has them.
        """
        if self.off or (self._depth is not None and len(self.queue) >= self._depth):
            return False
        self.queue.append((can_id, bytes(data), self._medium.timing.fd if fd is None else fd))
        self._medium.start()
        return True

    def fail(self, now_ns: int) -> None:
        """Count a frame that was destroyed."""
        self.errors += 8
        if self.errors >= OFF:
            self.leave(now_ns)

    def leave(self, now_ns: int) -> None:
        """Go bus-off: what was queued is gone."""
        self.queue.clear()
        self.off = True
        self._back_ns = now_ns + self._medium.timing.bits_ns(RECOVERY_BITS)

    def present(self, now_ns: int) -> bool:
        """Return whether it is on the bus; lets it come back where it does so by itself."""
        if self.off and self._recovers and now_ns >= self._back_ns:
            self.restart()
        return not self.off

    def restart(self) -> None:
        """Come back with all counters at 0."""
        self.off = False
        self.errors = 0


class CanMedium:
    """The bus between its ports.

    Parameters
    ----------
    timing : CanTiming
        Time that frames take.
    now_ns : int
        The present.
    plan : CanFaultPlan, optional
        What goes wrong.
    elapsed : callable, optional
        From a time [ns] to the plan's own, None before that begins.
    """

    def __init__(
        self,
        timing: CanTiming,
        now_ns: int = 0,
        plan: CanFaultPlan | None = None,
        elapsed: Callable[[int], int | None] = lambda t_ns: t_ns,
    ) -> None:
        self.timing = timing
        self.now_ns = now_ns
        self.plan = plan if plan is not None else CanFaultPlan(CanFaults())
        self.elapsed = elapsed
        self.ports: list[MediumPort] = []
        self.listeners: list[Receiver] = []
        """Hear every frame that was not destroyed, when it is over, before anybody receives it."""
        self.down = False
        self.fd = False
        """Whether the frame that is being received is an FD frame."""
        self._sender: MediumPort | None = None
        self._frame: Frame = (0, b"", False)
        self._end_ns = 0
        self._free_ns = now_ns
        self._held = False
        self._later: list[tuple[int, int, MediumPort, Frame]] = []
        self._count = 0
        self._shortest_ns = timing.frame_ns(0, b"")

    def port(
        self, receiver: Receiver, depth: int | None = None, *, recovers: bool = True
    ) -> MediumPort:
        """Return a new port of this bus."""
        port = MediumPort(self, receiver, depth, recovers)
        self.ports.append(port)
        return port

    def next_event_ns(self) -> int | None:
        """Return when a frame is over, or a delayed one arrives; None while all is quiet."""
        at_ns = None if self._sender is None else self._end_ns
        if self._free_ns > self.now_ns and (at_ns is None or self._free_ns < at_ns):
            at_ns = self._free_ns
        if self._later and (at_ns is None or self._later[0][0] < at_ns):
            at_ns = self._later[0][0]
        return at_ns

    def next_heard_ns(self, port: MediumPort) -> int | None:
        """Return a time before which `port` hears nothing, though no frame of its own is over.

        An answer to a frame of its own begins behind that, and takes at least the shortest time.
        """
        at_ns = self.next_event_ns()
        if at_ns is None or self._sender is not port or at_ns != self._end_ns:
            return at_ns
        return at_ns + self._shortest_ns

    def advance(self, to_ns: int) -> None:
        """Let all frames pass that are over by `to_ns`."""
        while True:
            at_ns = self.next_event_ns()
            if at_ns is None or at_ns > to_ns:
                break
            self.step(at_ns)
        self.now_ns = max(self.now_ns, to_ns)

    def step(self, at_ns: int) -> None:
        """Let one thing happen, which is due at `at_ns`."""
        self.now_ns = max(self.now_ns, at_ns)
        # All respond to a frame before any of them wins the bus.
        self._held = True
        if self._later and self._later[0][0] <= at_ns:
            _, _, sender, frame = heapq.heappop(self._later)
            self._deliver(sender, frame)
        elif self._sender is not None and self._end_ns <= at_ns:
            self._finish()
        self._held = False
        self.start()

    def start(self) -> None:
        """Begin with the frame that wins the bus, if it is free and there is one."""
        if self._sender is not None or self._held or self.now_ns < self._free_ns:
            return
        if self.down:
            for port in self.ports:
                port.queue.clear()
            return
        best, first = None, (0, False, 0)
        for port in self.ports:
            if port.queue and (not port.off or port.present(self.now_ns)):
                order = priority(port.queue[0][0])
                if best is None or order < first:
                    best, first = port, order
        if best is not None:
            self._sender = best
            self._frame = best.queue[0]
            self._end_ns = self.now_ns + self.timing.frame_ns(*self._frame)

    def _finish(self) -> None:
        """The frame on the bus is over: see what becomes of it."""
        sender, self._sender = self._sender, None
        if sender is None or self.down or not sender.queue or sender.queue[0] is not self._frame:
            return  # the bus was torn down, or its sender left, while it was on its way
        can_id, data, fd = self._frame
        outcome = self.plan.frame(self.elapsed(self.now_ns), can_id, data)
        if outcome.destroyed:
            sender.fail(self.now_ns)  # and the frame stays where it was, to be sent again
            self._free_ns = self.now_ns + self.timing.bits_ns(ERROR_FRAME)
            return
        sender.queue.popleft()
        sender.errors = max(0, sender.errors - 1)
        for listener in self.listeners:
            listener(self.now_ns, can_id, data)
        if outcome.lost:
            return
        frame = (can_id, data if outcome.data is None else outcome.data, fd)
        for _ in range(2 if outcome.twice else 1):
            if outcome.late_ns:
                self._count += 1
                due = (self.now_ns + outcome.late_ns, self._count, sender, frame)
                heapq.heappush(self._later, due)
            else:
                self._deliver(sender, frame)

    def _deliver(self, sender: MediumPort, frame: Frame) -> None:
        if self.down:
            return
        can_id, data, self.fd = frame
        for port in self.ports:
            if port is sender or (port.ids is not None and can_id not in port.ids):
                continue
            if not port.off or port.present(self.now_ns):
                port.receiver(self.now_ns, can_id, data)
