"""All links of a bus as one: sent to at once, waited for at once, lost and found again."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import Any

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import BusTimeout, DriverError
from tautwave.traffic import tapped
from tautwave.types import Fault
from tautwave_drivers.adapter import USB_S, set_latency_timer
from tautwave_drivers.modbus.line.client import wait_on
from tautwave_drivers.modbus.line.link import Link
from tautwave_drivers.modbus.line.ports import EpollGroup, PortGroup, TcpPort
from tautwave_drivers.modbus.line.rtu import RtuLink
from tautwave_drivers.modbus.line.tcp import TcpLink
from tautwave_drivers.modbus.options import TCP, ModbusOptions
from tautwave_drivers.modbus.protocol.transaction import Opener
from tautwave_drivers.modbus.station import Station
from tautwave_drivers.serial_port import SerialPort

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
        What happened to the links; the reader clears it.
    notes : list of str
        What was set in an adapter.
    watching : bool
        Whether a link without any response is to be dropped.
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
        self._watched: EpollGroup | None = None
        self._wait: Any = None
        self._down: dict[int, str] = {}
        self.faults: list[Fault] = []
        self.notes: list[str] = []
        self.watching = False
        self.groups = self._make(stations)

    def _make(self, stations: Sequence[Station]) -> list[tuple[Link, list[Station]]]:
        """Return one link per line or endpoint, with the drives behind it."""
        groups: dict[str, list[Station]] = {}
        for station in stations:
            groups.setdefault(station.device.endpoint, []).append(station)
        links: list[tuple[Link, list[Station]]] = []
        options = self._options
        for endpoint, behind in groups.items():
            opener = self._opener(endpoint)
            if options.link == "rtu":
                links.append((RtuLink(opener, self._clock, options), behind))
            else:
                outstanding = min(station.device.profile.outstanding for station in behind)
                tcp = TcpLink(opener, self._clock, options.silence_s, outstanding, options.late_s)
                links.append((tcp, behind))
        return links

    def _opener(self, endpoint: str) -> Opener:
        options, transport = self._options, self._transport
        rtu = options.link == "rtu"
        if transport is not None:
            return lambda: transport.port("" if rtu else endpoint)
        if endpoint == "sim":
            raise DriverError(
                f"bus {self._bus.name}: endpoint: sim needs simulated drives, but this rig has "
                "none; add a simulation block, or name a real endpoint"
            )
        if endpoint.startswith(TCP):
            return lambda: tapped(self._bus.name, TcpPort(endpoint), self._clock)
        given_s = options.usb_latency_s

        def open_port() -> Any:
            note = set_latency_timer(endpoint, USB_S if given_s is None else given_s)
            if note and note not in self.notes:
                self.notes.append(note)
            port = SerialPort(endpoint, options.baud, options.parity, options.stop_bits)
            return tapped(self._bus.name, port, self._clock)

        return open_port

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

    def reach(self, link: Link, timeout_s: float) -> None:
        """Try to reconnect once more for the safe command; `link.lost` says whether that failed."""
        until = self._clock.now_ns() + round(1e9 * timeout_s)
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
            self._wait = PortGroup(ports)
        else:
            self._wait = self._watched = EpollGroup(ports)

    def start(self) -> None:
        """Send every drive the first request of its exchange; what is pending is given up."""
        for number, (link, stations) in enumerate(self.groups):
            if link.busy:
                link.pump()
                link.abandon()
            if self.watching:
                link.watch()
            if link.lost and not self._revive(number, link, stations):
                continue
            transactions = []
            for station in stations:
                transaction = station.transaction
                transaction.begin(station.exchange())
                transactions.append(transaction)
            link.start(transactions)
            if link.lost:
                self.note_loss(number, link, stations)

    def poll(self) -> None:
        """Take in what has come and send what follows; never waits."""
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
            wakes = [wake for link in busy if (wake := link.wake_ns) is not None]
            until_ns = min((deadline_ns, *wakes))
            more = self._wait is not None and clock.wait(self._wait, until_ns)
            for link, _ in groups:  # all: unread bytes would end each wait at once
                link.pump()
            busy = [link for link in busy if link.busy]
            if not more and (until_ns == deadline_ns or self._wait is None):
                return

    def note_losses(self) -> None:
        """Report every link that was lost meanwhile."""
        for number, (link, stations) in enumerate(self.groups):
            if link.lost:
                self.note_loss(number, link, stations)

    def note_loss(self, number: int, link: Link, stations: Sequence[Station]) -> None:
        """Report a lost link once; `reconnect` decides whether that ends the run."""
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
                station.transaction.begin(())
                station.transaction.give_up()
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
