"""Switching drives off: whether one is off is judged by its own report, not by what was sent.

Nothing here goes through the ledger of settings: it ends at the first write that is not taken, and
here the motor has to be switched off all the same. The drive's state is read back here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping

from tautwave.contracts import Clock
from tautwave.errors import DeviceFault, DriverError
from tautwave_drivers.modbus.line.client import PAUSE_NS, Client
from tautwave_drivers.modbus.line.link import Link
from tautwave_drivers.modbus.line.links import Links
from tautwave_drivers.modbus.line.tcp import TcpLink
from tautwave_drivers.modbus.sequence import Steps, refusal
from tautwave_drivers.modbus.station import Station

RESPONSE_S, TRIES = 0.15, 2
"""Timeout of a response, and number of tries."""
BUSY_S = 0.1
"""How long a drive that says it is busy is asked again: each request keeps its own time-out fed."""
OFF_S = 0.1
"""How long a motor may take to be off."""
AGAIN_S = 0.5
"""How long the second try may take, for all drives that were not confirmed to be off."""


def leave(links: Links, clock: Clock) -> dict[str, str]:
    """Switch off every drive that was being enabled or is; return who did not confirm it, and why.

    A lost link is not opened again: other buses still have to be switched off.
    """
    doubtful: dict[str, str] = {}
    for link, stations in links.groups:
        link.abandon()
        client = Client(link, clock, RESPONSE_S, TRIES, BUSY_S)
        for station in stations:
            if station.procedure is not None:
                why = _told(link, client, station, clock)
                if why:
                    doubtful[station.device.axis.name] = why
            station.procedure = None
            station.on = False
    return doubtful


def leave_again(links: Links, clock: Clock, doubtful: Mapping[str, str]) -> dict[str, str]:
    """Try once more, over fresh connections, for the drives of these axes; return who is left."""
    left = dict(doubtful)
    until = clock.now_ns() + round(1e9 * AGAIN_S)
    for link, stations in links.groups:
        behind = [station for station in stations if station.device.axis.name in left]
        if not behind:
            continue
        if isinstance(link, TcpLink) and not link.lost:
            link.drop("the connection is opened again")
        if link.lost:
            links.reach(link, (until - clock.now_ns()) * 1e-9)
        client = Client(link, clock, RESPONSE_S, 1, BUSY_S)
        for station in behind:
            if clock.now_ns() >= until:
                break
            station.reset()
            why = _told(link, client, station, clock)
            if why:
                left[station.device.axis.name] = why
            else:
                del left[station.device.axis.name]
    return left


def _told(link: Link, client: Client, station: Station, clock: Clock) -> str:
    """Switch a drive off; return why that was not confirmed, '' if it was."""
    why = link.lost
    if not why:
        try:
            switch_off(client, station, clock)
        except Exception as err:  # noqa: BLE001  the others have to be switched off too
            why = str(err)
    return f"unit {station.device.unit} did not confirm that it is off: {why}" if why else ""


def switch_off(client: Client, station: Station, clock: Clock) -> None:
    """Zero command first, whatever happens after it; watchdog off once the motor is.

    Raises
    ------
    DeviceFault, DriverError
        It does not confirm that it is off.
    """
    profile, codec = station.device.profile, station.codec
    role = "command_effort" if station.device.impedance else "command_velocity"
    station.stage(0)
    with contextlib.suppress(DriverError):
        client.request(station, codec.write(profile.roles[role], 0))  # type: ignore[index]
        for step in profile.after_command:
            client.request(station, codec.write(step.register_name, step.value))
    if station.machine is not None:
        station.machine.disable()
        client.run(station, station.machine, 0.5)
    else:
        steps = Steps(station.label, "disable", codec, profile.disable, clock)
        client.run(station, steps, 1.0)
        _verify_off(client, station, clock)
    if station.arming and profile.comm_loss is not None:
        client.request(station, codec.write(profile.comm_loss.register_name, profile.comm_loss.off))


def _verify_off(client: Client, station: Station, clock: Clock) -> None:
    """Ask a drive for its state: that it took the sequence says nothing about its motor."""
    profile, codec = station.device.profile, station.codec
    name, states = profile.roles["status"], profile.states
    assert states is not None
    until = clock.now_ns() + round(1e9 * OFF_S)
    while True:
        pdu = client.request(station, codec.read(name))
        status = None if refusal(pdu) else codec.decode(name, pdu)
        if status is not None and not states.enabled.fits(status):
            return
        if clock.now_ns() >= until:
            shown = refusal(pdu) if status is None else f"its status is {status:#x}"
            raise DeviceFault(f"it still reports that it is enabled: {shown}")
        clock.sleep_until(clock.now_ns() + PAUSE_NS)
