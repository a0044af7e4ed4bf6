"""Which device is in the hand and which at the task: `servos:1-6`, `can:1,3`, `arm`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.errors import ConfigError
from tautwave.types import FoundBus, FoundDevice


class Chosen(NamedTuple):
    """A device and its bus."""

    bus: FoundBus
    device: FoundDevice


def select(text: str, buses: Sequence[FoundBus], what: str) -> list[Chosen]:
    """Return the devices that `text` names, in that order.

    Parameters
    ----------
    text : str
        Parts separated by blanks: `BUS:IDS`, `BUS` for all of its devices, or `IDS` where there is
        only one bus; ids such as `1-6` or `1,2,5`.
    buses : sequence of FoundBus
        What there is.
    what : str
        Option or question, for messages.

    Raises
    ------
    ConfigError
        A bus or an id is not there, or is named twice.
    """
    known = {bus.name: bus for bus in buses}
    chosen: list[Chosen] = []
    for part in text.split():
        name, colon, ids = part.partition(":")
        if not colon and name not in known:
            if len(buses) > 1:
                raise ConfigError(f"{what} {part!r}: buses: {', '.join(known)}; write BUS:IDS")
            name, ids = next(iter(known)), part
        if name not in known:
            raise ConfigError(f"{what}: no bus {name!r}; found: {', '.join(known)}")
        chosen += [Chosen(known[name], one) for one in _devices(known[name], ids, what)]
    twice = [one for one in chosen if chosen.count(one) > 1]
    if twice:
        raise ConfigError(f"{what}: {twice[0].bus.name}:{twice[0].device.id} is named twice")
    if not chosen:
        raise ConfigError(f"{what}: lists no devices")
    return chosen


def halves(buses: Sequence[FoundBus]) -> tuple[str, str]:
    """Return a first guess for master and slave, each as `select` reads it; '' if there is none.

    Two buses with as many devices are one side each; one bus is cut in the middle.
    """
    if len(buses) == 2 and len(buses[0].devices) == len(buses[1].devices):
        return buses[0].name, buses[1].name
    if len(buses) == 1 and len(buses[0].devices) % 2 == 0:
        ids = [device.id for device in buses[0].devices]
        middle = len(ids) // 2
        return _text(ids[:middle]), _text(ids[middle:])
    return "", ""


def _text(ids: Sequence[int]) -> str:
    if len(ids) > 1 and list(ids) == list(range(ids[0], ids[0] + len(ids))):
        return f"{ids[0]}-{ids[-1]}"
    return ",".join(str(number) for number in ids)


def _devices(bus: FoundBus, ids: str, what: str) -> list[FoundDevice]:
    if not ids:
        return list(bus.devices)
    by_id = {device.id: device for device in bus.devices}
    devices = []
    for number in numbers(ids, what):
        if number not in by_id:
            raise ConfigError(
                f"{what}: bus {bus.name} has no device {number}; it has {_text(list(by_id))}"
            )
        devices.append(by_id[number])
    return devices


def numbers(text: str, what: str) -> list[int]:
    """Return the numbers of `1-6` or `1,2,5`, 0 to 255.

    Raises
    ------
    ConfigError
        It is written otherwise.
    """
    listed: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        ends = (first, last) if dash else (first, first)
        if not all(word.isascii() and word.isdigit() and len(word) < 4 for word in ends):
            raise ConfigError(f"{what} {text!r}: write ids like 1-6 or 1,2,5")
        begin, end = int(ends[0]), int(ends[1])
        if not begin <= end <= 255:
            raise ConfigError(f"{what} {text!r}: ids are 0 to 255, the lower one first")
        listed += range(begin, end + 1)
    return listed
