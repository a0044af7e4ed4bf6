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
from tautwave_drivers.modbus.asking import Asker, Link
from tautwave_drivers.modbus.enabling import Enabling
from tautwave_drivers.modbus.links import Links
from tautwave_drivers.modbus.options import ModbusOptions, match_devices
from tautwave_drivers.modbus.sequence import Steps
from tautwave_drivers.modbus.station import MISSING, Station

ANSWER_S = 0.1
"""Patience with a drive before and after the loop, beyond what it takes on the wire."""
LEAVE_S, LEAVE_TRIES = 0.15, 2
"""Patience with a drive that has to be left, and how often it is told."""
LOOKS = 5
"""Exchanges in `open` by which a TCP drive's answer time is measured."""


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
        self._links: Links | None = None
        self._enabling: Enabling | None = None
        self._on = False
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
        links = self._links = self._make_links()
        try:
            for link, stations in links.groups:
                links.connect(link)
                asker = Asker(link, self._clock, self._patience_s)
                for station in stations:
                    bringup = Bringup(station, asker, self._options, self._bus, self._clock)
                    bringup.notes = self.notes
                    bringup.run()
            links.gather()
            self._look(links)
            self._enabling = self._fresh(links)
        except BaseException:
            self.close()
            raise

    def attach(self) -> None:
        """Take drives as they are, enabled, without asking them anything: to measure a cycle."""
        links = self._links = self._make_links()
        for link, _ in links.groups:
            links.connect(link)
        links.gather()
        self._on = links.watching = True
        for station in self.stations:
            station.on = True

    def detach(self) -> None:
        """Release such drives, saying nothing to them."""
        self._on = False
        links, self._links = self._links, None
        if links is not None:
            links.close()

    def _make_links(self) -> Links:
        self.stations = self.make_stations()
        return Links(self._options, self._bus, self._clock, self._transport, self.stations)

    def _fresh(self, links: Links) -> Enabling:
        return Enabling(links, self._options, self._bus, self._clock, self._patience_s)

    def make_stations(self) -> list[Station]:
        """Return a fresh station for every device."""
        return [Station(device, self._bus.rate_hz, self._clock) for device in self._devices]

    @property
    def _patience_s(self) -> float:
        options = self._options
        wire = 80.0 * options.bits / options.baud if options.link == "rtu" else 0.0
        return ANSWER_S + wire + options.turnaround + options.late_s

    def _look(self, links: Links) -> None:
        """Exchange a few times as every cycle will, and see that TCP drives are fast enough."""
        spans: list[int] = []
        for number in range(LOOKS):
            began = self._clock.now_ns()
            links.start()
            links.collect(began + round(1e9 * self._patience_s))
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
        links, enabling = self._links, self._enabling
        if links is None or enabling is None:
            raise DriverError(f"bus {self._bus.name}: enabled before it was opened")
        ready = enabling.step()
        self._on = links.watching = enabling.done
        return ready

    # -- every cycle ----------------------------------------------------------------------

    def request(self) -> None:
        """Send the staged commands and ask for the state; TCP drives are all sent to."""
        if self._links is not None:
            self._links.start()

    def poll(self) -> None:
        """Take in what has come and ask what follows; between `request` and `read`, never waits."""
        if self._links is not None:
            self._links.poll()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return what the drives measured; one that has not answered by the deadline is missing."""
        links = self._links
        if links is None:
            return [MISSING] * len(self._devices)
        links.collect(deadline_ns)
        now = self._clock.now_ns()
        links.note_losses()
        if links.faults:
            self._faults += links.faults
            links.faults.clear()
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

    # -- afterwards -----------------------------------------------------------------------

    def disable(self) -> None:
        """Safe command, then off, and watchdogs off; a link that is gone is tried once more."""
        links = self._links
        self._on = False
        if links is None or not any(station.walk is not None for station in self.stations):
            return
        links.watching = False
        for link, stations in sorted(links.groups, key=lambda group: bool(group[0].lost)):
            link.abandon()
            if link.lost:
                links.reach(link, LEAVE_S)
            asker = Asker(link, self._clock, LEAVE_S, LEAVE_TRIES)
            for station in stations:
                if station.walk is not None:
                    self._leave(link, asker, station)
                station.walk = None
                station.on = False
        self._forget()
        self._enabling = self._fresh(links)

    def _leave(self, link: Link, asker: Asker, station: Station) -> None:
        """Have a drive let go; a note says so where it was not seen to."""
        why = link.lost
        if not why:
            try:
                self._let_go(asker, station)
            except Exception as err:  # noqa: BLE001  the others have to be left too
                why = str(err)
        if why:
            self.notes.append(f"{station.label} was not seen to switch off: {why}")

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
        try:
            self.disable()
        except Exception as err:  # noqa: BLE001  the way out must not end in the middle
            self.notes.append(f"bus {self._bus.name}: closing: {err}")
        links, self._links = self._links, None
        self._on = False
        self._enabling = None
        if links is not None:
            links.close()
