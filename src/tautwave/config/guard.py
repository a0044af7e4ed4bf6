"""Checks before any parser reads a user's file: size, encoding, depth, with one-sentence errors.

Rig files, profiles and sweeps are YAML and go on to `parse_yaml`; EDS files (INI) and JSON go to
libraries, which take any size, overflow on deep nesting and report errors in their own style.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tautwave.errors import ConfigError
from tautwave.kinds import refused
from tautwave.reading import open_file

MAX_DIGITS = 300
"""Of a whole number: a float holds 308."""

DEEPEST_JSON = 64
"""Python's parser recurses; our own files need 8 levels."""


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is not a finite number")
    return number


def whole_number(text: str) -> int | float:
    """Return a whole number of which everyone can take the float.

    Beyond all floats it is infinite, as `1e400` is: readers have a sentence for that, and none
    for an `OverflowError` at the first conversion.
    """
    return int(text) if len(text) <= MAX_DIGITS else float(text)


def _whole(text: str) -> int | float:
    _finite(text)
    return whole_number(text)


_FINITE: dict[str, Any] = {
    "parse_float": _finite, "parse_int": _whole, "parse_constant": _finite,
}  # fmt: skip
_CONTROL = re.compile(r"[\0-\x08\x0e-\x1f]")
_STRING = re.compile(r'"(?:[^"\\]|\\.)*+"?', re.DOTALL)
_BRACKET = re.compile(r"[][{}]")


def read_guarded(
    path: Path, kind: str, largest: int, encodings: Sequence[str] = ("utf-8-sig",)
) -> str:
    """Return the text of a file.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Kind of file, for the messages: `rig file`.
    largest : int
        Size limit [bytes]; a larger file is refused.
    encodings : sequence of str
        Tried in turn; the error names the first where none fits.

    Raises
    ------
    ConfigError
        The file does not exist, cannot be read, is too large, or is not text.
    """
    try:
        with open_file(path) as stream:
            raw = stream.read(largest + 1)
    except FileNotFoundError as err:
        raise ConfigError(f"{path}: no such file") from err
    except IsADirectoryError as err:
        raise ConfigError(refused(path, kind) or f"{path}: a directory, not {_a(kind)}") from err
    except (OSError, ValueError) as err:
        reason = getattr(err, "strerror", None) or err
        raise ConfigError(f"{path}: cannot be read: {reason}") from err
    if other := refused(path, kind, raw):
        raise ConfigError(other)
    if len(raw) > largest:
        raise ConfigError(f"{path}: larger than {largest // 1024} KiB, so not {_a(kind)}")
    return _decoded(path, kind, raw, encodings)


def _a(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiouAEIOU' else 'a'} {kind}"


def _decoded(path: Path, kind: str, raw: bytes, encodings: Sequence[str]) -> str:
    first: UnicodeDecodeError | None = None
    for encoding in encodings:
        try:
            text = raw.decode(encoding)
        except UnicodeDecodeError as err:
            first = first or err
            continue
        control = _CONTROL.search(text) if encoding != encodings[0] else None
        if control is not None:  # any bytes are text in an 8-bit code
            line = text.count("\n", 0, control.start()) + 1
            raise ConfigError(
                f"{path}:{line}: not text (character U+{ord(control[0]):04X}), so not {_a(kind)}"
            )
        return text
    assert first is not None
    raise ConfigError(
        f"{path}: not UTF-8 text (byte 0x{raw[first.start]:02x} at offset {first.start})"
    ) from first


def parse_json(text: str, deepest: int = DEEPEST_JSON, *, finite: bool = False) -> Any:
    """Return the value of a JSON text.

    Raises
    ------
    ValueError
        Not JSON, nested too deeply, or with `finite` a number that is no finite double; one
        sentence, with line and column where they are known.
    """
    depth = 0
    for bracket in _BRACKET.finditer(_STRING.sub(lambda found: "_" * len(found[0]), text)):
        depth += 1 if bracket[0] in "[{" else -1
        if depth > deepest:
            line = text.count("\n", 0, bracket.start()) + 1
            raise ValueError(f"line {line}: nested deeper than {deepest} levels")
    try:
        return json.loads(text, **(_FINITE if finite else {"parse_int": whole_number}))
    except json.JSONDecodeError as err:
        raise ValueError(f"line {err.lineno}, column {err.colno}: {err.msg}") from err
