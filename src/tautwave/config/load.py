"""`load_rig`: from a file and `--set` arguments to a valid rig, or a list of all mistakes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tautwave import formats, registry
from tautwave.config.calibrated import take_calibration
from tautwave.config.checks.rig import check_parts
from tautwave.config.complete import complete_rig
from tautwave.config.defaults import expand_defaults
from tautwave.config.halves import leave_other_half
from tautwave.config.hooks import hooks_of
from tautwave.config.inputs.chains import name_chains
from tautwave.config.inputs.file_parts import name_file_parts, name_option_files
from tautwave.config.inputs.joints import order_axes
from tautwave.config.keys.common import AUTO, GREATEST, LEAST, outsized
from tautwave.config.keys.rig import UNTIL_STOPPED_S, Rig
from tautwave.config.law import certified_law, choose_law
from tautwave.config.messages import unknown_key, validate
from tautwave.config.older import take_older
from tautwave.config.pieces import pieces_of, take_apart
from tautwave.config.shipped import offer_example
from tautwave.config.text.document import Document, open_document, read_text
from tautwave.config.text.overrides import apply_overrides
from tautwave.config.text.yaml12 import KeyPath
from tautwave.contracts import DriverPlugin
from tautwave.errors import ConfigError, UnchosenKeyError
from tautwave.types import Choice


def load_rig(path: str | Path, overrides: Sequence[str] = (), *, choose: bool = True) -> Rig:
    """Read, check and complete a rig file.

    Parameters
    ----------
    path : str or Path
        The rig file, YAML 1.2, SI units; `docs/reference/rig` describes it.
    overrides : sequence of str
        `a.b=c` each, applied to the file in order; keys and values are checked like the file.
    choose : bool
        Let the law choose the keys that are left to it; else they stay `auto`, and the rig can only
        be run, whose certificate chooses in another process.

    Returns
    -------
    Rig
        Complete: drivers' options and the truth of simulated axes have their defaults filled in,
        `auto` its value, and files their whole path.

    Raises
    ------
    ConfigError
        Anything is wrong; `problems` holds every mistake with its line.
    """
    path = Path(path)
    offer_example(path)
    return parse_rig(read_text(path), path, overrides, choose=choose)


def parse_rig(
    text: str,
    path: str | Path = "rig.yaml",
    overrides: Sequence[str] = (),
    *,
    choose: bool = True,
) -> Rig:
    """Check and complete the text of a rig file, as `load_rig` does.

    Parameters
    ----------
    text : str
        The rig file's text.
    path : str or Path
        Name for messages and base of relative paths; it need not exist.
    overrides, choose : sequence of str, bool
        As for `load_rig`.

    Raises
    ------
    ConfigError
        Anything is wrong.
    """
    path = Path(path)
    document = open_document(text, str(path), path.parent)
    return finish_rig(document, path, overrides, choose=choose)


def finish_rig(
    document: Document, path: Path, overrides: Sequence[str] = (), *, choose: bool = True
) -> Rig:
    """Check and complete a document, which is consumed; the last steps of `parse_rig`.

    Raises
    ------
    ConfigError
        Anything is wrong.
    """
    _check_format(document)
    take_older(document)
    apply_overrides(document, overrides)
    expand_defaults(document)
    law = choose_law(document)
    take_calibration(document)
    leave_other_half(document)
    if isinstance(document.get(("operate",)), dict):
        document.value.setdefault("duration_s", UNTIL_STOPPED_S)
    name_file_parts(document)
    name_option_files(document)
    name_chains(document)
    order_axes(document)
    hooks = hooks_of(document)
    if hooks is not None:
        hooks.name_files(document)
    rig: Rig | None = validate(document, Rig)
    plugins = _check_drivers(document)
    parts = take_apart(document, plugins) if rig is None else pieces_of(rig, document, plugins)
    check_parts(document, parts)
    if rig is not None and rig.simulation is not None and not document.problems:
        _check_simulators(document, plugins)
    if document.problems or rig is None:
        raise ConfigError(document.sentences())
    rig = complete_rig(document, rig, plugins, path)
    if law is not None:
        rig = rig.with_law(law.choice)
    if not choose:
        return rig
    try:
        rig = choose_keys(rig)
        return rig if law is None else certified_law(rig, law, choose_keys)
    except UnchosenKeyError as err:
        raise ConfigError(f"{document.where(err.path)}: {err}") from err


def choose_keys(rig: Rig) -> Rig:
    """Return a rig with a value for each key of its coupling that is left to the law.

    Raises
    ------
    UnchosenKeyError
        The law cannot choose.
    """
    named = registry.load_coupling(rig.coupling.law).resolve if rig.scene is None else ""
    choices = registry.load_named(named)(rig) if named else {}
    return rig.with_choices(choices) if choices else rig


def choose_again(rig: Rig) -> Rig:
    """Return a rig that has been changed since it was read, with what its law takes now."""
    left = {path: Choice(AUTO, "") for path in rig.choices}
    return choose_keys(rig.with_choices(left)) if left else rig


def _check_format(document: Document) -> None:
    """Refuse a newer file before looking at its keys, which are unknown here."""
    newer = formats.too_new("rig", document.get(("format",)), formats.RIG)
    if newer is not None:
        document.problems.clear()
        document.report(("format",), newer)
        raise ConfigError(document.sentences())


def _check_drivers(document: Document) -> dict[str, DriverPlugin | None]:
    """Find the driver of every bus and check its options; None where that failed."""
    by_driver: dict[str, DriverPlugin | ConfigError] = {}
    plugins: dict[str, DriverPlugin | None] = {}
    buses = document.get(("buses",))
    for bus, block in buses.items() if isinstance(buses, dict) else ():
        plugins[bus] = None
        name = block.get("driver") if isinstance(block, dict) else None
        if not isinstance(name, str):
            continue
        if name not in by_driver:
            try:
                by_driver[name] = registry.load_driver(name)
            except ConfigError as err:
                by_driver[name] = err
        plugin = by_driver[name]
        if isinstance(plugin, ConfigError):
            document.report(("buses", bus, "driver"), str(plugin))
            continue
        plugins[bus] = plugin
        _check_options(document, plugin, ("buses", bus, "options"))
    return plugins


def _check_options(document: Document, plugin: DriverPlugin, path: KeyPath) -> None:
    options = document.get(path)
    if options is None and path[-1] not in document.get(path[:-1]):
        options = {}
    if not isinstance(options, dict):
        return  # reported by the rig's own model
    for below, number in _outsized(options):
        text = f"Input should be 0, or between {LEAST:g} and {GREATEST:g} in size (got {number:g})"
        document.report((*path, *below), text)
    if plugin.options.model_config.get("extra") is None:
        fields = plugin.options.model_fields
        known = {*fields, *(field.alias for field in fields.values())}
        for key in options.keys() - known:
            document.report((*path, key), unknown_key(key, plugin.options))
    if document.get(path) is None:
        _check_defaults(document, plugin, path)
    else:
        validate(document, plugin.options, path)


def _check_simulators(document: Document, plugins: dict[str, DriverPlugin | None]) -> None:
    """Check the options of a bus that only its simulated devices use."""
    for bus, plugin in plugins.items():
        path = ("buses", bus, "options")
        if plugin is None or not isinstance(document.get(path), dict):
            continue
        try:
            simulator = registry.load_simulator(document.get(("buses", bus, "driver")))
        except ConfigError:
            continue  # a driver may have none; a run reports it
        if simulator.options is not plugin.options:
            validate(document, simulator.options, path)


def _check_defaults(document: Document, plugin: DriverPlugin, path: KeyPath) -> None:
    """Check a driver whose `options` are left out: some may be required."""
    bare = Document(document.name, document.folder, {"options": {}})
    validate(bare, plugin.options, ("options",))
    for problem in bare.problems:
        document.report((*path, *problem.path[1:]), problem.text)


def _outsized(value: Any) -> list[tuple[KeyPath, float]]:
    """Return the numbers that no key can mean, each with its place."""
    items: list[tuple[str | int, Any]] = []
    if isinstance(value, dict):
        items = list(value.items())
    elif isinstance(value, list):
        items = list(enumerate(value))
    else:
        return [((), number) for number in outsized(value)]
    return [((key, *below), number) for key, item in items for below, number in _outsized(item)]
