"""From drives that are off to drives that are on, a step at a time; then keeping them awake."""

from __future__ import annotations

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import BusTimeout, DriverError
from tautwave_drivers.modbus.line.link import Link
from tautwave_drivers.modbus.line.links import Links
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.station import Station

KEEP_ALIVE_SHARE = 0.3
"""Share of the comm-loss timeout between two requests while other buses are still enabling."""
PERIODS = 3
"""Bus periods that a response and the silence after it may take on top."""
MISSES = 20
"""Transactions without a response, in a row, that end enabling."""


class Enabling:
    """Enables all drives of a bus without ever waiting.

    Parameters
    ----------
    links : Links
        The ways to them.
    options : ModbusOptions
        The bus' options.
    bus : BusSpec
        Its name and rate.
    clock : Clock
        Time.
    timeout_s : float
        Of a response.

    Attributes
    ----------
    done : bool
        All are on.
    """

    def __init__(
        self,
        links: Links,
        options: ModbusOptions,
        bus: BusSpec,
        clock: Clock,
        timeout_s: float,
    ) -> None:
        self._links = links
        self._options = options
        self._bus = bus
        self._clock = clock
        self._timeout_s = timeout_s
        self._alive_ns = 0
        self._alive_last = False
        self._misses = 0
        self.done = False

    def step(self) -> bool:
        """Do one step; return True when all are on and nothing is pending.

        Raises
        ------
        DeviceFault, BusTimeout, DriverError
            A drive refuses, or takes too long, or is gone; the sentence says which.
        """
        groups = self._links.groups
        for link, _ in groups:
            link.pump()
            if link.lost:
                raise DriverError(f"bus {self._bus.name}: {link.lost}")
        if self.done:
            return self._keep_alive()
        for link, stations in groups:
            for station in stations:
                self._enable(link, station)
        self.done = all(station.on for _, stations in groups for station in stations)
        self._alive_ns = self._clock.now_ns()
        return False  # a serial line wants its silence before the first cycle

    def _enable(self, link: Link, station: Station) -> None:
        if station.on:
            return
        transaction = station.transaction
        if station.procedure is None:
            station.begin_enabling()
        elif transaction.pending:
            # One that was not sent yet waits behind another, which has its own timeout.
            timeout_s = self._timeout_s
            if station.arming:  # one lost answer must not be the silence that trips the drive
                timeout_s = min(timeout_s, self._options.comm_timeout_s / 4)
            timeout_ns = round(1e9 * timeout_s) + PERIODS * self._bus.period_ns
            if (
                not transaction.sent_ns
                or self._clock.now_ns() < transaction.sent_ns[-1] + timeout_ns
            ):
                return
            link.abandon()
            self._missed(link, station)
        elif not transaction.complete:
            self._missed(link, station)
        else:
            self._misses = 0
            if station.enabling():
                return
        assert station.procedure is not None
        transaction.begin(station.procedure.requests())
        link.start((transaction,))

    def _missed(self, link: Link, station: Station) -> None:
        self._misses += 1
        if self._misses > MISSES:
            wrong = link.misses(station.device.unit)
            raise BusTimeout(
                f"{station.label}: stopped answering while it was being enabled"
                + (f": {wrong}" if wrong else "; check its supply and cable")
            )

    def _keep_alive(self) -> bool:
        """Request the state now and then; never in two steps running, so that all buses meet."""
        now = self._clock.now_ns()
        if any(link.busy for link, _ in self._links.groups):
            if now - self._alive_ns > 1e9 * self._timeout_s:
                for link, _ in self._links.groups:
                    link.abandon()
            return False
        watched = any(one.arming for _, stations in self._links.groups for one in stations)
        due = now - self._alive_ns > KEEP_ALIVE_SHARE * 1e9 * self._options.comm_timeout_s
        if not watched or not due or self._alive_last:
            self._alive_last = False
            return True
        self._alive_ns = now
        self._alive_last = True
        for link, stations in self._links.groups:
            for station in stations:
                station.transaction.begin(station.plan.reads[:1])
            link.start([station.transaction for station in stations])
        return False
