"""Exchanges on one serial line: one question at a time, with the silence the standard wants.

RTU answers have no number. So after a question without an answer its drive is not asked again until
the longest time it can take is over (`late_s`), and an answer counts only with the right address,
function, length and CRC. What comes unasked is drained before anything is sent.
Source: MODBUS over Serial Line V1.02, 2.4 and 2.5.1.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

from tautwave.contracts import BytePort, Clock
from tautwave.errors import DriverError
from tautwave_drivers.modbus.errand import Errand, Opener
from tautwave_drivers.modbus.frames import Question, rtu_question, take_rtu
from tautwave_drivers.modbus.options import ModbusOptions

RETRY_NS = 200_000_000
LONGEST = 1024
SLACK_NS = 2_000_000
"""What the host may add before a drive counts as silent and the next one is asked."""


class RtuLink:
    """One line and the drives on it.

    Parameters
    ----------
    opener : callable
        Opens the line.
    clock : Clock
        Time.
    options : ModbusOptions
        Baud rate, character, silences.

    Attributes
    ----------
    lost : str
        Why there is no line, else ''.
    late, strange : int
        Answers that came after they were given up, and bytes that were no answer.
    """

    def __init__(self, opener: Opener, clock: Clock, options: ModbusOptions) -> None:
        self._open = opener
        self._clock = clock
        self._char_ns = round(1e9 * options.bits / options.baud)
        self._gap_ns = round(1e9 * options.gap)
        self._late_ns = round(1e9 * options.late_s)
        answer_s = options.turnaround + options.gap + options.latency_s
        self._answer_ns = round(1e9 * answer_s) + SLACK_NS
        self._port: BytePort | None = None
        self._waiting: Callable[[], bool] | None = None
        self._queue: deque[Errand] = deque()
        self._asked: Errand | None = None
        self._buffer = bytearray()
        self._quiet_ns = 0
        self._due_ns = 0
        self._missed: dict[int, tuple[int, Question]] = {}
        self._silent: set[int] = set()
        self._retry_ns = 0
        self.lost = "not open yet"
        self.late = 0
        self.strange = 0

    @property
    def port(self) -> BytePort | None:
        """The line, once it is open."""
        return None if self.lost else self._port

    @property
    def busy(self) -> bool:
        """Whether something is asked, or waits to be."""
        return self._asked is not None or bool(self._queue)

    @property
    def wake_ns(self) -> int | None:
        """When something has to be done although nothing comes [ns]; None if never."""
        if self._asked is not None:
            return self._due_ns if self._queue else None
        if not self._queue:
            return None
        free = [self._missed.get(errand.unit, (0,))[0] for errand in self._queue]
        return max(self._quiet_ns, min(free))

    def connect(self) -> bool:
        """Open the line.

        Raises
        ------
        DriverError
            It cannot be opened.
        """
        if self.lost:
            self._port = self._open()
            self._waiting = getattr(self._port, "waiting", None)
            self.lost = ""
            self._buffer.clear()
            self._quiet_ns = self._clock.now_ns() + self._gap_ns
        return True

    def retry(self) -> bool:
        """Try to open the line again, seldom enough; return whether it is open."""
        if not self.lost or self._clock.now_ns() < self._retry_ns:
            return not self.lost
        try:
            return self.connect()
        except DriverError as err:
            self.drop(str(err))
            return False

    def start(self, errands: Sequence[Errand]) -> None:
        """Ask the first, and have the others wait for their turn."""
        if self.lost:
            for errand in errands:
                errand.give_up()
            return
        if self._silent:  # who did not answer last time is asked last, and costs nobody else
            errands = sorted(errands, key=lambda errand: errand.unit in self._silent)
        self._queue.extend(errands)
        if self._asked is not None or self._missed or self._buffer or self._port is None:
            self.pump()
            return
        # Everybody has answered: whatever has come since is no answer.
        try:
            waiting = self._waiting
            strange = self._port.read() if waiting is None or waiting() else b""
            now = self._clock.now_ns()
            if strange:
                self.strange += len(strange)
                self._quiet_ns = now + self._gap_ns
            if now >= self._quiet_ns:
                self._send(self._port, now)
        except DriverError as err:
            self.drop(str(err))

    def pump(self) -> None:
        """Take in what has come, and ask what follows from it; never waits."""
        port = self._port
        if self.lost or port is None:
            return
        try:
            data = port.read()
            now = self._clock.now_ns()
            if data:
                self._take(data, now)
            asked = self._asked
            if asked is not None and self._queue and now >= self._due_ns:
                self._miss(asked)
            if self._asked is None and self._queue and now >= self._quiet_ns:
                self._send(port, now)
        except DriverError as err:
            self.drop(str(err))

    def _take(self, data: bytes, now_ns: int) -> None:
        self._quiet_ns = now_ns + self._gap_ns
        buffer = self._buffer
        asked = self._asked
        if asked is not None:
            if buffer:
                buffer += data
                pdu = take_rtu(buffer, asked.unit, asked.question)
            else:
                pdu = take_rtu(data, asked.unit, asked.question)
                if pdu is None:
                    buffer += data
            if pdu is not None:
                buffer.clear()
                self._asked = None
                asked.take(pdu, now_ns)
                if self._silent:
                    self._silent.discard(asked.unit)
                if asked.under_way:
                    self._queue.appendleft(asked)
        else:
            buffer += data
            self._forgive(buffer)
        if len(buffer) > LONGEST:
            del buffer[:-LONGEST]

    def _forgive(self, buffer: bytearray) -> None:
        """A late answer has come: its drive may be asked again."""
        for unit, (_, question) in list(self._missed.items()):
            if take_rtu(buffer, unit, question) is not None:
                del self._missed[unit]
                self.late += 1
                buffer.clear()
                return

    def _send(self, port: BytePort, now_ns: int) -> None:
        errand = self._next(now_ns)
        if errand is None:
            return
        if self._buffer:
            self.strange += len(self._buffer)
            self._buffer.clear()
        question = errand.question
        frame = rtu_question(errand.unit, question)
        port.write(frame)
        self._asked = errand
        errand.asked_ns.append(now_ns)
        wire_ns = (len(frame) + 3 + (question.size or LONGEST)) * self._char_ns
        self._due_ns = now_ns + wire_ns + self._answer_ns

    def _next(self, now_ns: int) -> Errand | None:
        """Take the first errand whose drive owes no answer out of the queue."""
        if not self._missed:
            return self._queue.popleft()
        for errand in self._queue:
            if self._missed.get(errand.unit, (0,))[0] <= now_ns:
                self._missed.pop(errand.unit, None)
                self._queue.remove(errand)
                return errand
        return None

    def _miss(self, errand: Errand) -> None:
        """Give up a question that was asked, and remember that its answer may still come."""
        self._missed[errand.unit] = (errand.asked_ns[-1] + self._late_ns, errand.question)
        self._silent.add(errand.unit)
        self._asked = None
        errand.give_up()

    def watch(self) -> None:
        """A line cannot be half-open; drives that are silent are the loop's matter."""

    def abandon(self) -> None:
        """Wait for nothing any more; who has not answered yet is left alone for a while."""
        if self._asked is not None:
            self._miss(self._asked)
        for errand in self._queue:
            errand.give_up()
        self._queue.clear()

    def drop(self, why: str) -> None:
        """Close the line; `why` is told."""
        self.abandon()
        self._missed.clear()
        self.lost = why
        self._retry_ns = self._clock.now_ns() + RETRY_NS
        self.close()

    def close(self) -> None:
        """Release the line; idempotent."""
        port, self._port = self._port, None
        self.lost = self.lost or "closed"
        if port is not None:
            port.close()
