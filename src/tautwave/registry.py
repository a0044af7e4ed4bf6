"""Entry points to plugins: looked up by name, imported only when that name is used.

A third party adds a bus, or a coupling, with one line in its `pyproject.toml`:

    [project.entry-points."tautwave.drivers"]
    mybus = "my_package:plugin"
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from functools import lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, EntryPoints, distributions
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from types import ModuleType
from typing import Any, NamedTuple

from tautwave.contracts import (
    ControlPlugin,
    CouplingPlugin,
    DriverPlugin,
    SimulatorPlugin,
)
from tautwave.errors import ConfigError
from tautwave.reading import digest_of
from tautwave.wording import CouplingMessages

DRIVERS = "tautwave.drivers"
SIMULATORS = "tautwave.simulators"
COUPLINGS = "tautwave.couplings"
CONTROLS = "tautwave.controls"
ENVIRONMENTS = "tautwave.environments"
HANDS = "tautwave.hands"


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


def coupling_names() -> list[str]:
    """Return the names of the installed couplings, sorted."""
    return sorted(_find(COUPLINGS))


def load_coupling(name: str) -> CouplingPlugin:
    """Return the coupling `name` (or that of a file): its declaration, without loading its code.

    Raises
    ------
    ConfigError
        As for `load_driver`.
    """
    plugin: CouplingPlugin = load_part(COUPLINGS, name)
    return plugin


def load_control(key: str) -> ControlPlugin:
    """Return what stands between the axes of a rig with this key, in place of a coupling.

    Raises
    ------
    ConfigError
        Its package is not installed, or does not import.
    """
    point = _find(CONTROLS).get(key)
    if point is None or not _importable(point.module.partition(".")[0]):
        package = f"tautwave_{key}s" if point is None else point.module.partition(".")[0]
        raise ConfigError(
            f"a rig with a {key} needs the package {package}, which is not installed here: "
            "pip install --force-reinstall --no-deps tautwave"
        )
    plugin: ControlPlugin = _load(CONTROLS, key, ControlPlugin)
    return plugin


@lru_cache(maxsize=32)
def control_hooks(key: str, room: str) -> Any:
    """Return the module that a room of tautwave calls for rigs with this key.

    Raises
    ------
    ConfigError
        As for `load_control`.
    """
    return import_module(getattr(load_control(key), room))


def part_names(group: str) -> list[str]:
    """Return the names of the installed parts of a group such as `HANDS`, sorted."""
    return sorted(_find(group))


def load_part(group: str, name: str) -> Any:
    """Return a part by its name or, where that ends in `.py`, from that file.

    Raises
    ------
    ConfigError
        As for `load_driver`; or the file does not exist, does not import, or has no `plugin`.
    """
    if not is_file_part(name):
        return _load(group, name, _kind_of(group))
    plugin = getattr(_file_module(name, hash_part(name)), "plugin", None)
    kind = _kind_of(group)
    if not isinstance(plugin, kind):
        raise ConfigError(f"{name}: there is no `plugin`, a tautwave {kind.__name__}")
    return plugin


def _kind_of(group: str) -> type[Any]:
    """Return what a part of a group is; a rig that simulates no such part loads no truth."""
    if group == COUPLINGS:
        return CouplingPlugin
    from tautwave.truth import EnvironmentPlugin, HandPlugin

    return EnvironmentPlugin if group == ENVIRONMENTS else HandPlugin


def is_file_part(name: str) -> bool:
    """Return whether a part is named by its file."""
    return name.endswith(".py")


def hash_part(path: str) -> str:
    """Return the SHA-256 of a part's file, in hexadecimal digits.

    Raises
    ------
    ConfigError
        It cannot be read.
    """
    try:
        return digest_of(path)
    except OSError as err:
        raise ConfigError(f"{path}: cannot be read: {err.strerror}") from err


@lru_cache(maxsize=64)
def _file_module(path: str, digest: str) -> ModuleType:
    """Import a file under a unique name, once for each version of its text."""
    name = f"tautwave_part_{digest[:16]}"
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[name] = module  # so that its definitions can be found by pickling and the like
    try:
        spec.loader.exec_module(module)
    except Exception as err:
        del sys.modules[name]
        raise ConfigError(f"{path} does not import: {type(err).__name__}: {err}") from err
    return module


def coupling_messages(name: str) -> CouplingMessages:
    """Return the messages of the coupling `name`; default ones if its part has none.

    Raises
    ------
    ConfigError
        As for `load_coupling` and `load_named`.
    """
    named = load_coupling(name).messages
    messages: CouplingMessages = load_named(named) if named else CouplingMessages()
    return messages


def load_named(text: Any) -> Any:
    """Return the object that `module:attribute` names; a part may also declare the object itself.

    Raises
    ------
    ConfigError
        It does not import, or there is no such attribute.
    """
    return _named(text) if isinstance(text, str) else text


@lru_cache(maxsize=256)
def _named(text: str) -> Any:
    module, _, attribute = text.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except Exception as err:
        raise ConfigError(f"{text} does not import: {type(err).__name__}: {err}") from err


def list_drivers() -> list[Installed]:
    """Return every installed driver; one that does not load is listed with the reason."""
    return [_describe(name, point) for name, point in sorted(_find(DRIVERS).items())]


def unknown_word(what: str, name: str, known: list[str]) -> str:
    """Return the message about an unknown name, with the nearest installed one."""
    from difflib import get_close_matches

    if not known:
        again = "" if what in ("hand", "environment") else " (pip install tautwave, once more)"
        return f"unknown {what} {name!r}; none is installed{again}"
    close = get_close_matches(name, known, n=1)
    hint = f"; did you mean {close[0]!r}?" if close else "."
    return f"unknown {what} {name!r}{hint} Installed: {', '.join(known)}"


def list_parts(group: str) -> list[Installed]:
    """Return every installed part of a group; one that does not load is listed with the reason."""
    return [_describe_part(group, name, point) for name, point in sorted(_find(group).items())]


def missing_modules(needs: Iterable[str]) -> tuple[str, ...]:
    """Return the modules that are not installed."""
    return tuple(module for module in needs if not _importable(module))


def require_modules(name: str) -> None:
    """Refuse the driver `name` if the modules it needs to move devices are not installed.

    Raises
    ------
    ConfigError
        Its message names the modules, and what to install.
    """
    missing = missing_modules(load_driver(name).needs)
    if missing:
        remedy = _remedy(_find(DRIVERS)[name])
        raise ConfigError(f"driver {name!r} needs {', '.join(missing)}; {remedy}")


def entry_points() -> EntryPoints:
    """Return the entry points of packages that name a group of ours; others are not parsed."""
    found: dict[tuple[str, str], EntryPoint] = {}
    for package in distributions():
        if "[tautwave." in (package.read_text("entry_points.txt") or ""):
            for point in package.entry_points:
                found.setdefault((point.group, point.name), point)  # the first on the path
    return EntryPoints(found.values())


def _find(group: str) -> dict[str, EntryPoint]:
    """Return the entry points of a group by name."""
    return _found(entry_points, group)


@lru_cache(maxsize=16)
def _found(look_up: Callable[[], Any], group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in _installed(look_up).select(group=group)}


@lru_cache(maxsize=2)  # every call reads files of all installed packages
def _installed(look_up: Callable[[], Any]) -> Any:
    return look_up()


def _load(group: str, name: str, kind: type[Any]) -> Any:
    what = group.removeprefix("tautwave.").removesuffix("s")
    installed = _find(group)
    if name not in installed:
        raise ConfigError(unknown_word(what, name, sorted(installed)))
    point = installed[name]
    try:
        plugin = point.load()
    except Exception as err:
        raise ConfigError(
            f"{what} {name!r} ({point.value}) does not import: {type(err).__name__}: {err}; "
            f"{_remedy(point)}"
        ) from err
    if not isinstance(plugin, kind):
        raise ConfigError(
            f"{what} {name!r}: {point.value} is not a {kind.__name__} but of type "
            f"{type(plugin).__name__}"
        )
    return plugin


def _remedy(point: EntryPoint) -> str:
    """Return what to install: the extra with the driver's name, if there is one."""
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


def _describe_part(group: str, name: str, point: EntryPoint) -> Installed:
    package = point.dist.name if point.dist is not None else ""
    version = point.dist.version if point.dist is not None else ""
    try:
        if group == CONTROLS:
            plugin = load_control(name)
            import_module(plugin.config)
        else:
            plugin = _load(group, name, _kind_of(group))
            load_named(plugin.keys)
    except (ConfigError, ImportError) as err:
        return Installed(name, package, version, "", False, (str(err),))
    return Installed(name, package, version, plugin.summary, False, ())


def _importable(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False
