"""The driver the loop sees: Modbus drives over TCP or on one serial line.

A command that `write` takes goes out with the next `request`, in the same exchange that reads the
state, and acts from there on: one whole period of the bus, the declared command delay. What is
asked of a drive is in `station`, how it gets there in `transaction_tcp` and `transaction_rtu`.
"""

from __future__ import annotations

import contextlib
import statistics
from collections.abc import Sequence
from typing import Any

from tautwave.contracts import READ_SHARE, BusSpec, Clock, Row
from tautwave.errors import BusBudgetError, BusTimeout, DriverError
from tautwave.types import AxisCommand, CommandDelay, Fault, JointState
from tautwave_drivers.modbus.asking import Asker, Link, wait_on
from tautwave_drivers.modbus.errand import Opener
from tautwave_drivers.modbus.options import ModbusOptions, match_devices
from tautwave_drivers.modbus.ports import SerialPort, TcpPort, Together, Watched
from tautwave_drivers.modbus.sequence import Steps
from tautwave_drivers.modbus.station import MISSING, Station
from tautwave_drivers.modbus.transaction_rtu import RtuLink
from tautwave_drivers.modbus.transaction_tcp import TcpLink

ANSWER_S = 0.1
"""Patience with a drive before and after the loop, beyond what it takes on the wire."""
LEAVE_S, LEAVE_TRIES = 0.15, 2
"""Patience with a drive that has to be left, and how often it is told."""
LOOKS = 5
"""Exchanges in `open` by which a TCP drive's answer time is measured."""
FEED_SHARE = 0.3
"""Of the comm-loss timeout, between two requests while other buses are still enabling."""
POLL_NS = 1_000_000
PERIODS = 3
"""Of the bus, that an answer and the silence after it may wait for while enabling."""
MISSES = 20
"""Errands without an answer that end enabling."""


class ModbusDriver:
    """Driver of the drives on one bus.

    Parameters
    ----------
    options : ModbusOptions
        The bus' options.
    bus : BusSpec
        Its axes.
    clock : Clock
        What waits.
    transport : optional
        The bus, when it is simulated in this process: its `port(endpoint)` gives a `BytePort`.

    Raises
    ------
    ConfigError
        The axes do not go with the devices.
    """

    command_delay = CommandDelay(1, 0.0)

    def __init__(self, options: ModbusOptions, bus: BusSpec, clock: Clock, transport: Any) -> None:
        self._options = options
        self._bus = bus
        self._clock = clock
        self._transport = transport
        self._devices = match_devices(options, bus)
        self.stations: list[Station] = []
        self._groups: list[tuple[Link, list[Station]]] = []
        self._watched: Watched | None = None
        self._wait: Any = None
        self._on = False
        self._running = False
        self._fed_ns = 0
        self._fed_last = False
        self._misses = 0
        self._down: dict[int, str] = {}
        self._faults: list[Fault] = []
        self.notes: list[str] = []
        self.columns = [f"{device.axis.name}.answer_us" for device in self._devices]

    # -- before the loop --------------------------------------------------------------------

    def open(self) -> None:
        """Connect, check and set every drive with its motor off; see `Bringup`.

        Raises
        ------
        DriverError
            A drive cannot be reached, or is not as it should be.
        BusBudgetError
            TCP drives answer too slowly for the rate.
        """
        from tautwave_drivers.modbus.bringup import Bringup

        self.close()
        self.notes = []
        self._faults.clear()
        self._groups = self._make_links()
        try:
            for link, stations in self._groups:
                self._connect(link)
                asker = Asker(link, self._clock, self._patience_s)
                for station in stations:
                    bringup = Bringup(station, asker, self._options, self._bus, self._clock)
                    bringup.notes = self.notes
                    bringup.run()
            self._gather()
            self._look()
        except BaseException:
            self.close()
            raise

    def attach(self) -> None:
        """Take drives as they are, enabled, without asking them anything: to measure a cycle."""
        self._groups = self._make_links()
        for link, _ in self._groups:
            self._connect(link)
        self._gather()
        self._on = self._running = True
        for station in self.stations:
            station.on = True

    def detach(self) -> None:
        """Release such drives, saying nothing to them."""
        self._on = self._running = False
        for link, _ in self._groups:
            link.close()
        self._groups = []

    def make_stations(self) -> list[Station]:
        """Return a fresh station for every device."""
        return [Station(device, self._bus.rate_hz, self._clock) for device in self._devices]

    @property
    def _patience_s(self) -> float:
        options = self._options
        wire = 80.0 * options.bits / options.baud if options.link == "rtu" else 0.0
        return ANSWER_S + wire + options.turnaround + options.late_s

    def _make_links(self) -> list[tuple[Link, list[Station]]]:
        """Return one link per line or endpoint, with the drives behind it."""
        self.stations = self.make_stations()
        groups: dict[str, list[Station]] = {}
        for station in self.stations:
            groups.setdefault(station.device.endpoint, []).append(station)
        links: list[tuple[Link, list[Station]]] = []
        for endpoint, stations in groups.items():
            opener = self._opener(endpoint)
            if self._options.link == "rtu":
                links.append((RtuLink(opener, self._clock, self._options), stations))
            else:
                links.append((TcpLink(opener, self._clock, self._options.silence_s), stations))
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

    def _connect(self, link: Link) -> None:
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

    def _gather(self) -> None:
        """Make what the loop waits on out of all ports."""
        if self._watched is not None:
            self._watched.close()
            self._watched = None
        ports = [port for link, _ in self._groups if (port := link.port) is not None]
        if len(ports) < 2:
            self._wait = ports[0] if ports else None
        elif hasattr(ports[0], "advance"):
            self._wait = Together(ports)
        else:
            self._wait = self._watched = Watched(ports)

    def _look(self) -> None:
        """Exchange a few times as every cycle will, and see that TCP drives are fast enough."""
        spans: list[int] = []
        for number in range(LOOKS):
            began = self._clock.now_ns()
            self._start()
            self._collect(began + round(1e9 * self._patience_s))
            silent = [station.label for station in self.stations if not station.errand.whole]
            if not silent:
                spans.append(self._clock.now_ns() - began)
                if self._options.link == "rtu":
                    break
            elif not spans and number == LOOKS - 1:
                raise BusTimeout(f"{', '.join(silent)}: no answer to the request of every cycle")
        self._forget()
        if self._options.link == "tcp":
            self._check_time(statistics.median(spans) * 1e-9)

    def _check_time(self, spent_s: float) -> None:
        bus = self._bus
        reads = max(len(station.plan.reads) for station in self.stations)
        asked = max(len(station.plan.questions) for station in self.stations)
        spent_s *= asked / reads
        allowed = (bus.divisor - 1.0 + READ_SHARE) / (bus.rate_hz * bus.divisor)
        self.notes.append(
            f"bus {bus.name}: an exchange takes {spent_s * 1e3:.3g} ms (measured), "
            f"{allowed * 1e3:.3g} ms are there"
        )
        if spent_s > allowed:
            nth = 1
            while (nth - 1.0 + READ_SHARE) / (bus.rate_hz * bus.divisor) < spent_s:
                nth += 1
            raise BusBudgetError(
                f"bus {bus.name}: an exchange takes {spent_s * 1e3:.3g} ms (measured), which does "
                f"not fit in {allowed * 1e3:.3g} ms; divisor: {nth} on this bus fits"
            )

    # -- enabling ---------------------------------------------------------------------------

    def enable_step(self) -> bool:
        """Send and take what enabling asks, a step at a time; then keep the watchdogs fed.

        Raises
        ------
        DeviceFault, BusTimeout, DriverError
            A drive refuses, or takes too long, or is gone; the sentence says which.
        """
        if not self._groups:
            raise DriverError(f"bus {self._bus.name}: enabled before it was opened")
        for link, _ in self._groups:
            link.pump()
            if link.lost:
                raise DriverError(f"bus {self._bus.name}: {link.lost}")
        if self._running:
            return self._feed()
        for link, stations in self._groups:
            for station in stations:
                self._enable(link, station)
        self._running = self._on = all(station.on for station in self.stations)
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
        if any(link.busy for link, _ in self._groups):
            if now - self._fed_ns > 1e9 * self._patience_s:
                for link, _ in self._groups:
                    link.abandon()
            return False
        watched = any(station.arming for station in self.stations)
        due = now - self._fed_ns > FEED_SHARE * 1e9 * self._options.comm_timeout_s
        if not watched or not due or self._fed_last:
            self._fed_last = False
            return True
        self._fed_ns = now
        self._fed_last = True
        for link, stations in self._groups:
            for station in stations:
                station.errand.begin(station.plan.reads[:1])
            link.start([station.errand for station in stations])
        return False

    # -- every cycle ----------------------------------------------------------------------

    def request(self) -> None:
        """Send the staged commands and ask for the state; TCP drives are all sent to."""
        self._start()

    def _start(self) -> None:
        for number, (link, stations) in enumerate(self._groups):
            if link.busy:
                link.pump()
                link.abandon()
            if self._running:
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
                self._note_loss(number, link, stations)

    def poll(self) -> None:
        """Take in what has come and ask what follows; between `request` and `read`, never waits."""
        for link, _ in self._groups:
            if link.busy:
                link.pump()

    def _collect(self, deadline_ns: int) -> None:
        """Wait until all has come, or it is time."""
        groups, clock = self._groups, self._clock
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

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return what the drives measured; one that has not answered by the deadline is missing."""
        if not self._groups:
            return [MISSING] * len(self._devices)
        self._collect(deadline_ns)
        now = self._clock.now_ns()
        for number, (link, stations) in enumerate(self._groups):
            if link.lost:
                self._note_loss(number, link, stations)
        states = [station.settle(now) for station in self.stations]
        for station in self.stations:
            if station.faults:
                self._faults += station.faults
                station.faults.clear()
        return states

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Stage one command per axis for the next request; ignored while not enabled.

        Raises
        ------
        DriverError
            Not one command per axis.
        """
        if len(commands) != len(self._devices):
            raise DriverError(
                f"bus {self._bus.name}: {len(commands)} commands for {len(self._devices)} axes; "
                "write one command per axis, in the order of the rig file"
            )
        if self._on:
            for station, command in zip(self.stations, commands, strict=True):
                station.command(command)

    def faults(self) -> Sequence[Fault]:
        """Return what drives and links have reported since the last call."""
        if not self._faults:
            return ()
        found, self._faults = self._faults, []
        return found

    def fill(self, row: Row, at: int) -> None:
        """Record how long after its question each answer came [us]; NaN where none did."""
        for station in self.stations:
            errand = station.errand
            whole = errand.whole and bool(errand.asked_ns)
            row[at] = (errand.came_ns - errand.asked_ns[0]) * 1e-3 if whole else float("nan")
            at += 1

    # -- a link that is lost ----------------------------------------------------------------

    def _note_loss(self, number: int, link: Link, stations: Sequence[Station]) -> None:
        """Tell of a lost link once; whether that ends the run is the rig's."""
        for station in stations:
            station.stage(0)
        if number in self._down:
            return
        self._down[number] = link.lost
        again = self._options.reconnect == "reconnect"
        then = "; trying again" if again else ""
        self._faults.append(Fault("", f"connection lost: {link.lost}{then}", fatal=not again))
        self._gather()

    def _revive(self, number: int, link: Link, stations: Sequence[Station]) -> bool:
        if self._options.reconnect != "reconnect" or not link.retry():
            for station in stations:
                station.errand.begin(())
                station.errand.give_up()
            return False
        if self._down.pop(number, ""):
            self._faults.append(Fault("", "the connection is back", fatal=False))
        for station in stations:
            station.resumed = True
            station.stage(0)
        self._gather()
        return True

    # -- afterwards -----------------------------------------------------------------------

    def disable(self) -> None:
        """Safe command, then off, and watchdogs off; a link that is gone is left alone."""
        if not any(station.walk is not None for station in self.stations):
            return
        self._on = self._running = False
        for link, stations in self._groups:
            link.abandon()
            asker = Asker(link, self._clock, LEAVE_S, LEAVE_TRIES)
            for station in stations:
                if station.walk is not None and not link.lost:
                    with contextlib.suppress(Exception):
                        self._let_go(asker, station)
                station.walk = None
                station.on = False
        self._forget()

    def _let_go(self, asker: Asker, station: Station) -> None:
        """Zero command first, whatever the rest of it meets."""
        profile, speech = station.device.profile, station.speech
        role = "command_effort" if station.device.impedance else "command_velocity"
        station.stage(0)
        with contextlib.suppress(DriverError):
            asker.ask(station, speech.write(profile.roles[role], 0))  # type: ignore[index]
        if station.machine is not None:
            station.machine.disable()
            asker.walk(station, station.machine, 0.5)
        else:
            steps = Steps(station.label, "disable", speech, profile.disable, self._clock)
            asker.walk(station, steps, 1.0)
        if station.arming and profile.comm_loss is not None:
            asker.ask(station, speech.write(profile.comm_loss.register_name, profile.comm_loss.off))

    def _forget(self) -> None:
        for station in self.stations:
            station.reset()

    def close(self) -> None:
        """Disable and release the bus; idempotent, never raises."""
        with contextlib.suppress(Exception):
            self.disable()
        self._on = self._running = False
        for link, _ in self._groups:
            with contextlib.suppress(Exception):
                link.abandon()
                link.close()
        self._groups = []
        self._down.clear()
        self._wait = None
        if self._watched is not None:
            self._watched.close()
            self._watched = None
