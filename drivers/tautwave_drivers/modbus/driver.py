"""The driver the loop sees: Modbus drives over TCP or on one serial line.

A command that `write` takes goes out with the next `request`, in the same exchange that reads the
state, and acts from there on: one whole period of the bus, the declared command delay. What is
requested of a drive is in `station`, how it gets there in `line.tcp` and `line.rtu`.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Sequence
from typing import Any

from tautwave.contracts import READ_SHARE, BusSpec, Clock
from tautwave.device_settings import DeviceSettings, refuse_differences
from tautwave.driver_base import DriverBase
from tautwave.errors import BusBudgetError, BusTimeout
from tautwave.types import AxisCommand, CommandDelay, JointState
from tautwave_drivers.modbus.budget import rounds
from tautwave_drivers.modbus.enabling import Enabling
from tautwave_drivers.modbus.leaving import leave, leave_again
from tautwave_drivers.modbus.line.client import Client, check_alone, check_echo
from tautwave_drivers.modbus.line.links import Links
from tautwave_drivers.modbus.line.rtu import RtuLink
from tautwave_drivers.modbus.line.tcp import TcpLink
from tautwave_drivers.modbus.listening import changed_by_others, commanded
from tautwave_drivers.modbus.options import ModbusOptions, match_devices
from tautwave_drivers.modbus.reading_back import ReadBack
from tautwave_drivers.modbus.station import MISSING, Station
from tautwave_drivers.recorded import ANSWER, MOTOR_EFFORT, read_by

ANSWERED = read_by(ANSWER, lambda of: of[0].answered_us(of[1]))
EFFORT = read_by(MOTOR_EFFORT, lambda of: of[0].motor_effort(of[1]))
COLUMNS = (ANSWERED, EFFORT)
RESPONSE_S = 0.1
"""Timeout of a response before and after the loop, beyond the time on the wire."""
TRIALS = 5
"""Exchanges in `open` that measure the response time of TCP drives."""


def _likely_cause(links: Links, silent: Sequence[str]) -> str:
    """Say why drives may be silent that responded before."""
    for link, stations in links.groups:
        behind = [station.label for station in stations]
        if isinstance(link, TcpLink) and link.outstanding > 1 and set(behind) & set(silent):
            return (
                f"their profile says outstanding: {link.outstanding}, but many servers and "
                "gateways answer only the first of several simultaneous requests: set "
                "outstanding: 1"
            )
    return (
        "check that late_s is long enough and that they accept that many registers in one "
        "request; tautwave scan modbus lists the units that answer"
    )


class ModbusDriver(DriverBase):
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
        super().__init__(bus)
        self._options = options
        self._clock = clock
        self._transport = transport
        self._devices = match_devices(options, bus)
        self.stations: list[Station] = []
        self._links: Links | None = None
        self._enabling: Enabling | None = None
        self._read_back: ReadBack | None = None
        self.warnings: list[str] = []
        self.watchdog_s = {
            one.axis.name: one.profile.timeout_s(options.comm_timeout_s)
            for one in self._devices
            if one.profile.comm_loss is not None
        }
        for at, device in enumerate(self._devices):
            self.record(device.axis.name, (self, at), [ANSWERED])
        for at, device in enumerate(self._devices):
            reports = device.impedance and device.options.report_torque
            self.record(device.axis.name, (self, at), [EFFORT] if reports else [])

    # -- before the loop --------------------------------------------------------------------

    def _bring_up(self) -> None:
        """Connect, check and set every drive with its motor off; see `Bringup`.

        Raises
        ------
        DriverError
            A drive cannot be reached, is not what the rig expects, or lasting settings differ.
        BusBudgetError
            TCP drives answer too slowly for the rate.
        """
        from tautwave_drivers.modbus.bringup import Bringup

        unwatched: dict[str, str] = {}
        settings: list[DeviceSettings] = []
        links = self._links = self._make_links()
        clients: dict[Station, Client] = {}
        for link, stations in links.groups:
            links.connect(link)
            client = Client(link, self._clock, self._timeout_s)
            clients |= dict.fromkeys(stations, client)
            if isinstance(link, RtuLink):
                until = self._clock.now_ns() + round(1e9 * self._timeout_s)
                check_echo(link, self._clock, stations[0], until, expected=self._options.echo)
                for station in stations:
                    check_alone(link, self._clock, station, round(1e9 * self._timeout_s))
        began = self._clock.now_ns()
        before = {station: commanded(station, client) for station, client in clients.items()}
        changed = list(changed_by_others(self._clock, clients, before, began))
        self._faults += changed
        self.warnings = [one.text for one in changed]
        for station, client in clients.items():
            bringup = Bringup(station, client, self._options, self._bus, self._clock, self.notes)
            bringup.run()
            settings.append(bringup.settings)
            name = station.device.axis.name
            self.identities[name] = bringup.identity
            if bringup.unwatched:
                unwatched[name] = bringup.unwatched
            # It has confirmed that it is off.
            self.unconfirmed.pop(name, None)
        refuse_differences(self._bus, settings)
        self.notes += links.notes
        links.gather()
        self._try_exchange(links)
        self._enabling = self._new_enabling(links)
        self._read_back = ReadBack(links.groups, self._clock)
        self.unwatched = unwatched

    def attach(self) -> None:
        """Take drives for enabled without a request: to measure a cycle."""
        links = self._links = self._make_links()
        for link, _ in links.groups:
            links.connect(link)
        links.gather()
        self._opened = self._on = links.watching = True
        for station in self.stations:
            station.on = True

    def _make_links(self) -> Links:
        self.stations = self.make_stations()
        return Links(self._options, self._bus, self._clock, self._transport, self.stations)

    def _new_enabling(self, links: Links) -> Enabling:
        return Enabling(links, self._options, self._bus, self._clock, self._timeout_s)

    def make_stations(self) -> list[Station]:
        """Return a fresh station for every device."""
        return [Station(device, self._bus.rate_hz, self._clock) for device in self._devices]

    @property
    def _timeout_s(self) -> float:
        options = self._options
        wire = 80.0 * options.bits / options.baud if options.link == "rtu" else 0.0
        return RESPONSE_S + wire + options.turnaround + options.late_s

    def _try_exchange(self, links: Links) -> None:
        """Exchange a few times as every cycle will, and see that TCP drives are fast enough."""
        spans: list[int] = []
        for number in range(TRIALS):
            began = self._clock.now_ns()
            links.start()
            links.collect(began + round(1e9 * self._timeout_s))
            silent = [
                station.label for station in self.stations if not station.transaction.complete
            ]
            if not silent:
                spans.append(self._clock.now_ns() - began)
                if self._options.link == "rtu":
                    break
            elif not spans and number == TRIALS - 1:
                wrong = "; ".join(f"{name}: {text}" for name, text in self.misses.items())
                raise BusTimeout(
                    f"{', '.join(silent)}: no response to the cyclic request, although each "
                    f"drive responded on its own; {wrong or _likely_cause(links, silent)}"
                )
        for link, _ in links.groups:
            link.abandon()  # a drive that was silent in the last of them still owes its answer
        self._reset_stations()
        if self._options.link == "tcp":
            self._check_time(links, statistics.median(spans) * 1e-9)

    def _check_time(self, links: Links, spent_s: float) -> None:
        bus = self._bus
        requests = reads = 1
        for link, stations in links.groups:
            if isinstance(link, TcpLink):
                plans = [station.plan for station in stations]
                at_once = link.outstanding
                requests = max(requests, rounds([len(plan.requests) for plan in plans], at_once))
                reads = max(reads, rounds([len(plan.reads) for plan in plans], at_once))
        spent_s *= requests / reads
        allowed = (bus.divisor - 1.0 + READ_SHARE) / (bus.rate_hz * bus.divisor)
        self.notes.append(
            f"bus {bus.name}: an exchange takes {spent_s * 1e3:.3g} ms (measured) of "
            f"{allowed * 1e3:.3g} ms available"
        )
        if spent_s > allowed:
            nth = 1
            while (nth - 1.0 + READ_SHARE) / (bus.rate_hz * bus.divisor) < spent_s:
                nth += 1
            raise BusBudgetError(
                f"bus {bus.name}: an exchange takes {spent_s * 1e3:.3g} ms (measured), but only "
                f"{allowed * 1e3:.3g} ms are available; divisor: {nth} on this bus fits"
            )

    # -- enabling ---------------------------------------------------------------------------

    def _enable(self) -> bool:
        """Enable step by step, then keep the watchdogs from expiring.

        Raises
        ------
        DeviceFault, BusTimeout, DriverError
            A drive refuses, or takes too long, or is gone; the sentence says which.
        """
        links, enabling = self._links, self._enabling
        assert links is not None
        assert enabling is not None
        ready = enabling.step()
        self._on = links.watching = enabling.done
        return ready

    @property
    def misses(self) -> dict[str, str]:
        """What came instead of the responses of an axis, as text."""
        links = self._links
        causes = (
            {}
            if links is None
            else {
                station.device.axis.name: link.misses(station.device.unit)
                for link, stations in links.groups
                for station in stations
            }
        )
        return {name: text for name, text in causes.items() if text}

    # -- every cycle ----------------------------------------------------------------------

    def request(self) -> None:
        """Send the staged commands and request the state, of TCP drives all at once."""
        if self._links is not None:
            self._links.start()

    def poll(self) -> None:
        """Take in what has come and send what follows; called between `request` and `read`."""
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
        if self._read_back is not None and self._on:
            self._read_back.read(deadline_ns)
        for station in self.stations:
            if station.faults:
                self._faults += station.faults
                station.faults.clear()
        return states

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Stage one command per axis for the next request."""
        for station, command in zip(self.stations, commands, strict=True):
            station.command(command)

    def answered_us(self, at: int) -> float:
        """Return how long a drive took to respond [us]; NaN: it did not."""
        transaction = self.stations[at].transaction
        if not (transaction.complete and transaction.sent_ns):
            return math.nan
        return (transaction.received_ns - transaction.sent_ns[0]) * 1e-3

    def motor_effort(self, at: int) -> float:
        """Return the effort that a drive reports of its motor [N m or N]; NaN: no response."""
        station = self.stations[at]
        return station.motor_effort if station.transaction.complete else math.nan

    # -- afterwards -----------------------------------------------------------------------

    def disable(self) -> None:
        """Safe command, then off, and watchdogs off; `close` tries again who did not confirm it."""
        links = self._links
        self._on = False
        names = [one.device.axis.name for one in self.stations if one.procedure is not None]
        if links is None or not names:
            return
        links.watching = False
        self.unconfirmed |= dict.fromkeys(names, "it was not commanded to switch off")
        doubtful = leave(links, self._clock)
        for name in names:
            del self.unconfirmed[name]
        self.unconfirmed |= doubtful
        self._reset_stations()
        self._enabling = self._new_enabling(links)

    def _reset_stations(self) -> None:
        for station in self.stations:
            station.reset()

    def _end(self) -> None:
        if self._links is not None and self.unconfirmed:
            self.unconfirmed = leave_again(self._links, self._clock, self.unconfirmed)

    def _release(self) -> None:
        self._enabling = self._read_back = None
        links, self._links = self._links, None
        if links is not None:
            links.close()
