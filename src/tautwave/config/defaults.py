"""`defaults`: keys written once for all axes of a side or a bus, or for all pairs.

They are put into each block before anything is checked, so every check sees whole blocks. The
document remembers where each value was written, and its messages name that place.
"""

from __future__ import annotations

import copy
from typing import Any

from tautwave.config.text.document import Document, show_value
from tautwave.config.text.yaml12 import KeyPath

_SIDES = ("master", "slave")


def expand_defaults(document: Document) -> None:
    """Fill every axis and pair from the defaults around it, and remove those.

    An axis takes its own keys first, then its side's, then its bus'. Mappings are merged key by
    key; anything else is replaced as a whole.
    """
    sides = {side: _take(document, (side, "defaults")) for side in _SIDES}
    named = document.get(("buses",))
    names = named if isinstance(named, dict) else {}
    buses = {name: _take(document, ("buses", name, "defaults")) for name in names}
    by_bus: dict[str, list[KeyPath]] = {name: [] for name in names}
    for side, defaults in sides.items():
        blocks = _blocks(document, (side, "axes"))
        _fill(document, (side, "defaults"), defaults, blocks, "axis of this side")
        for path in blocks:
            bus = document.get((*path, "bus"))
            if isinstance(bus, str) and bus in by_bus:
                by_bus[bus].append(path)
    for name, blocks in by_bus.items():
        _fill(document, ("buses", name, "defaults"), buses[name], blocks, "axis on this bus")
    where = ("coupling", "defaults")
    pairs = _blocks(document, ("coupling", "pairs"))
    _fill(document, where, _take(document, where), pairs, "pair")


def _take(document: Document, path: KeyPath) -> dict[str, Any]:
    """Remove and return the defaults at `path`, {} if there are none."""
    around = document.get(path[:-1])
    if not isinstance(around, dict) or path[-1] not in around:
        return {}
    defaults = around.pop(path[-1])
    if not isinstance(defaults, dict):
        document.report(path, f"Input should be a mapping (got {show_value(defaults)})")
        return {}
    return defaults


def _blocks(document: Document, path: KeyPath) -> list[KeyPath]:
    named = document.get(path)
    pairs = named.items() if isinstance(named, dict) else ()
    return [(*path, name) for name, block in pairs if isinstance(block, dict)]


def _fill(
    document: Document,
    source: KeyPath,
    defaults: dict[str, Any],
    blocks: list[KeyPath],
    taker: str,
) -> None:
    for key, value in defaults.items():
        taken = [_put(document, (*source, key), value, (*block, key)) for block in blocks]
        if not any(taken):
            document.report((*source, key), f"no {taker} uses this default; remove it")


def _put(document: Document, source: KeyPath, value: Any, path: KeyPath) -> bool:
    """Put a default at `path` where nothing stands, or below it; return whether it is used."""
    block = document.get(path[:-1])
    if path[-1] not in block:
        block[path[-1]] = copy.deepcopy(value)
        document.take_from(source, path)
        return True
    if not (isinstance(value, dict) and isinstance(block[path[-1]], dict)):
        return document.mark(path).argument is not None  # --set goes first, for once
    below = [_put(document, (*source, key), inner, (*path, key)) for key, inner in value.items()]
    return any(below)
