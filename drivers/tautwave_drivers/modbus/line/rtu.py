"""Transactions on one serial line: one request at a time, with the silence the standard requires.

RTU responses have no sequence number. So after a request without a response, its drive is not asked
again until the longest time it can take is over (`late_s`), and a response counts only with the
right address, function, length and CRC. Unexpected bytes are drained before anything is sent.
Source: MODBUS over Serial Line V1.02, 2.4 and 2.5.1.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from tautwave.contracts import BytePort, Clock
from tautwave.errors import DriverError
from tautwave_drivers.causes import Cause
from tautwave_drivers.modbus.line.link import SLACK_NS, Link
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.protocol.frames import (
    REFUSED,
    Request,
    frame_in,
    rtu_request,
    take_rtu,
)
from tautwave_drivers.modbus.protocol.messages import (
    BEHIND_A_GATEWAY,
    NO_RTU,
    OF_CRC,
    OF_LENGTH,
    TOO_LATE,
    of_exception,
    of_function,
    of_unit,
)
from tautwave_drivers.modbus.protocol.transaction import Opener, Transaction

LONGEST = 1024


class RtuLink(Link):
    """One serial line and the drives on it.

    Parameters
    ----------
    opener : callable
        Opens the line.
    clock : Clock
        Time.
    options : ModbusOptions
        Baud rate, character, silences.
    """

    retry_ns = 200_000_000

    def __init__(self, opener: Opener, clock: Clock, options: ModbusOptions) -> None:
        super().__init__(opener, clock)
        self._char_ns = round(1e9 * options.bits / options.baud)
        self._gap_ns = round(1e9 * options.gap)
        self._late_ns = round(1e9 * options.late_s)
        response_s = options.turnaround + options.gap + options.latency_s
        self._response_ns = round(1e9 * response_s) + SLACK_NS
        self._waiting: Callable[[], bool] | None = None
        self._pending: Transaction | None = None
        self._quiet_ns = 0
        self._due_ns = 0
        self._missed: dict[int, tuple[int, Request]] = {}
        self._echoes = options.echo
        self._echo = b""
        self.heard: bytearray | None = None
        """All that comes, while it is not None."""

    @property
    def busy(self) -> bool:
        """Whether a response is waited for, or a transaction waits for its turn."""
        return self._pending is not None or bool(self._queue)

    @property
    def wake_ns(self) -> int | None:
        """When `pump` has something to do although nothing comes [ns]; None if never."""
        if self._pending is not None:
            return self._due_ns if self._queue else None
        if not self._queue:
            return None
        free = [self._missed.get(transaction.unit, (0,))[0] for transaction in self._queue]
        return max(self._quiet_ns, min(free))

    def connect(self) -> bool:
        """Open the line, or go on connecting to a server; raises `DriverError` if it fails."""
        if self.lost:
            if self._port is None:
                self._port = self._open()
            connected = getattr(self._port, "connected", None)
            try:
                if connected is not None and not connected():
                    return False
            except DriverError:
                self.close()
                raise
            self._waiting = getattr(self._port, "waiting", None)
            self.lost = ""
            self._buffer.clear()
            self._quiet_ns = self._clock.now_ns() + self._gap_ns
        return True

    def _begin(self, transactions: Sequence[Transaction]) -> None:
        self._queue.extend(transactions)
        if self._pending is not None or self._missed or self._buffer or self._port is None:
            self.pump()
            return
        # No response is due: whatever has come is unexpected.
        try:
            waiting = self._waiting
            unexpected = self._port.read() if waiting is None or waiting() else b""
            now = self._clock.now_ns()
            if unexpected:
                self.unexpected += len(unexpected)
                self._quiet_ns = now + self._gap_ns
            if now >= self._quiet_ns:
                self._send(self._port, now)
        except DriverError as err:
            self.drop(str(err))

    def pump(self) -> None:
        """Take in what has come, and send what follows from it; never waits."""
        port = self._port
        if self.lost or port is None:
            return
        try:
            data = port.read()
            now = self._clock.now_ns()
            if data:
                self._take(data, now)
            pending = self._pending
            if pending is not None and self._queue and now >= self._due_ns:
                self._miss(pending)
            if self._pending is None and self._queue and now >= self._quiet_ns:
                self._send(port, now)
        except DriverError as err:
            self.drop(str(err))

    def _take(self, data: bytes, now_ns: int) -> None:
        self._quiet_ns = now_ns + self._gap_ns
        buffer = self._buffer
        if self.heard is not None:
            self.heard += data
        if self._echo:
            data = self._without_echo(data)
        pending = self._pending
        if pending is not None:
            if buffer:
                buffer += data
                pdu = take_rtu(buffer, pending.unit, pending.request)
            else:
                pdu = take_rtu(data, pending.unit, pending.request)
                if pdu is None:
                    buffer += data
            if pdu is not None:
                buffer.clear()
                self._pending = None
                pending.take(pdu, now_ns)
                if self._silent:
                    self._silent.discard(pending.unit)
                if self.wrong:
                    self.wrong.pop(pending.unit, None)
                if pdu[0] & REFUSED and pdu[1] in BEHIND_A_GATEWAY:
                    self.note_wrong((pending.unit,), of_exception(pdu[1]))
                if pending.pending:
                    self._queue.appendleft(pending)
        else:
            buffer += data
            self._match_late(buffer)
        if len(buffer) > LONGEST:
            del buffer[:-LONGEST]

    def _without_echo(self, data: bytes) -> bytes:
        """Return what is left of `data` and all before it once the request itself is taken off."""
        heard = bytes(self._buffer) + data
        self._buffer.clear()
        if heard.startswith(self._echo):
            heard, self._echo = heard[len(self._echo) :], b""
        return heard

    def _match_late(self, buffer: bytearray) -> None:
        """Recognise a late response: its drive may be asked again."""
        for unit, (_, request) in list(self._missed.items()):
            if take_rtu(buffer, unit, request) is not None:
                del self._missed[unit]
                self.late += 1
                self.note_wrong((unit,), TOO_LATE)
                buffer.clear()
                return

    def _send(self, port: BytePort, now_ns: int) -> None:
        transaction = self._next(now_ns)
        if transaction is None:
            return
        if self._buffer:
            self.unexpected += len(self._buffer)
            self._buffer.clear()
        request = transaction.request
        frame = rtu_request(transaction.unit, request)
        port.write(frame)
        if self._echoes:
            self._echo = frame
        self._pending = transaction
        transaction.sent_ns.append(now_ns)
        wire_ns = (len(frame) + 3 + (request.size or LONGEST)) * self._char_ns
        self._due_ns = now_ns + wire_ns + self._response_ns

    def _next(self, now_ns: int) -> Transaction | None:
        """Take the first transaction whose drive owes no response out of the queue."""
        if not self._missed:
            return self._queue.popleft()
        for transaction in self._queue:
            if self._missed.get(transaction.unit, (0,))[0] <= now_ns:
                self._missed.pop(transaction.unit, None)
                self._queue.remove(transaction)
                return transaction
        return None

    def _miss(self, transaction: Transaction) -> None:
        """Give up a request that was sent, and remember that its response may still come."""
        self._missed[transaction.unit] = (
            transaction.sent_ns[-1] + self._late_ns,
            transaction.request,
        )
        self._silent.add(transaction.unit)
        self._pending = None
        if self._buffer:
            self.note_wrong((transaction.unit,), _cause(transaction, self._buffer))
        transaction.give_up()

    def watch(self) -> None:
        """A line cannot be half-open, and the loop looks after silent drives."""

    def _abandon_pending(self) -> None:
        if self._pending is not None:
            self._miss(self._pending)

    def drop(self, why: str) -> None:
        """Close the line; `lost` is `why`."""
        super().drop(why)
        self._missed.clear()


def _cause(transaction: Transaction, heard: bytes | bytearray) -> Cause:
    """Return why what was heard is no response to a request."""
    function = transaction.request.function
    frame = frame_in(heard)
    if frame is None:
        begins = heard[0] == transaction.unit and heard[1:2] in (
            bytes((function,)),
            bytes((function | REFUSED,)),
        )
        return OF_CRC if begins else NO_RTU
    if frame[0] != transaction.unit:
        return of_unit(frame[0], transaction.unit)
    return of_function(frame[1], function) if frame[1] != function else OF_LENGTH
