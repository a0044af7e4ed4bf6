"""Write a rig as YAML with every default explicit, so that it loads back to an equal rig."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from tautwave.config.keys.rig import Rig
from tautwave.config.text.yaml12 import read_scalar

_PLAIN = re.compile(r"[A-Za-z_/][A-Za-z0-9_./ -]*")
_ESCAPES = {'"': '\\"', "\\": "\\\\", "\n": "\\n", "\t": "\\t", "\r": "\\r"}


def resolved_yaml(rig: Rig) -> str:
    """Return the rig as YAML 1.2 text.

    `load_rig` on it returns an equal rig wherever the file is, as long as recorded references are
    not moved.
    """
    values = rig.model_dump(mode="json")
    for key in ("scene",) if rig.scene is None else ("slave", "coupling"):
        del values[key]
    for key in ("link", "operate", "sites", "calibration"):
        if values[key] is None:
            del values[key]
    if values.get("coupling", {}).get("part_sha256", "") is None:
        del values["coupling"]["part_sha256"]  # of an installed law
    return "\n".join(["# Resolved rig: every default is explicit.", *_lines(values, 0)]) + "\n"


def _lines(block: dict[str, Any], depth: int) -> Iterator[str]:
    for key, value in block.items():
        start = f"{'  ' * depth}{_text(key)}:"
        if isinstance(value, dict) and value:
            yield start
            yield from _lines(value, depth + 1)
        else:
            yield f"{start} {flow_yaml(value)}"


def flow_yaml(value: Any) -> str:
    """Return a value as YAML 1.2 on one line."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_text(k)}: {flow_yaml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(flow_yaml(item) for item in value) + "]"
    return _text(value) if isinstance(value, str) else repr(value)


def _text(text: str) -> str:
    """Return text unquoted if YAML reads it as text, else in double quotes."""
    if _PLAIN.fullmatch(text) and not text.endswith(" ") and read_scalar(text) == text:
        return text
    return '"' + "".join(_escape(letter) for letter in text) + '"'


def _escape(letter: str) -> str:
    if letter in _ESCAPES:
        return _ESCAPES[letter]
    if letter.isprintable() and letter != "\ufeff":
        return letter
    code = ord(letter)
    if code < 0x100:
        return f"\\x{code:02X}"
    return f"\\u{code:04X}" if code < 0x10000 else f"\\U{code:08X}"
