"""Transactions over one TCP connection: as many requests outstanding as the server takes.

Every request has a transaction identifier of its own; a response counts only with the identifier,
unit and function of a request that is still pending, so a late one is never taken for another's.
MODBUS Messaging on TCP/IP V1.0b lets a server refuse or drop what comes before it has answered
(4.4.1.1, NumberMaxOfServerTransaction); many drop it silently.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_drivers.causes import Cause
from tautwave_drivers.modbus.line.link import SLACK_NS, Link
from tautwave_drivers.modbus.protocol.frames import (
    REFUSED,
    may_be_tcp,
    only_tcp,
    take_tcp,
    tcp_request,
)
from tautwave_drivers.modbus.protocol.messages import (
    BEHIND_A_GATEWAY,
    CUT_SHORT,
    NO_TCP,
    OF_LENGTH,
    OF_TRANSACTION,
    TOO_LATE,
    of_exception,
    of_function,
    of_unit,
)
from tautwave_drivers.modbus.protocol.transaction import Opener, Transaction


class TcpLink(Link):
    """One connection and the drives behind it.

    Parameters
    ----------
    opener : callable
        Begins to connect.
    clock : Clock
        Time.
    silence_s : float
        Without a response, after which the connection counts as dead.
    outstanding : int
        Requests that may be outstanding at once.
    late_s : float
        Longest time a response takes; a slower drive no longer delays the next.
    """

    retry_ns = 100_000_000

    def __init__(
        self,
        opener: Opener,
        clock: Clock,
        silence_s: float,
        outstanding: int = 1,
        late_s: float = 0.02,
    ) -> None:
        super().__init__(opener, clock)
        self.outstanding = outstanding
        self._late_ns = round(late_s * 1e9)
        self._slowest_ns = self._late_ns
        self._silence_ns = round(silence_s * 1e9)
        self._connecting = False
        self._pending: dict[int, Transaction] = {}
        self._last_id = 0
        self._unanswered_ns = 0
        self._given_up: deque[int] = deque(maxlen=256)

    @property
    def busy(self) -> bool:
        """Whether a response is waited for, or a transaction waits for its turn."""
        return bool(self._pending) or bool(self._queue)

    @property
    def wake_ns(self) -> int | None:
        """When `pump` has something to do although nothing comes [ns]; None if never."""
        if not self._queue or not self._pending:
            return None
        return (
            min(transaction.sent_ns[-1] for transaction in self._pending.values())
            + self._timeout_ns
        )

    @property
    def _timeout_ns(self) -> int:
        """How long other drives wait for a response: twice the slowest recent one."""
        return min(self._late_ns, 2 * self._slowest_ns + SLACK_NS)

    def connect(self) -> bool:
        """Go on connecting; raises `DriverError` if the connection is refused."""
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

    def _begin(self, transactions: Sequence[Transaction]) -> None:
        room = self.outstanding - len(self._pending)
        if len(transactions) > room or self._queue:
            self._queue.extend(transactions)
            transactions = self._next()
        if transactions:
            self._send(transactions, self._clock.now_ns())

    def _next(self) -> list[Transaction]:
        """Take as many out of the queue as may be sent."""
        room = self.outstanding - len(self._pending)
        return [self._queue.popleft() for _ in range(min(room, len(self._queue)))]

    def _send(self, transactions: Sequence[Transaction], now_ns: int) -> None:
        assert self._port is not None
        frames = []
        for transaction in transactions:
            self._last_id = transaction_id = self._last_id % 0xFFFF + 1
            self._pending[transaction_id] = transaction
            transaction.sent_ns.append(now_ns)
            frames.append(tcp_request(transaction_id, transaction.unit, transaction.request))
        if not self._unanswered_ns:
            self._unanswered_ns = now_ns
        try:
            self._port.write(frames[0] if len(frames) == 1 else b"".join(frames))
        except DriverError as err:
            self.drop(str(err))

    def pump(self) -> None:
        """Take in what has come, and send what follows from it; never waits."""
        if self.lost or self._port is None:
            return
        try:
            data = self._port.read()
        except DriverError as err:
            self.drop(str(err))
            return
        if data:
            self._receive(data, self._clock.now_ns())
        if self._queue and not self.lost:
            self._go_on(self._clock.now_ns())

    def _go_on(self, now_ns: int) -> None:
        """Send the next in place of those that have finished or take too long."""
        limit_ns = now_ns - self._timeout_ns
        for transaction_id, transaction in list(self._pending.items()):
            if transaction.sent_ns[-1] <= limit_ns:
                self._give_up(transaction_id)
        transactions = self._next()
        if transactions:
            self._send(transactions, now_ns)

    def _receive(self, data: bytes, now: int) -> None:
        buffer = self._buffer
        if not buffer and (response := only_tcp(data)) is not None:
            self._take(*response, now)
            return
        if buffer:
            buffer += data
            self._align(buffer)
        else:
            buffer += data
        while may_be_tcp(buffer) and (response := take_tcp(buffer)) is not None:
            self._take(*response, now)
        if not may_be_tcp(buffer):  # nor is there a way to find the next header
            self.unexpected += 1
            self.note_wrong(self._owing(), NO_TCP)
            buffer.clear()

    def _align(self, buffer: bytearray) -> None:
        """Drop what stands before the first pending response.

        A peer that broke off in the middle of a response would shift all that follow.
        """
        places = [
            buffer.find(transaction_id.to_bytes(2, "big") + b"\0\0\0")
            for transaction_id in self._pending
        ]
        at = min((place for place in places if place >= 0), default=0)
        del buffer[:at]

    def _take(self, transaction_id: int, unit: int, pdu: bytes, now_ns: int) -> None:
        transaction = self._pending.get(transaction_id)
        if transaction is None and transaction_id in self._given_up:
            self.late += 1
            self.note_wrong(self._owing(), TOO_LATE)
        elif transaction is None:
            self.unexpected += 1
            self.note_wrong(self._owing(), OF_TRANSACTION)
        elif transaction.unit == unit and transaction.request.fits(pdu):
            if self.wrong:
                self.wrong.pop(unit, None)
            if pdu[0] & REFUSED and pdu[1] in BEHIND_A_GATEWAY:
                self.note_wrong((unit,), of_exception(pdu[1]))
            del self._pending[transaction_id]
            self._unanswered_ns = 0
            spent_ns = now_ns - transaction.sent_ns[-1]
            slowest_ns = self._slowest_ns
            self._slowest_ns = spent_ns if spent_ns > slowest_ns else slowest_ns - (slowest_ns >> 6)
            if self._silent:
                self._silent.discard(unit)
            transaction.take(pdu, now_ns)
            if transaction.pending:
                self._send((transaction,), now_ns)
        else:
            self.unexpected += 1
            self.note_wrong((transaction.unit,), _cause(transaction, unit, pdu))

    def _owing(self) -> set[int]:
        return {transaction.unit for transaction in self._pending.values()}

    def watch(self) -> None:
        """Drop a half-open connection: it stands, but nothing comes, and no error says so."""
        span_ns = self._clock.now_ns() - self._unanswered_ns
        if self._unanswered_ns and span_ns > self._silence_ns and not self.lost:
            self.drop(
                f"no response for {span_ns * 1e-6:.0f} ms although the connection is open "
                "(half-open): the drive hangs or its cable is unplugged"
            )

    def _abandon_pending(self) -> None:
        for transaction_id in list(self._pending):
            self._give_up(transaction_id)

    def _give_up(self, transaction_id: int) -> None:
        transaction = self._pending.pop(transaction_id)
        self._given_up.append(transaction_id)
        self._silent.add(transaction.unit)
        transaction.give_up()
        if self._buffer.startswith(transaction_id.to_bytes(2, "big") + b"\0\0\0"):
            self.note_wrong((transaction.unit,), CUT_SHORT)

    def drop(self, why: str) -> None:
        """Close the connection; `lost` is `why`."""
        super().drop(why)
        self._unanswered_ns = 0

    def close(self) -> None:
        """Release the connection; idempotent."""
        self._connecting = False
        super().close()


def _cause(transaction: Transaction, unit: int, pdu: bytes) -> Cause:
    """Return why a frame with the right transaction id is no response."""
    if unit != transaction.unit:
        return of_unit(unit, transaction.unit)
    function = pdu[0] & ~REFUSED
    if function != transaction.request.function:
        return of_function(function, transaction.request.function)
    return OF_LENGTH
