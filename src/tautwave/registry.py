"""Entry points to plugins: looked up by name, imported only when that name is used.

A third party adds a bus with one line in its `pyproject.toml`:

    [project.entry-points."tautwave.drivers"]
    mybus = "my_package:plugin"
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from typing import Any, NamedTuple

from tautwave.contracts import DriverPlugin, SimulatorPlugin
from tautwave.errors import ConfigError

DRIVERS = "tautwave.drivers"
SIMULATORS = "tautwave.simulators"


class Installed(NamedTuple):
    """One installed driver; `missing` names what it still needs, or says why it does not load."""

    name: str
    package: str
    version: str
    summary: str
    hardware: bool
    missing: tuple[str, ...]


def driver_names() -> list[str]:
    """Return the names of the installed drivers, sorted."""
    return sorted(_find(DRIVERS))


def load_driver(name: str) -> DriverPlugin:
    """Return the driver plugin `name`.

    Raises
    ------
    ConfigError
        No such driver is installed (the known ones are listed), or it cannot be imported (the
        extra to install is named).
    """
    plugin: DriverPlugin = _load(DRIVERS, name, DriverPlugin)
    return plugin


def load_simulator(name: str) -> SimulatorPlugin:
    """Return the simulator plugin `name`.

    Raises
    ------
    ConfigError
        As for `load_driver`.
    """
    plugin: SimulatorPlugin = _load(SIMULATORS, name, SimulatorPlugin)
    return plugin


def list_drivers() -> list[Installed]:
    """Return every installed driver; one that does not load is listed with the reason."""
    return [_describe(name, point) for name, point in sorted(_find(DRIVERS).items())]


def missing_modules(needs: Iterable[str]) -> tuple[str, ...]:
    """Return those of the modules that are not installed."""
    return tuple(module for module in needs if not _importable(module))


def require_modules(name: str) -> None:
    """Refuse the driver `name` where what it needs to move devices is not installed.

    Raises
    ------
    ConfigError
        It names the modules, and what to install.
    """
    missing = missing_modules(load_driver(name).needs)
    if missing:
        remedy = _remedy(_find(DRIVERS)[name])
        raise ConfigError(f"driver {name!r} needs {', '.join(missing)}; {remedy}")


def _find(group: str) -> dict[str, EntryPoint]:
    return _found(entry_points, group)


@lru_cache(maxsize=8)  # every call reads the metadata of all that is installed: 5 ms
def _found(look_up: Callable[..., Iterable[EntryPoint]], group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in look_up(group=group)}


def _load(group: str, name: str, kind: type[Any]) -> Any:
    what = group.removeprefix("tautwave.").removesuffix("s")
    found = _find(group)
    if name not in found:
        raise ConfigError(_unknown(what, name, sorted(found)))
    point = found[name]
    try:
        plugin = point.load()
    except Exception as err:
        raise ConfigError(
            f"{what} {name!r} ({point.value}) does not import: {type(err).__name__}: {err}; "
            f"{_remedy(point)}"
        ) from err
    if not isinstance(plugin, kind):
        raise ConfigError(
            f"{what} {name!r}: {point.value} is no {kind.__name__} "
            f"but of type {type(plugin).__name__}"
        )
    return plugin


def _unknown(what: str, name: str, known: list[str]) -> str:
    from difflib import get_close_matches

    if not known:
        return f"unknown {what} {name!r}; none is installed (pip install tautwave, once more)"
    close = get_close_matches(name, known, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else "."
    return f"unknown {what} {name!r}{hint} Installed: {', '.join(known)}"


def _remedy(point: EntryPoint) -> str:
    """Return what to install: the extra that is called like the driver, if there is one."""
    package, extras = "tautwave", [point.name]
    if point.dist is not None:
        package = point.dist.name
        extras = point.dist.metadata.get_all("Provides-Extra") or []
    if point.extras or point.name in extras:
        return f"pip install '{package}[{','.join(point.extras) or point.name}]'"
    return f"pip install --upgrade {package}"


def _describe(name: str, point: EntryPoint) -> Installed:
    package = point.dist.name if point.dist is not None else ""
    version = point.dist.version if point.dist is not None else ""
    try:
        plugin = _load(DRIVERS, name, DriverPlugin)
    except ConfigError as err:
        return Installed(name, package, version, "", True, (str(err),))
    missing = missing_modules(plugin.needs)
    return Installed(name, package, version, plugin.summary, plugin.hardware, missing)


def _importable(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False
