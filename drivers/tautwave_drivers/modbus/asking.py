"""Asking one drive and waiting for its answer: before and after the loop, and for `scan`."""

from __future__ import annotations

from tautwave.contracts import Clock
from tautwave.errors import BusTimeout, DriverError
from tautwave_drivers.modbus.errand import Errand
from tautwave_drivers.modbus.frames import REFUSED, Question
from tautwave_drivers.modbus.sequence import Walk
from tautwave_drivers.modbus.station import Station
from tautwave_drivers.modbus.transaction_rtu import RtuLink
from tautwave_drivers.modbus.transaction_tcp import TcpLink

Link = TcpLink | RtuLink
TRIES = 5
BUSY = 6
PAUSE_NS = 5_000_000


def wait_on(link: Link, clock: Clock, until_ns: int) -> None:
    """Wait until something comes, something is due, or it is time."""
    wake = link.wake_ns
    port = link.port
    if port is not None:
        clock.wait(port, until_ns if wake is None or wake > until_ns else wake)


def ask_once(link: Link, clock: Clock, unit: int, question: Question, limit_ns: int) -> bytes:
    """Return the answer to a question, b'' if none came in time.

    Raises
    ------
    DriverError
        The link is gone.
    """
    link.abandon()
    errand = Errand(unit)
    errand.begin((question,))
    link.start((errand,))
    while errand.under_way and clock.now_ns() < limit_ns:
        wait_on(link, clock, limit_ns)
        link.pump()
    if link.lost:
        raise DriverError(link.lost)
    return errand.answers[0] if errand.answers else b""


class Asker:
    """Asks the drives behind one link, patiently.

    Parameters
    ----------
    link : TcpLink or RtuLink
        The way to them.
    clock : Clock
        What waits.
    patience_s : float
        For an answer.
    tries : int
        How often a question is asked.
    """

    def __init__(self, link: Link, clock: Clock, patience_s: float, tries: int = TRIES) -> None:
        self._link = link
        self._clock = clock
        self._patience_ns = round(1e9 * patience_s)
        self._tries = tries

    def ask(self, station: Station, question: Question) -> bytes:
        """Return the answer, an exception too; a busy drive is asked again.

        Raises
        ------
        BusTimeout
            There is none.
        DriverError
            The link is gone.
        """
        clock = self._clock
        pdu = b""
        for _ in range(self._tries):
            until = clock.now_ns() + self._patience_ns
            try:
                pdu = ask_once(self._link, clock, station.device.unit, question, until)
            except DriverError as err:
                raise DriverError(f"{station.label}: {err}") from err
            while pdu and pdu[0] & REFUSED and pdu[1] == BUSY and clock.now_ns() < until:
                clock.sleep_until(clock.now_ns() + PAUSE_NS)
                pdu = ask_once(self._link, clock, station.device.unit, question, until)
            if pdu:
                return pdu
        raise BusTimeout(
            f"{station.label}: no answer at {station.device.endpoint}; check its supply and cable, "
            "and find its unit id with: tautwave scan modbus"
        )

    def walk(self, station: Station, walk: Walk, limit_s: float) -> None:
        """Go through a sequence to its end.

        Raises
        ------
        BusTimeout, DeviceFault, DriverError
            As the walk says, or when it takes too long.
        """
        clock = self._clock
        until = clock.now_ns() + round(1e9 * limit_s)
        while True:
            answers = [self.ask(station, question) for question in walk.questions()]
            walk.take(answers)
            if walk.done:
                return
            if clock.now_ns() > until:
                raise BusTimeout(f"{station.label}: does not switch off in {limit_s:g} s")
            if len(answers) != 1 or not answers[0][0] & REFUSED:
                clock.sleep_until(clock.now_ns() + PAUSE_NS // 5)
