"""A CAN bus in virtual time between our driver and foreign drives."""

from __future__ import annotations

import heapq
import itertools

from tautwave.contracts import Clock
from tests.foreign.cia402 import ForeignDrive, Key

TICK_NS = 500_000
"""How often the drives look at their timers and motors."""
OUT_NS, IN_NS = 120_000, 150_000
LATER_NS = 400_000
"""How much later a slower drive answers."""


class ForeignBus:
    """The driver's port, with drives behind it.

    Parameters
    ----------
    clock : Clock
        The driver's.
    numbers : sequence of int
        Node ids.
    objects : dict
        Values of objects of the first drive; others have their defaults.
    more : ...
        More of the first drive's: `lacks`, `fixed`, `pdos`.
    """

    def __init__(
        self,
        clock: Clock,
        numbers: tuple[int, ...] = (1,),
        objects: dict[Key, int] | None = None,
        **more: object,
    ) -> None:
        self._clock = clock
        self.cut = False
        """Nothing that the driver sends arrives any more."""
        self.response_ns = IN_NS
        """How long a response by SDO takes."""
        self.now_ns = clock.now_ns()
        self._next_tick = self.now_ns + TICK_NS
        self._order = itertools.count()
        self._queue: list[tuple[int, int, bool, int, bytes]] = []
        self._inbox: list[tuple[int, bytes, int]] = []
        self.drives = [
            ForeignDrive(number, self._from_drive, objects if not at else None, **more)  # type: ignore[arg-type]
            for at, number in enumerate(numbers)
        ]

    def _from_drive(self, can_id: int, data: bytes) -> None:
        takes = self.response_ns if can_id & ~0x7F == 0x580 else IN_NS
        self._push(self.now_ns + takes, False, can_id, data)

    def late_from_drive(self, can_id: int, data: bytes) -> None:
        """Take a frame of a slower drive."""
        self._push(self.now_ns + IN_NS + LATER_NS, False, can_id, data)

    def _push(self, at_ns: int, outward: bool, can_id: int, data: bytes) -> None:
        heapq.heappush(self._queue, (at_ns, next(self._order), outward, can_id, bytes(data)))

    def send(self, can_id: int, data: bytes) -> bool:
        self.advance(self._clock.now_ns())
        if not self.cut:
            self._push(self.now_ns + OUT_NS, True, can_id, data)
        return True

    def controller_says(self, can_id: int, data: bytes) -> None:
        """Have the controller report something by an error frame (CAN_ERR_FLAG set)."""
        self._push(self.now_ns, False, can_id | 0x20000000, data)

    def receive(self) -> tuple[int, bytes, int] | None:
        return self._inbox.pop(0) if self._inbox else None

    def readable(self) -> bool:
        return bool(self._inbox)

    def next_event_ns(self) -> int:
        return min(self._next_tick, self._queue[0][0]) if self._queue else self._next_tick

    def advance(self, to_ns: int) -> None:
        while (at_ns := self.next_event_ns()) <= to_ns:
            self.now_ns = max(self.now_ns, at_ns)
            if self._queue and self._queue[0][0] <= at_ns:
                _, _, outward, can_id, data = heapq.heappop(self._queue)
                if not outward:
                    self._inbox.append((can_id, data, self.now_ns))
                    continue
                for drive in self.drives:
                    drive.take(can_id, data, self.now_ns * 1e-9)
            else:
                self._next_tick += TICK_NS
                for drive in self.drives:
                    drive.run(self.now_ns * 1e-9)
        self.now_ns = max(self.now_ns, to_ns)

    def close(self) -> None:
        """Nothing is held."""
