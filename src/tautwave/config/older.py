"""Keys of older rig files: what replaces them, and what of version 1 may be left out unread."""

from __future__ import annotations

from pydantic import BaseModel

from tautwave import formats
from tautwave.config.keys.coupling import Coupling, Pair, pair_block
from tautwave.config.text.document import Document

_REPLACED: tuple[tuple[type[BaseModel], str, str], ...] = (
    (
        Coupling,
        "wave_filter_hz",
        "the ports of law wave filter now, each at its own rate: move it to each pair, as "
        "coupling.pairs.NAME.wave_filter_hz",
    ),
    (
        Pair,
        "drift_time_s",
        "no longer needed: positions on a wave line do not drift, and cut waves are repaid "
        "anyway; remove it",
    ),
)

MOVED_TO_PAIRS = frozenset(key for block, key, _ in _REPLACED if block is Coupling)
REMOVED_FROM_PAIRS = frozenset(key for block, key, _ in _REPLACED if block is Pair)


def replaced_key(word: str, model: type[BaseModel]) -> str:
    """Return what replaces a key that blocks like `model` had; '' if it never was one."""
    for block, key, text in _REPLACED:
        if key == word and issubclass(model, block):
            return text
    return ""


def take_older(document: Document) -> None:
    """Take a file of version 1 for one of the present version, if it says that it is of version 1.

    A resolved rig lists every key: what meant nothing under its law is left out.
    """
    version, coupling = document.get(("format",)), document.get(("coupling",))
    if version != 1 or isinstance(version, bool):
        return
    document.value["format"] = formats.RIG
    if not isinstance(coupling, dict):
        return
    if "wave_filter_hz" in pair_block(Coupling.model_for(coupling)).model_fields:
        return
    coupling.pop("wave_filter_hz", None)
    pairs = coupling.get("pairs")
    for pair in pairs.values() if isinstance(pairs, dict) else ():
        if isinstance(pair, dict):
            pair.pop("drift_time_s", None)
