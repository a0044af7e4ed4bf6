"""From drives that are off to drives that are on, a step at a time; then keeping them awake."""

from __future__ import annotations

from tautwave.contracts import BusSpec, Clock
from tautwave.errors import BusTimeout, DriverError
from tautwave_drivers.modbus.asking import Link
from tautwave_drivers.modbus.links import Links
from tautwave_drivers.modbus.options import ModbusOptions
from tautwave_drivers.modbus.station import Station

FEED_SHARE = 0.3
"""Of the comm-loss timeout, between two requests while other buses are still enabling."""
PERIODS = 3
"""Of the bus, that an answer and the silence after it may wait for."""
MISSES = 20
"""Errands in a row without an answer that end enabling."""


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
    patience_s : float
        For an answer.

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
        patience_s: float,
    ) -> None:
        self._links = links
        self._options = options
        self._bus = bus
        self._clock = clock
        self._patience_s = patience_s
        self._fed_ns = 0
        self._fed_last = False
        self._misses = 0
        self.done = False

    def step(self) -> bool:
        """Go one step on; return True when all are on and nothing is on its way.

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
            return self._feed()
        for link, stations in groups:
            for station in stations:
                self._enable(link, station)
        self.done = all(station.on for _, stations in groups for station in stations)
        self._fed_ns = self._clock.now_ns()
        return False  # a serial line wants its silence before the first cycle

    def _enable(self, link: Link, station: Station) -> None:
        if station.on:
            return
        errand = station.errand
        if station.walk is None:
            station.begin_enabling()
        elif errand.under_way:
            # One that was not asked yet waits behind another, which is timed itself.
            patience_ns = round(1e9 * self._patience_s) + PERIODS * self._bus.period_ns
            if not errand.asked_ns or self._clock.now_ns() < errand.asked_ns[-1] + patience_ns:
                return
            link.abandon()
            self._missed(station)
        elif not errand.whole:
            self._missed(station)
        else:
            self._misses = 0
            if station.enabling():
                return
        assert station.walk is not None
        errand.begin(station.walk.questions())
        link.start((errand,))

    def _missed(self, station: Station) -> None:
        self._misses += 1
        if self._misses > MISSES:
            raise BusTimeout(
                f"{station.label}: stopped answering while it was enabled; check its supply and "
                "cable"
            )

    def _feed(self) -> bool:
        """Ask for the state now and then; never in two steps running, so that all buses meet."""
        now = self._clock.now_ns()
        if any(link.busy for link, _ in self._links.groups):
            if now - self._fed_ns > 1e9 * self._patience_s:
                for link, _ in self._links.groups:
                    link.abandon()
            return False
        watched = any(one.arming for _, stations in self._links.groups for one in stations)
        due = now - self._fed_ns > FEED_SHARE * 1e9 * self._options.comm_timeout_s
        if not watched or not due or self._fed_last:
            self._fed_last = False
            return True
        self._fed_ns = now
        self._fed_last = True
        for link, stations in self._links.groups:
            for station in stations:
                station.errand.begin(station.plan.reads[:1])
            link.start([station.errand for station in stations])
        return False
