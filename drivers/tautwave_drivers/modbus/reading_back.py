"""Whether drives still hold what was set, looked at between two exchanges of a running loop.

A drive whose supply dips for less than a cycle, and that comes on by itself, misses no answer and
shows no other status. So one register after the other that a power cycle resets is read again, at
the end of a cycle and only where its time allows it: no sample comes later for that.
"""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.contracts import READ_SHARE, BusSpec, Clock
from tautwave_drivers.modbus.budget import cycle_s, load_of
from tautwave_drivers.modbus.line.client import request_once
from tautwave_drivers.modbus.line.link import Link
from tautwave_drivers.modbus.options import ModbusOptions, match_devices
from tautwave_drivers.modbus.station import Station

EVERY_NS = 100_000_000
"""Between two such reads on a bus."""
ROOM = 1.5
"""A read begins only where this many times what the drive's last exchange took is left."""


class ReadBack:
    """Reads what drives have to hold, drive after drive.

    Parameters
    ----------
    groups : sequence
        The links of a bus, each with the drives behind it.
    clock : Clock
        Time.
    """

    def __init__(self, groups: Sequence[tuple[Link, Sequence[Station]]], clock: Clock) -> None:
        self._clock = clock
        self._turns = [(link, station) for link, behind in groups for station in behind]
        self._at = 0
        self._last_ns = clock.now_ns()

    def read(self, deadline_ns: int) -> None:
        """Read one register of one drive, if it is time and there is time."""
        now = self._clock.now_ns()
        if now - self._last_ns < EVERY_NS:
            return
        link, station = self._turns[self._at]
        transaction = station.transaction
        step = station.next_check() if transaction.complete and transaction.sent_ns else None
        if step is not None and not link.lost and not link.busy:
            spent_ns = transaction.received_ns - transaction.sent_ns[0]
            if now + round(ROOM * spent_ns) > deadline_ns:
                return
            request = station.codec.read(step.register_name)
            unit = station.device.unit
            station.checked(step, request_once(link, self._clock, unit, request, deadline_ns))
        self._last_ns = now
        self._at = (self._at + 1) % len(self._turns)


def unseen_dips(options: ModbusOptions, bus: BusSpec) -> list[str]:
    """Return a sentence where no cycle has time to read a register again; none where it has."""
    drives = [load_of(device) for device in match_devices(options, bus)]
    if options.link == "tcp" or not drives:
        return []  # measured when it runs
    char_s = options.bits / options.baud
    longest_s = max(
        sum(
            each.time_s(char_s, options.gap, options.turnaround) + options.latency_s
            for each in drive.exchanges
        )
        for drive in drives
    )
    slot_s = 1.0 / (bus.rate_hz * bus.divisor)
    slots = slot_s if bus.divisor > 1 else 0.0
    left_s = (bus.divisor - 1.0 + READ_SHARE) * slot_s - cycle_s(options, drives, slots)
    if left_s > ROOM * longest_s:
        return []
    return [
        "a drive that loses its power for less than a cycle and enables itself again would not be "
        "noticed: no cycle has time to read again what was set in it; a lower rate or a higher "
        "baud rate gives it"
    ]
