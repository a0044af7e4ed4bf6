"""Resolve files in a rig to absolute paths, and parts (`part: ./my_hand.py`) to path and hash."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from tautwave import registry
from tautwave.config.inputs.recordings import find_recording
from tautwave.config.text.document import Document
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError

PLACES = (("simulation", "hand"), ("simulation", "environment"))


def name_file_parts(document: Document) -> None:
    """Write path and hash of every part that is a file into the document.

    A hash that is already there must match the file: a resolved rig runs exactly what it ran
    before.
    """
    coupling = document.get(("coupling",))
    if isinstance(coupling, dict):
        _name_law(document, coupling)
    for place in PLACES:
        blocks = document.get(place)
        for name in blocks if isinstance(blocks, dict) else ():
            _name_file(document, (*place, name))


def _name_law(document: Document, coupling: dict[str, Any]) -> None:
    """Take `part` for `law` where that is a file: `coupling: {part: ./my_law.py, pairs: ...}`."""
    if "part" in coupling and "law" not in coupling:
        coupling["law"] = coupling.pop("part")
    _name_file(document, ("coupling",), "law")


def _name_file(document: Document, path: KeyPath, key: str = "part") -> None:
    block = document.get(path)
    name = block.get(key) if isinstance(block, dict) else None
    if not isinstance(name, str) or not registry.is_file_part(name):
        return
    block[key] = whole = str((document.folder / name).resolve())
    try:
        digest = registry.hash_part(whole)
    except ConfigError:
        return  # reported where its keys are looked up
    given = block.setdefault("part_sha256", digest)
    if given is None:
        block["part_sha256"] = digest
    elif given != digest:
        document.report(
            (*path, "part_sha256"),
            f"the text of {whole} has changed (SHA-256 {digest}); restore the file, or remove "
            f"this key to run the current text",
        )


def name_option_files(document: Document) -> None:
    """Replace file paths in the options of buses (`DriverPlugin.files`) by absolute ones.

    They are relative to the same folder as those of recordings; a name without suffix is a run's
    directory, or comes with the driver.
    """
    buses = document.get(("buses",))
    for bus in buses if isinstance(buses, dict) else ():
        path = ("buses", bus, "options")
        for pattern in _files_of(document.get(("buses", bus, "driver"))):
            for at in _matching(document.get(path), pattern, path):
                block, name = document.get(at[:-1]), document.get(at)
                if not isinstance(name, str):
                    continue
                absolute = find_recording(document, at, name)
                if Path(name).suffix:
                    block[at[-1]] = str(absolute or (document.folder / name).resolve())
                elif absolute is not None and absolute.is_dir():
                    block[at[-1]] = str(absolute)


def _files_of(driver: object) -> Sequence[Sequence[str]]:
    try:
        return registry.load_driver(driver).files if isinstance(driver, str) else ()
    except ConfigError:
        return ()  # reported where its options are checked


def _matching(value: Any, pattern: Sequence[str], at: KeyPath) -> Iterator[KeyPath]:
    """Yield the full path of each key under `value` (itself at `at`) that matches a pattern."""
    if not pattern:
        yield at
        return
    first, *rest = pattern
    if first == "*":
        for index, item in enumerate(value if isinstance(value, list) else ()):
            yield from _matching(item, rest, (*at, index))
    elif isinstance(value, dict) and first in value:
        yield from _matching(value[first], rest, (*at, first))
