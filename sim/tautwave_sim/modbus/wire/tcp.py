"""Drives behind TCP: sessions, responses and their times, and how a connection fails.

One `TcpSide` is one endpoint with its drives. It runs by events and knows no sockets: a session in
memory and one on a real socket are the same object.
"""

from __future__ import annotations

from tautwave.contracts import Clock
from tautwave.errors import DriverError
from tautwave_sim.modbus.bus import BROADCAST, DriveBus
from tautwave_sim.modbus.faults import LinkFailure, Outcome, corrupt
from tautwave_sim.modbus.registers import NO_ANSWER_BEHIND
from tautwave_sim.modbus.wire.framing import TcpRequest, TcpStream, tcp_frame
from tautwave_sim.modbus.wire.protocol import exception
from tautwave_sim.wire.schedule import Schedule

DIRECT = 255
"""Unit that means the only drive behind an endpoint (TCP guide, 4.4.2.1)."""
HEADERS = 78
"""Bytes around a payload on Ethernet: preamble, MAC, IPv4, TCP, FCS and gap."""
NS_PER_BYTE = 80
"""At 100 Mbit/s."""


def segment_ns(count: int) -> int:
    """Return how long a segment with that many bytes of payload is on the wire [ns]."""
    return (count + HEADERS) * NS_PER_BYTE


class Session:
    """One connection, seen from the drives' side.

    `out` holds what has come back; `broken` is set once it was reset, `deaf` when it is half open.
    """

    def __init__(self) -> None:
        self.stream = TcpStream()
        self.out = bytearray()
        self.broken = False
        self.deaf = False


class TcpSide(Schedule):
    """One endpoint, run by events.

    Parameters
    ----------
    bus : DriveBus
        All drives of the bus.
    units : tuple of int
        Those behind this endpoint.
    wire : bool
        Whether segments take wire time; a real network has its own.
    """

    def __init__(self, bus: DriveBus, units: tuple[int, ...], wire: bool = True) -> None:
        super().__init__()
        self._bus = bus
        self._units = units
        self._wire = wire
        self._free_ns = dict.fromkeys(units, 0)
        self.sessions: list[Session] = []
        self._refuses_ns: int | None = None

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns], failures of the link last."""
        super().advance(to_ns)
        for failure in self._bus.plan.link_failures(self._bus.elapsed_ns(self._now_ns)):
            self.fail(failure, self._now_ns)

    # -------------------------------------------------------------------------- connections

    def refuses(self, now_ns: int) -> bool:
        """Return whether a new connection is refused now."""
        return self._refuses_ns is not None and now_ns < self._refuses_ns

    def connect(self) -> Session:
        """Return a new session."""
        session = Session()
        self.sessions.append(session)
        return session

    def leave(self, session: Session) -> None:
        """Forget a session that its master has closed."""
        if session in self.sessions:
            self.sessions.remove(session)

    def fail(self, failure: LinkFailure, now_ns: int) -> None:
        """Have the link fail in one of its ways."""
        if failure.kind in ("refused", "gone"):
            span_ns = failure.span_ns or 1 << 62
            self._refuses_ns = now_ns + span_ns
        if failure.kind in ("reset", "gone"):
            for session in self.sessions:
                session.broken = True
                session.out.clear()
            self.sessions.clear()
        if failure.kind == "half_open":
            for session in self.sessions:
                session.deaf = True
            if failure.span_ns:
                self._refuses_ns = now_ns + failure.span_ns

    # --------------------------------------------------------------------------- requests

    def receive(self, session: Session, data: bytes, now_ns: int) -> None:
        """Take a segment whose first byte leaves its master at `now_ns`."""
        self.advance(now_ns)
        if session.broken or session.deaf:
            return
        arrival_ns = now_ns + (segment_ns(len(data)) if self._wire else 0)
        for request in session.stream.feed(data):
            unit = self._unit(request.unit)
            self._bus.latch(unit, request.pdu, now_ns)
            self._deliver(session, request._replace(unit=unit), request.unit, arrival_ns)

    def _deliver(self, session: Session, request: TcpRequest, unit_id: int, at_ns: int) -> None:
        self.call_at(at_ns, lambda: self._serve(session, request, unit_id, at_ns))

    def _unit(self, unit_id: int) -> int:
        """Return the drive that is meant: 255 is the only one there is."""
        return self._units[0] if unit_id == DIRECT and len(self._units) == 1 else unit_id

    def _serve(self, session: Session, request: TcpRequest, unit_id: int, now_ns: int) -> None:
        if session.broken or session.deaf:
            return
        unit = request.unit
        if unit != BROADCAST and unit not in self._units:
            refused = exception(request.pdu, NO_ANSWER_BEHIND)
            self._send(session, tcp_frame(request.transaction, unit_id, refused), now_ns)
            return
        response, outcome = self._bus.handle(unit, request.pdu, now_ns)
        if outcome.link is not None:
            self.fail(outcome.link, now_ns)
        if response is None or session.broken or session.deaf:
            return
        begin_ns = max(now_ns, self._free_ns[unit])  # one task serves a drive's requests
        self._free_ns[unit] = done_ns = begin_ns + self._bus.response_ns(unit)
        self._send(
            session, self._frame(request.transaction, unit_id, response, outcome), done_ns, outcome
        )

    def _frame(self, transaction: int, unit: int, response: bytes, outcome: Outcome) -> bytes:
        if outcome.wrong_unit:
            unit = unit % 247 + 1
        if outcome.flip is not None:  # TCP has a checksum: what can be wrong is the number
            transaction ^= 1 << int(outcome.flip * 16)
            outcome = outcome._replace(flip=None)
        frame = tcp_frame(transaction, unit, response)
        return corrupt(frame, outcome)

    def _send(
        self, session: Session, frame: bytes, at_ns: int, outcome: Outcome | None = None
    ) -> None:
        if not frame:
            return
        late_ns = 0 if outcome is None else outcome.late_ns
        wire_ns = segment_ns(len(frame)) if self._wire else 0
        self.call_at(at_ns + wire_ns + late_ns, lambda: self._arrive(session, frame))

    def _arrive(self, session: Session, frame: bytes) -> None:
        if not session.broken and not session.deaf:
            session.out += frame


class TcpMemoryPort:
    """The master's end of a connection in this process: a `BytePort` run by a clock."""

    def __init__(self, side: TcpSide, clock: Clock, name: str) -> None:
        self._side = side
        self._clock = clock
        self._name = name
        self._session = side.connect()

    def write(self, data: bytes) -> None:
        """Hand bytes to the connection; raises `DriverError` when it was reset."""
        self._side.advance(self._clock.now_ns())
        self._check()
        self._side.receive(self._session, bytes(data), self._clock.now_ns())

    def read(self) -> bytes:
        """Return all that has come; raises `DriverError` when it was reset."""
        self._side.advance(self._clock.now_ns())
        self._check()
        taken = bytes(self._session.out)
        self._session.out.clear()
        return taken

    def close(self) -> None:
        """Close the connection; idempotent."""
        self._side.leave(self._session)

    def next_event_ns(self) -> int | None:
        """Return when something happens next by itself [ns]."""
        return self._side.next_event_ns()

    def advance(self, to_ns: int) -> None:
        """Process all events up to `to_ns` [ns]."""
        self._side.advance(to_ns)

    def readable(self) -> bool:
        """Return whether there is something to read, or the connection was reset."""
        return bool(self._session.out) or self._session.broken

    def _check(self) -> None:
        if self._session.broken:
            raise DriverError(f"{self._name}: connection reset by the drive; connect again")
