"""Older rig files, rewritten where keys changed; comments and everything else stay as they are."""

from __future__ import annotations

import re
from copy import deepcopy
from typing import Any, NamedTuple

from tautwave import formats
from tautwave.config.keys.coupling import RENAMED, Coupling, pair_block
from tautwave.config.older import MOVED_TO_PAIRS, REMOVED_FROM_PAIRS
from tautwave.config.text.document import show_path
from tautwave.config.text.resolved import flow_yaml
from tautwave.config.text.yaml12 import KeyPath, SyntaxProblem, parse_yaml
from tautwave.errors import ConfigError


class Rewritten(NamedTuple):
    """A rig file's text as it is written now, and a sentence for each change."""

    text: str
    changes: tuple[str, ...]


def rewrite_older(text: str, name: str) -> Rewritten:
    """Return the text of a rig file with keys and words of older versions as they are now.

    Parameters
    ----------
    text : str
        Of the rig file.
    name : str
        For messages.

    Raises
    ------
    ConfigError
        It is no YAML mapping, or a key stands where it cannot be rewritten line by line.
    """
    value = parse_yaml(text).value
    if not isinstance(value, dict):
        raise ConfigError(f"{name}: not a rig file: no mapping of keys")
    page = _Page(text, deepcopy(value))
    if value.get("format") in range(1, formats.RIG) and not isinstance(value["format"], bool):
        page.replace(("format",), str(value["format"]), str(formats.RIG))
        page.value["format"] = formats.RIG
    coupling = page.value.get("coupling")
    try:
        if isinstance(coupling, dict):
            _rewrite_coupling(page, coupling)
        whole = parse_yaml(page.text).value == page.value
    except SyntaxProblem:
        whole = False
    if not whole:
        raise ConfigError(
            f"{name}: its keys cannot be rewritten line by line; do by hand: "
            + "; ".join(page.changes)
        )
    return Rewritten(page.text, tuple(page.changes))


def _rewrite_coupling(page: _Page, coupling: dict[str, Any]) -> None:
    was = str(coupling.get("law"))
    now = RENAMED.get(was)
    if now is not None:
        page.replace(("coupling", "law"), was, now)
        coupling["law"] = now
    pairs = coupling.get("pairs")
    blocks = (
        {n: b for n, b in pairs.items() if isinstance(b, dict)} if isinstance(pairs, dict) else {}
    )
    known = pair_block(Coupling.model_for(coupling)).model_fields
    for key in MOVED_TO_PAIRS & set(coupling):
        moved = coupling.pop(key)
        page.remove(("coupling", key))
        for pair, block in blocks.items():
            if key in known and key not in block:
                page.insert(("coupling", "pairs", pair), key, moved)
                block[key] = moved
    for pair, block in blocks.items():
        for key in REMOVED_FROM_PAIRS & set(block) - set(known):
            del block[key]
            page.remove(("coupling", "pairs", pair, key))


class _Page:
    """Text that is changed, the value that it has to have then, and what was done."""

    def __init__(self, text: str, value: dict[str, Any]) -> None:
        self.text = text
        self.value = value
        self.changes: list[str] = []

    def replace(self, path: KeyPath, before: str, now: str) -> None:
        """Write another value at a path."""
        at, lines = self._line(path)
        key = re.escape(str(path[-1]))
        word = re.escape(before)
        lines[at] = re.sub(rf"(\b{key}:\s*[\"']?){word}\b", rf"\g<1>{now}", lines[at], count=1)
        self._keep(lines, f"line {at + 1}: {show_path(path)} {before} is {now} now")

    def remove(self, path: KeyPath) -> None:
        """Take a key out, with its line where it is alone there."""
        at, lines = self._line(path)
        key = re.escape(str(path[-1]))
        if re.match(rf"\s*{key}:", lines[at]):
            indent, comment = re.match(r"(\s*)[^#]*(#.*\n?)?", lines[at]).groups()  # type: ignore[union-attr]
            lines[at] = f"{indent}{comment}" if comment else ""
        else:
            line = re.sub(rf"\b{key}:\s*[^,}}#]+,\s*", "", lines[at], count=1)
            if line == lines[at]:  # the last one of its mapping
                line = re.sub(rf",?\s*\b{key}:\s*[^,}}#]+(?=}})", "", line, count=1)
            lines[at] = line
        self._keep(lines, f"line {at + 1}: {show_path(path)} removed")

    def insert(self, path: KeyPath, key: str, value: Any) -> None:
        """Write a key first into the mapping at a path."""
        at, lines = self._line(path)
        name, word = re.escape(str(path[-1])), f"{key}: {flow_yaml(value)}"
        line = re.sub(rf"(\b{name}:\s*){{\s*(?=\S)", rf"\g<1>{{{word}, ", lines[at], count=1)
        if line != lines[at]:
            lines[at] = line.replace(f"{word}, }}", f"{word}}}")
        else:
            inner = next(one for one in lines[at + 1 :] if one.strip() and one.strip()[0] != "#")
            indent = inner[: len(inner) - len(inner.lstrip())]
            lines.insert(at + 1, f"{indent}{word}\n")
        self._keep(
            lines, f"line {at + 1}: {show_path((*path, key))} added, as it was for all pairs"
        )

    def _line(self, path: KeyPath) -> tuple[int, list[str]]:
        """Return the line that has the key, and all lines."""
        lines = self.text.splitlines(keepends=True)
        mark = parse_yaml(self.text).marks[path].line - 1
        key = f"{path[-1]}:"
        at = next((k for k in range(mark, -1, -1) if key in lines[k]), mark)
        return at, lines

    def _keep(self, lines: list[str], change: str) -> None:
        self.text = "".join(lines)
        self.changes.append(change)
