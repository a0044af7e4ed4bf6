"""Exchanges over one TCP connection: all questions out before any answer is read.

Every request has a transaction number of its own; an answer counts only with the number, unit and
function of a question that is still waited for, so a late one is never taken for another's.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import BytePort, Clock
from tautwave.errors import DriverError
from tautwave_drivers.modbus.errand import Errand, Opener
from tautwave_drivers.modbus.frames import only_tcp, take_tcp, tcp_question

RETRY_NS = 100_000_000
LONGEST = 4096


class TcpLink:
    """One connection and the drives behind it.

    Parameters
    ----------
    opener : callable
        Begins to connect.
    clock : Clock
        Time.
    silence_s : float
        Without an answer, after which the connection counts as dead.

    Attributes
    ----------
    lost : str
        Why there is no connection, else ''.
    late, strange : int
        Answers to questions given up, and answers to none.
    """

    def __init__(self, opener: Opener, clock: Clock, silence_s: float) -> None:
        self._open = opener
        self._clock = clock
        self._silence_ns = round(silence_s * 1e9)
        self._port: BytePort | None = None
        self._connecting = False
        self._buffer = bytearray()
        self._waited: dict[int, Errand] = {}
        self._transaction = 0
        self._heard_ns = 0
        self._unanswered_ns = 0
        self._retry_ns = 0
        self.lost = "not connected yet"
        self.late = 0
        self.strange = 0

    @property
    def port(self) -> BytePort | None:
        """The connection, once it is there."""
        return None if self.lost else self._port

    @property
    def busy(self) -> bool:
        """Whether an answer is waited for."""
        return bool(self._waited)

    @property
    def wake_ns(self) -> int | None:
        """When something has to be done by itself: never."""
        return None

    def connect(self) -> bool:
        """Go on connecting, without waiting; return whether the connection is there.

        Raises
        ------
        DriverError
            It is refused.
        """
        if not self.lost:
            return True
        if self._port is None:
            self._port = self._open()
            self._connecting = True
        connected = getattr(self._port, "connected", None)
        try:
            there = connected is None or connected()
        except DriverError:
            self.close()
            raise
        if self._connecting and there:
            self._connecting = False
            self.lost = ""
            self._buffer.clear()
            self._unanswered_ns = 0
        return not self.lost

    def retry(self) -> bool:
        """Try to connect again, seldom enough; return whether the connection is there."""
        now = self._clock.now_ns()
        if not self.lost or now < self._retry_ns:
            return not self.lost
        try:
            return self.connect()
        except DriverError as err:
            self.drop(str(err))
            return False

    def start(self, errands: Sequence[Errand]) -> None:
        """Send the first question of each; `lost` says why where that fails."""
        if not self.lost:
            self._send(errands, self._clock.now_ns())
            return
        for errand in errands:
            errand.give_up()

    def _send(self, errands: Sequence[Errand], now_ns: int) -> None:
        assert self._port is not None
        frames = []
        for errand in errands:
            self._transaction = transaction = self._transaction % 0xFFFF + 1
            self._waited[transaction] = errand
            errand.asked_ns.append(now_ns)
            frames.append(tcp_question(transaction, errand.unit, errand.question))
        if not self._unanswered_ns:
            self._unanswered_ns = now_ns
        try:
            self._port.write(frames[0] if len(frames) == 1 else b"".join(frames))
        except DriverError as err:
            self.drop(str(err))

    def pump(self) -> None:
        """Take in what has come, and ask what follows from it; never waits."""
        if self.lost or self._port is None:
            return
        try:
            data = self._port.read()
        except DriverError as err:
            self.drop(str(err))
            return
        if not data:
            return
        now = self._clock.now_ns()
        buffer = self._buffer
        if not buffer and (found := only_tcp(data)) is not None:
            self._take(*found, now)
            return
        if buffer:
            buffer += data
            self._align(buffer)
        else:
            buffer += data
        while (found := take_tcp(buffer)) is not None:
            self._take(*found, now)
        if len(buffer) > LONGEST:
            buffer.clear()

    def _align(self, buffer: bytearray) -> None:
        """Drop what stands before an answer that is waited for.

        A peer that broke off in the middle of an answer would shift all that follow.
        """
        places = [
            buffer.find(transaction.to_bytes(2, "big") + b"\0\0\0") for transaction in self._waited
        ]
        at = min((place for place in places if place >= 0), default=0)
        del buffer[:at]

    def _take(self, transaction: int, unit: int, pdu: bytes, now_ns: int) -> None:
        errand = self._waited.get(transaction)
        if errand is None:
            self.late += 1
        elif errand.unit == unit and errand.question.fits(pdu):
            del self._waited[transaction]
            self._unanswered_ns = 0
            errand.take(pdu, now_ns)
            if errand.under_way:
                self._send((errand,), now_ns)
        else:
            self.strange += 1

    def watch(self) -> None:
        """Drop a connection that stands but answers nothing: nobody says that it is half-open."""
        span_ns = self._clock.now_ns() - self._unanswered_ns
        if self._unanswered_ns and span_ns > self._silence_ns and not self.lost:
            self.drop(
                f"nothing answers for {span_ns * 1e-6:.0f} ms, though the connection stands "
                "(half-open): the drive hangs or its cable is out"
            )

    def abandon(self) -> None:
        """Wait for nothing any more; what comes late will not be believed."""
        for errand in self._waited.values():
            errand.give_up()
        self._waited.clear()

    def drop(self, why: str) -> None:
        """Close the connection; `why` is told."""
        self.abandon()
        self.lost = why
        self._unanswered_ns = 0
        self._retry_ns = self._clock.now_ns() + RETRY_NS
        self.close()

    def close(self) -> None:
        """Release the connection; idempotent."""
        port, self._port = self._port, None
        self._connecting = False
        self.lost = self.lost or "closed"
        if port is not None:
            port.close()
