"""Which devices there are: scans of the buses that are named, or of all that can be reached."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave import registry
from tautwave.contracts import DriverPlugin, ScanProgress
from tautwave.errors import ConfigError, TautwaveError
from tautwave.types import FoundBus, Survey


class Place(NamedTuple):
    """A bus to scan: a driver's name and the options of its scan; `name` is '' or the rig's."""

    driver: str
    options: Any
    name: str = ""


def places() -> list[Place]:
    """Return every bus that this machine could reach and a driver knows how to find."""
    reachable = []
    for driver in registry.driver_names():
        try:
            plugin = registry.load_driver(driver)
            if plugin.survey is None or plugin.scan_options is None:
                continue
            registry.require_modules(driver)
        except ConfigError:
            continue  # its extra is not installed: nothing to be scanned with it
        options = plugin.scan_options
        reachable += [
            Place(driver, options.model_validate(given)) for given in plugin.survey.places()
        ]
    return reachable


def survey(places: Sequence[Place], progress: ScanProgress) -> tuple[list[FoundBus], list[str]]:
    """Scan every place; return the buses with a device, and a sentence for each without.

    Raises
    ------
    ConfigError
        A driver cannot be surveyed.
    """
    buses: list[FoundBus] = []
    without = []
    for place in places:
        plugin = registry.load_driver(place.driver)
        known = surveyor(place.driver, plugin)
        try:
            rows = plugin.scan(place.options, progress)
        except ConfigError:
            raise
        except TautwaveError as err:
            without.append(str(err))
            continue
        proposed = known.propose(place.options, rows)
        if not proposed:
            without.append(f"{place.driver}: no device that a rig can drive on {_where(place)}")
        buses += [bus._replace(name=place.name or bus.name) for bus in proposed]
    return _named(buses), without


def described(kind: str, path: Path, ids: Sequence[int]) -> FoundBus:
    """Return a bus of the devices that a file describes, such as an EDS.

    Raises
    ------
    ConfigError
        No driver takes such files, or this is none.
    """
    for driver in registry.driver_names():
        plugin = registry.load_driver(driver)
        if plugin.survey is not None and plugin.survey.describe and plugin.survey.file == kind:
            return plugin.survey.describe(path, ids)
    raise ConfigError(f"new: no installed driver reads a file of kind {kind}")


def surveyor(driver: str, plugin: DriverPlugin) -> Survey:
    """Return how a driver makes parts of a rig file.

    Raises
    ------
    ConfigError
        It does not.
    """
    if plugin.survey is None or plugin.scan_options is None:
        raise ConfigError(f"new: driver {driver} does not support scanning; write its bus by hand")
    return plugin.survey


def _where(place: Place) -> str:
    given = place.options.model_dump(exclude_unset=True)
    return ", ".join(f"{key} {value}" for key, value in given.items()) or "its default"


def _named(buses: Sequence[FoundBus]) -> list[FoundBus]:
    """Give buses of the same name a number."""
    names = [bus.name for bus in buses]
    named = []
    for at, bus in enumerate(buses):
        number = names[: at + 1].count(bus.name)
        named.append(bus._replace(name=f"{bus.name}{number}" if number > 1 else bus.name))
    return named
