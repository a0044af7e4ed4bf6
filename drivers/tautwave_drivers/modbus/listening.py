"""Another master at a drive: what only a master writes changes before this one has written.

A Modbus master does not receive what others send. A panel writes such values too, and so do some
drives by themselves, so a change is a warning and not a refusal.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.contracts import Clock
from tautwave.types import Fault
from tautwave_drivers.modbus.line.client import Client
from tautwave_drivers.modbus.profile import Role
from tautwave_drivers.modbus.protocol import frames
from tautwave_drivers.modbus.protocol.registers import Place
from tautwave_drivers.modbus.station import Station

LISTEN_NS = 100_000_000
"""A master that moves drives writes ten times a second at least."""
MASTERS: tuple[Role, ...] = (
    "command_effort",
    "command_velocity",
    "command_position",
    "mode",
    "control",
)
"""Roles that a master writes; what a drive reports changes anyway."""

Values = Mapping[str, int]


def changed_by_others(
    clock: Clock, clients: Mapping[Station, Client], before: Mapping[Station, Values], since_ns: int
) -> Iterator[Fault]:
    """Yield a warning for every drive that another master commands; nothing is written meanwhile.

    Parameters
    ----------
    clock : Clock
        What waits.
    clients : mapping
        Every drive, and what sends its requests.
    before : mapping
        What `commanded` found of each.
    since_ns : int
        When that was.

    Raises
    ------
    BusTimeout
        A drive has gone.
    """
    clock.sleep_until(since_ns + LISTEN_NS)
    for station, client in clients.items():
        then, now = before[station], commanded(station, client)
        changed = [
            f"{name} {then[name]} -> {value}"
            for name, value in now.items()
            if then.get(name, value) != value
        ]
        if changed:
            text = (
                f"{station.label}: {', '.join(changed)} within {LISTEN_NS * 1e-9:g} s, before "
                "anything was written here: another master or the panel writes to it; stop it "
                "before somebody takes hold of the axis"
            )
            yield Fault(station.device.axis.name, text, False)


def commanded(station: Station, client: Client) -> Values:
    """Return the values in a drive that a master writes; what cannot be read is left out.

    Raises
    ------
    BusTimeout
        It does not answer.
    """
    profile = station.device.profile
    names = [
        name
        for role in MASTERS
        if (name := profile.roles.get(role)) and "r" in profile.registers[name].access
    ]
    values: dict[str, int] = {}
    for block in profile.blocks(list(dict.fromkeys(names))):
        pdu = client.request(station, station.codec.read_block(block))
        if pdu[0] & frames.REFUSED:
            continue
        for name in block.names:
            register = profile.registers[name]
            if block.words == register.words:
                values[name] = station.codec.decode(name, pdu)
            else:
                low_first = profile.low_first(register)
                place = Place(register.address - block.address, register.type, low_first)
                values[name] = place.reader()(pdu)
    return values
