"""`--set a.b=c`: one value applied to the rig file, read and checked like the file itself."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from tautwave.config.text.document import Document, show_path, show_value
from tautwave.config.text.yaml12 import KeyPath, Mark, Parsed, Problem, SyntaxProblem, parse_yaml

_PART = re.compile(r"""\s*(?:"([^"]*)"|'([^']*)'|([^."'=\s][^.="']*?))\s*(\.|=|$)""")

_KNOWN = 4096
_numbers: dict[str, tuple[list[_Word], Parsed]] = {}


class _Word(NamedTuple):
    text: str
    quoted: bool


def apply_overrides(document: Document, overrides: Sequence[str]) -> None:
    """Apply every `a.b=c` to the document, in order; mistakes are noted in the document."""
    for argument in overrides:
        mark = Mark(0, argument)
        try:
            keys, parsed = _read(argument)
            _put(document, keys, parsed, argument)
        except SyntaxProblem as err:
            document.problems.append(Problem(mark, (), str(err)))
        except _CannotSet as err:
            document.problems.append(Problem(mark, (), str(err)))


def _read(argument: str) -> tuple[list[_Word], Parsed]:
    """Return the keys of an argument and its value; cached, since a sweep repeats them often."""
    known = _numbers.get(argument)
    if known is None:
        keys, text = _split(argument)
        known = keys, parse_yaml(text, Mark(0, argument))
        if isinstance(known[1].value, int | float) and not known[1].problems:
            if len(_numbers) >= _KNOWN:
                _numbers.clear()
            _numbers[argument] = known
    return known


class _CannotSet(Exception):
    """The key cannot be set; the message gives the reason."""


def _split(argument: str) -> tuple[list[_Word], str]:
    """Split `a."b.c".d=value` into its keys and the text of the value."""
    keys: list[_Word] = []
    at = 0
    while True:
        match = _PART.match(argument, at)
        if match is None or match[4] == "":
            raise _CannotSet("write it as key=value, with dots between keys, such as rate_hz=500")
        quoted = match[1] if match[1] is not None else match[2]
        keys.append(_Word(match[3], False) if quoted is None else _Word(quoted, True))
        at = match.end()
        if match[4] == "=":
            return keys, argument[at:].strip()


def _put(document: Document, keys: list[_Word], parsed: Parsed, argument: str) -> None:
    """Set the value, creating missing mappings on the way."""
    node: Any = document.value
    path: KeyPath = ()
    while True:
        key: Any
        key, keys = _next_key(document, node, path, keys)
        path = (*path, key)
        if isinstance(node, list) and key == len(node):
            node.append(None)
        if not keys:
            node[key] = parsed.value
            _mark(document, path, parsed, argument)
            return
        if document.get(path) is None:
            node[key] = {}
            document.marks[path] = Mark(0, argument, path)
        node = node[key]
        if not isinstance(node, dict | list):
            raise _CannotSet(
                f"{show_path(path)} is {show_value(node)} and has no keys below it; "
                f"set {show_path(path)} as a whole, such as {show_path(path)}={{key: value}}"
            )


def _next_key(
    document: Document, node: Any, path: KeyPath, keys: list[_Word]
) -> tuple[str | int, list[_Word]]:
    """Return the key that `keys` starts with: the longest dotted name that exists, or may."""
    first = keys[0]
    if isinstance(node, list):
        if not first.text.isascii() or not first.text.isdigit() or len(first.text) > 6:
            raise _CannotSet(f"{show_path(path)} is a list; use an index, not {first.text!r}")
        if int(first.text) > len(node):
            raise _CannotSet(f"{show_path(path)} has {len(node)} items, indexed from 0")
        return int(first.text), keys[1:]
    if not first.quoted:
        for count in range(len(keys), 1, -1):
            if any(word.quoted for word in keys[:count]):
                continue
            name = ".".join(word.text for word in keys[:count])
            sided = count == 2 and first.text in ("master", "slave")
            new_axis = sided and path == ("simulation", "axes")
            new_arm = sided and path == ("simulation", "arms") and _is_arm(document, keys)
            if name in node or new_axis or new_arm:
                return name, keys[count:]
    return first.text, keys[1:]


def _is_arm(document: Document, keys: list[_Word]) -> bool:
    """Return whether the first two words are a side, and one of its several arms."""
    arms = document.get((keys[0].text, "arms"))
    return isinstance(arms, dict) and keys[1].text in arms


def _mark(document: Document, path: KeyPath, parsed: Parsed, argument: str) -> None:
    """Replace all marks of the document at and below `path` by the argument's."""
    for known in [p for p in document.marks if p[: len(path)] == path]:
        del document.marks[known]
    document.spoiled = {p for p in document.spoiled if p[: len(path)] != path}
    mark = Mark(0, argument, path)
    document.marks[path] = mark
    document.marks.update({path + below: mark for below in parsed.marks})
    document.spoiled |= {path + below for below in parsed.spoiled}
    document.problems += [Problem(mark, path + p.path, p.text) for p in parsed.problems]
