"""Frames of one bus, cycle by cycle: requests out, answers in until all are there or time is up.

A port that fails ends in `lost`, never in an exception: the loop stops its axes then. A full queue
is waited for: what is in it is stale, so nothing is added until it has drained.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tautwave.contracts import Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.can.batches import Frame, receiving, sending, waiting
from tautwave_drivers.can.errors import error_text
from tautwave_drivers.can.framing import ERROR_FRAME
from tautwave_drivers.can.full_queue import CHECK, FullQueue

MANY = 64
"""Frames that are taken at once."""


class Exchange:
    """One end of a bus from its opening to its end.

    Parameters
    ----------
    port : FramePort
        Where frames go and come.
    clock : Clock
        What waits.
    take : callable
        Takes frames, each with identifier, data and arrival [ns]; returns how many answers that
        were missing are among them. Those with an id that it does not know it gives to `strange`.
    remedy : str
        What to do about a queue that stays full.

    Attributes
    ----------
    missing : int
        Answers still to come in this cycle; set by the caller.
    lost : str
        Why the bus cannot be used any more, else ''.
    told : list of str
        What `reports` will return.
    """

    def __init__(
        self,
        port: FramePort,
        clock: Clock,
        take: Callable[[Sequence[Frame]], int],
        remedy: str = CHECK,
    ) -> None:
        self.port = port
        self._clock = clock
        self._take = take
        self._runs = hasattr(port, "advance")
        self._send_all, self._receive_some = sending(port), receiving(port)
        self._waiting = waiting(port)
        self.missing = 0
        self.lost = ""
        self.told: list[str] = []
        self._counts: dict[str, int] = {}
        self._queue = FullQueue(remedy)
        self._received = 0

    def begin(self) -> bool:
        """Take in what is left of the last cycle; return whether frames may be sent now."""
        self.drain()
        self.missing = 0  # what was left of the last cycle answers nothing of this one
        if self.lost:
            return False
        if not self._queue.cycles:
            return True
        drained = self._queue.drained(self.port, self._received)
        if self._queue.dead:
            self.lose(self._queue.dead)
        return drained

    def send(self, can_id: int, data: bytes) -> bool:
        """Send a frame; False where it did not go out."""
        if self.lost:
            return False
        try:
            if self.port.send(can_id, data):
                if self._queue.cycles:
                    self.report(self._queue.accepts_again())
                return True
        except DriverError as err:
            self.lose(str(err))
            return False
        self._queue.refused(self._received)
        return False

    def ask(self, requests: Sequence[tuple[int, bytes]]) -> None:
        """Send requests, each of which has one answer in this cycle."""
        try:
            if not self._queue.cycles:
                sent = self._send_all(requests)
                self.missing += sent
                if sent < len(requests):
                    self._queue.refused(self._received)
                return
        except DriverError as err:
            self.lose(str(err))
            return
        for can_id, data in requests:
            if not self.send(can_id, data):
                return
            self.missing += 1

    def drain(self) -> None:
        """Take in everything that has arrived, without waiting."""
        try:
            if self._runs:  # a simulated bus, up to now
                self._clock.wait(self.port, self._clock.now_ns())
            while self._waiting() and (frames := self._receive_some(MANY)):
                self._received += len(frames)
                self.missing -= self._take(frames)
        except DriverError as err:
            self.lose(str(err))

    def collect(self, deadline_ns: int) -> None:
        """Take frames until no answer is missing, or the time is up."""
        receive, take = self._receive_some, self._take
        try:
            while self.missing > 0 and not self.lost:
                frames = receive(self.missing)
                if not frames and not self._clock.wait(self.port, deadline_ns):
                    return
                self._received += len(frames)
                self.missing -= take(frames)
        except DriverError as err:
            self.lose(str(err))

    def lose(self, text: str) -> None:
        """Declare the bus lost."""
        self.lost = self.lost or text

    def report(self, text: str) -> None:
        """Report something about the bus; repeats are reported at 10, 100, 1000 ... times."""
        count = self._counts[text] = self._counts.get(text, 0) + 1
        if str(count).strip("0") == "1":
            self.told.append(text + (f" ({count} times)" if count > 1 else ""))

    def reports(self) -> list[str]:
        """Return what was reported since the last call."""
        reported, self.told = self.told, []
        return reported

    def strange(self, can_id: int, data: bytes) -> None:
        """Take a frame of an unknown id: report an error frame, or take the bus for lost."""
        if not can_id & ERROR_FRAME:
            return
        text, lost = error_text(can_id, data)
        if lost:
            self.lose(text)
        else:
            self.report(f"CAN: {text}")
