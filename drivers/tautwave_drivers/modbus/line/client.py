"""One request and its response, waited for: before and after the loop, and for `scan`."""

from __future__ import annotations

from tautwave.contracts import Clock
from tautwave.errors import BusTimeout, DeviceFault, DriverError
from tautwave_drivers.modbus.line.link import Link
from tautwave_drivers.modbus.line.rtu import RtuLink
from tautwave_drivers.modbus.protocol.frames import REFUSED, Request, rtu_request, take_rtu
from tautwave_drivers.modbus.protocol.transaction import Transaction
from tautwave_drivers.modbus.sequence import Procedure, is_busy, refusal
from tautwave_drivers.modbus.station import Station
from tautwave_drivers.patience import SPARE, Patience

TRIES = 5
BUSY_S = 3.0
"""How long a drive may be busy, or take for what it accepted: storing takes seconds."""
PAUSE_NS = 5_000_000


def wait_on(link: Link, clock: Clock, until_ns: int) -> None:
    """Wait until something comes, something is due, or it is time."""
    wake = link.wake_ns
    port = link.port
    if port is not None:
        clock.wait(port, until_ns if wake is None or wake > until_ns else wake)


def request_once(link: Link, clock: Clock, unit: int, request: Request, limit_ns: int) -> bytes:
    """Return the response to a request, b'' if none came in time.

    Raises
    ------
    DriverError
        The link is gone.
    """
    link.abandon()
    transaction = Transaction(unit)
    transaction.begin((request,))
    link.start((transaction,))
    while transaction.pending and clock.now_ns() < limit_ns:
        wait_on(link, clock, limit_ns)
        link.pump()
    if link.lost:
        raise DriverError(link.lost)
    return transaction.responses[0] if transaction.responses else b""


def check_alone(link: RtuLink, clock: Clock, station: Station, span_ns: int) -> None:
    """See that one drive only answers as a unit of a line: both would obey its commands.

    Raises
    ------
    DriverError
        Two answer, or the line is lost.
    """
    request = station.codec.read(station.device.profile.roles["status"])
    link.heard = bytearray()
    request_once(link, clock, station.device.unit, request, clock.now_ns() + span_ns)
    until = clock.now_ns() + span_ns // 2
    while clock.now_ns() < until and link.port is not None:
        clock.wait(link.port, until)
        link.pump()
    heard, link.heard = bytes(link.heard), None
    answers = 0
    while heard and (pdu := take_rtu(heard, station.device.unit, request)) is not None:
        answers += 1
        heard = heard.partition(pdu)[2]
    if answers > 1:
        raise DriverError(
            f"{station.label}: {answers} drives answer as unit {station.device.unit} at "
            f"{station.device.endpoint}, so its commands would move all of them; give each its own"
        )


def check_echo(
    link: RtuLink, clock: Clock, station: Station, until_ns: int, *, expected: bool
) -> None:
    """See whether a line returns what is sent, before anything is written to a drive on it.

    A write of one register is answered by itself: its echo would be taken for the drive's word. A
    read has 8 bytes and its response an odd number, so one is never the other.

    Raises
    ------
    DriverError
        It echoes where that was not `expected`, or does not where it was, or is lost.
    """
    request = station.codec.read(station.device.profile.roles["status"])
    link.heard = bytearray()
    request_once(link, clock, station.device.unit, request, until_ns)
    echoes = rtu_request(station.device.unit, request) in link.heard
    silent = not link.heard
    link.heard = None
    where = station.device.endpoint
    if echoes and not expected:
        raise DriverError(
            f"{where}: the line echoes what is sent, which would be taken for a drive's "
            "response; switch the adapter's echo off, or set echo: true in the bus' options"
        )
    if expected and not echoes and not silent:
        raise DriverError(
            f"{where}: echo: true, but nothing that is sent comes back; remove it from the bus' "
            "options"
        )


class Client:
    """Sends requests to the drives behind one link, waits and repeats.

    Parameters
    ----------
    link : Link
        Line or connection.
    clock : Clock
        What waits.
    timeout_s : float
        Of a response.
    tries : int
        How often a request is sent.
    busy_s : float, optional
        How long a drive that says that it is busy is asked again, and no longer in a procedure.
        Without it `BUSY_S`, and in a procedure for as long as its steps may take.
    """

    def __init__(
        self,
        link: Link,
        clock: Clock,
        timeout_s: float,
        tries: int = TRIES,
        busy_s: float | None = None,
    ) -> None:
        self._link = link
        self._clock = clock
        self._timeout_ns = round(1e9 * timeout_s)
        self._tries = tries
        self._busy_ns = round(1e9 * (BUSY_S if busy_s is None else busy_s))
        self._gives_up = busy_s is not None
        self._patience = Patience()

    def request(self, station: Station, request: Request) -> bytes:
        """Return the response, maybe an exception; a busy drive is asked again.

        Raises
        ------
        BusTimeout
            There is none.
        DriverError
            The link is gone.
        """
        clock = self._clock
        pdu = b""
        tries, spare = self._tries, 0 if self._gives_up else SPARE
        while tries:
            until = clock.now_ns() + self._timeout_ns + self._patience.more_ns
            try:
                pdu = request_once(self._link, clock, station.device.unit, request, until)
            except DriverError as err:
                raise DriverError(f"{station.label}: {err}") from err
            busy_until = clock.now_ns() + self._busy_ns
            while pdu and is_busy(pdu) and clock.now_ns() < busy_until:
                clock.sleep_until(clock.now_ns() + PAUSE_NS)
                until = clock.now_ns() + self._timeout_ns
                pdu = request_once(self._link, clock, station.device.unit, request, until)
            if pdu:
                return pdu
            if self._patience.note(clock.now_ns() - until, self._timeout_ns) and spare:
                spare -= 1
            else:
                tries -= 1
        self._link.abandon()  # what came of the last is counted
        wrong = self._link.misses(station.device.unit)
        if wrong:
            raise BusTimeout(f"{station.label}: no answer at {station.device.endpoint}: {wrong}")
        raise BusTimeout(
            f"{station.label}: no answer at {station.device.endpoint}; check its supply and cable, "
            "and its unit id with: tautwave scan modbus"
        )

    def run(self, station: Station, procedure: Procedure, limit_s: float) -> None:
        """Run a procedure to its end.

        Raises
        ------
        BusTimeout, DeviceFault, DriverError
            As the procedure raises, or it takes too long.
        """
        clock = self._clock
        until = clock.now_ns() + round(1e9 * limit_s)
        while True:
            responses = [self.request(station, request) for request in procedure.requests()]
            busy = next(filter(is_busy, responses), b"")
            if busy and self._gives_up:
                raise DeviceFault(f"{station.label}: {refusal(busy)} for as long as it was asked")
            procedure.take(responses)
            if procedure.done:
                return
            if clock.now_ns() > until:
                raise BusTimeout(f"{station.label}: did not switch off within {limit_s:g} s")
            if len(responses) != 1 or not responses[0][0] & REFUSED:
                clock.sleep_until(clock.now_ns() + PAUSE_NS // 5)
