"""All links of a bus as one: sent to at once, waited for at once, lost and found again."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import BusTimeout, DriverError
from tautwave.types import Fault
from tautwave_drivers.modbus.asking import Link, wait_on
from tautwave_drivers.modbus.errand import Opener
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.ports import SerialPort, TcpPort, Together, Watched
from tautwave_drivers.modbus.station import Station
from tautwave_drivers.modbus.transaction_rtu import RtuLink
from tautwave_drivers.modbus.transaction_tcp import TcpLink

POLL_NS = 1_000_000


class Links:
    """The ways to all drives of a bus.

    Parameters
    ----------
    options : ModbusOptions
        The bus' options.
    bus : BusSpec
        Its name.
    clock : Clock
        What waits.
    transport : optional
        The bus, when it is simulated in this process.
    stations : sequence of Station
        The drives.

    Attributes
    ----------
    groups : list
        One link per line or endpoint, with the drives behind it.
    faults : list of Fault
        What befell the links; whoever reads them clears them.
    watching : bool
        Whether a link that answers nothing is to be given up.
    """

    def __init__(
        self,
        options: ModbusOptions,
        bus: BusSpec,
        clock: Clock,
        transport: Any,
        stations: Sequence[Station],
    ) -> None:
        self._options = options
        self._bus = bus
        self._clock = clock
        self._transport = transport
        self._watched: Watched | None = None
        self._wait: Any = None
        self._down: dict[int, str] = {}
        self.faults: list[Fault] = []
        self.watching = False
        self.groups = self._make(stations)

    def _make(self, stations: Sequence[Station]) -> list[tuple[Link, list[Station]]]:
        """Return one link per line or endpoint, with the drives behind it."""
        groups: dict[str, list[Station]] = {}
        for station in stations:
            groups.setdefault(station.device.endpoint, []).append(station)
        links: list[tuple[Link, list[Station]]] = []
        for endpoint, behind in groups.items():
            opener = self._opener(endpoint)
            if self._options.link == "rtu":
                links.append((RtuLink(opener, self._clock, self._options), behind))
            else:
                links.append((TcpLink(opener, self._clock, self._options.silence_s), behind))
        return links

    def _opener(self, endpoint: str) -> Opener:
        options, transport = self._options, self._transport
        rtu = options.link == "rtu"
        if transport is not None:
            return lambda: transport.port("" if rtu else endpoint)
        if endpoint == "sim":
            raise DriverError(
                f"bus {self._bus.name}: endpoint: sim has no drives here; add a simulation block "
                "to the rig, or name a real endpoint"
            )
        return (lambda: SerialPort(endpoint, options)) if rtu else (lambda: TcpPort(endpoint))

    def connect(self, link: Link) -> None:
        """Connect, waiting as long as the options allow; raises `DriverError` if it fails."""
        until = self._clock.now_ns() + round(1e9 * self._options.connect_timeout_s)
        there = False
        try:
            while not (there := link.connect()) and self._clock.now_ns() < until:
                self._clock.sleep_until(self._clock.now_ns() + POLL_NS)
        except DriverError as err:
            raise DriverError(f"bus {self._bus.name}: {err}") from err
        if not there:
            raise BusTimeout(
                f"bus {self._bus.name}: no connection within {self._options.connect_timeout_s:g} "
                "s; check cable, supply and address"
            )

    def reach(self, link: Link, patience_s: float) -> None:
        """Try to connect once more, for a last word; `link.lost` says whether that failed."""
        until = self._clock.now_ns() + round(1e9 * patience_s)
        with contextlib.suppress(DriverError):
            while not link.connect() and self._clock.now_ns() < until:
                self._clock.sleep_until(self._clock.now_ns() + POLL_NS)

    def gather(self) -> None:
        """Make what the loop waits on out of all ports."""
        if self._watched is not None:
            self._watched.close()
            self._watched = None
        ports = [port for link, _ in self.groups if (port := link.port) is not None]
        if len(ports) < 2:
            self._wait = ports[0] if ports else None
        elif hasattr(ports[0], "advance"):
            self._wait = Together(ports)
        else:
            self._wait = self._watched = Watched(ports)

    def start(self) -> None:
        """Send every drive the first question of its exchange; what is open from before is lost."""
        for number, (link, stations) in enumerate(self.groups):
            if link.busy:
                link.pump()
                link.abandon()
            if self.watching:
                link.watch()
            if link.lost and not self._revive(number, link, stations):
                continue
            errands = []
            for station in stations:
                errand = station.errand
                errand.begin(station.exchange())
                errands.append(errand)
            link.start(errands)
            if link.lost:
                self.note_loss(number, link, stations)

    def poll(self) -> None:
        """Take in what has come and ask what follows; never waits."""
        for link, _ in self.groups:
            if link.busy:
                link.pump()

    def collect(self, deadline_ns: int) -> None:
        """Wait until all has come, or it is time."""
        groups, clock = self.groups, self._clock
        if len(groups) == 1:
            link = groups[0][0]
            while link.busy:
                wait_on(link, clock, deadline_ns)
                link.pump()
                if link.busy and clock.now_ns() >= deadline_ns:
                    return
            return
        busy = [link for link, _ in groups if link.busy]
        while busy:
            more = self._wait is not None and clock.wait(self._wait, deadline_ns)
            for link, _ in groups:  # all: bytes that nobody takes would end each wait at once
                link.pump()
            busy = [link for link in busy if link.busy]
            if not more:
                return

    def note_losses(self) -> None:
        """Tell of every link that was lost meanwhile."""
        for number, (link, stations) in enumerate(self.groups):
            if link.lost:
                self.note_loss(number, link, stations)

    def note_loss(self, number: int, link: Link, stations: Sequence[Station]) -> None:
        """Tell of a lost link once; whether that ends the run is the rig's."""
        for station in stations:
            station.stage(0)
        if number in self._down:
            return
        self._down[number] = link.lost
        again = self._options.reconnect == "reconnect"
        then = "; trying again" if again else ""
        self.faults.append(Fault("", f"connection lost: {link.lost}{then}", fatal=not again))
        self.gather()

    def _revive(self, number: int, link: Link, stations: Sequence[Station]) -> bool:
        if self._options.reconnect != "reconnect" or not link.retry():
            for station in stations:
                station.errand.begin(())
                station.errand.give_up()
            return False
        if self._down.pop(number, ""):
            self.faults.append(Fault("", "the connection is back", fatal=False))
        for station in stations:
            station.resumed = True
            station.stage(0)
        self.gather()
        return True

    def close(self) -> None:
        """Release everything; idempotent."""
        for link, _ in self.groups:
            with contextlib.suppress(DriverError, OSError):
                link.abandon()
                link.close()
        self.groups = []
        self._wait = None
        if self._watched is not None:
            self._watched.close()
            self._watched = None
