"""A rig file as plain values with the line of each, and `--set` on top of it."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tautwave.config.guard import read_guarded
from tautwave.config.text.yaml12 import KeyPath, Mark, Problem, SyntaxProblem, parse_yaml
from tautwave.errors import ConfigError
from tautwave.kinds import WANTED, kind_of_keys, mistaken

LARGEST = 256 * 1024
"""[bytes] A rig is about a page; a larger file is not a rig (perhaps a recording given by
mistake)."""

_WORD = re.compile(r"[\w.-]+")


def show_path(path: KeyPath) -> str:
    """Return a key path as `--set` takes it, such as `slave.axes.wrist.effort_limit`."""
    return ".".join(
        str(part) if isinstance(part, int) or _WORD.fullmatch(part) else json.dumps(part)
        for part in path
    )


@dataclass
class Document:
    """The parsed file before validation.

    `marks` has a place per path, `spoiled` the paths whose value was already refused, `problems`
    the mistakes so far, `origins` the path of the default that a value was taken from.
    """

    name: str
    folder: Path
    value: dict[str, Any] = field(default_factory=dict)
    marks: dict[KeyPath, Mark] = field(default_factory=dict)
    spoiled: set[KeyPath] = field(default_factory=set)
    problems: list[Problem] = field(default_factory=list)
    origins: dict[KeyPath, KeyPath] = field(default_factory=dict)

    def mark(self, path: KeyPath) -> Mark:
        """Return where `path` or the nearest mapping around it was written."""
        for length in range(len(path), -1, -1):
            if path[:length] in self.marks:
                return self.marks[path[:length]]
        return Mark(1)

    def where(self, path: KeyPath) -> str:
        """Return `rig.yaml:5`, or the `--set` argument."""
        mark = self.mark(path)
        return f"--set {mark.argument}" if mark.argument is not None else f"{self.name}:{mark.line}"

    def report(self, path: KeyPath, text: str) -> None:
        """Note a mistake, unless the value at `path` was refused already."""
        if not any(path[:length] in self.spoiled for length in range(1, len(path) + 1)):
            self.problems.append(Problem(self.mark(path), path, text))

    def get(self, path: KeyPath) -> Any:
        """Return the value at `path`, None if there is none."""
        value: Any = self.value
        for part in path:
            try:
                value = value[part]
            except (KeyError, IndexError, TypeError):
                return None
        return value

    def take_from(self, source: KeyPath, path: KeyPath) -> None:
        """Note that the value at `path` is a copy of the default at `source`."""
        self.origins[path] = source
        size = len(source)
        below = {key: mark for key, mark in self.marks.items() if key[:size] == source}
        self.marks.update({path + key[size:]: mark for key, mark in below.items()})
        self.spoiled |= {path + key[size:] for key in self.spoiled if key[:size] == source}

    def sentences(self) -> list[str]:
        """Return all problems in the order of the file, each once, `--set` last.

        A mistake in a default is stated where the default is; if only some of the blocks that took
        it have the mistake, they are named.
        """
        places: dict[Problem, list[KeyPath]] = {}
        for problem in self.problems:
            source, rest = self._origin(problem.path)
            takers = places.setdefault(problem._replace(path=source + rest), [])
            if source:
                takers.append(problem.path[: len(problem.path) - len(rest)])
        ordered = sorted(places, key=lambda p: (p.mark.argument is not None, p.mark.line))
        return list(dict.fromkeys(self._sentence(p) + self._only(places[p]) for p in ordered))

    def _origin(self, path: KeyPath) -> tuple[KeyPath, KeyPath]:
        """Return the default that `path` was taken from, () if none, and the path below it."""
        for length in range(len(path), 0, -1):
            if path[:length] in self.origins:
                return self.origins[path[:length]], path[length:]
        return (), path

    def _only(self, takers: list[KeyPath]) -> str:
        """Return which blocks a mistake in a default concerns, '' if it is all that took it."""
        if not takers:
            return ""
        source = self.origins[takers[0]]
        everywhere = {path for path, taken in self.origins.items() if taken == source}
        if everywhere == set(takers):
            return ""
        return f" (in {', '.join(dict.fromkeys(show_path(path[:3]) for path in takers))})"

    def _sentence(self, problem: Problem) -> str:
        mark, path, text = problem
        where = (
            f"--set {mark.argument}" if mark.argument is not None else f"{self.name}:{mark.line}"
        )
        if not path or (mark.argument is not None and path == mark.target):
            return f"{where}: {text}"
        return f"{where}: {show_path(path)}: {text}"


def read_text(path: Path, kind: str = "rig file") -> str:
    """Return the text of a rig file, or of another `kind` of short file.

    Raises
    ------
    ConfigError
        There is no such file, it cannot be read, is too large, or is not UTF-8.
    """
    return read_guarded(path, kind, LARGEST)


def open_document(text: str, name: str, folder: Path, kind: str = "rig file") -> Document:
    """Parse the text of a rig file, or of another `kind` of file.

    Raises
    ------
    ConfigError
        It is not YAML, is empty, has no mapping at the top, or is a file for something else.
    """
    try:
        parsed = parse_yaml(text)
    except SyntaxProblem as err:
        place = f"{name}:{err.line}:{err.column}" if err.line else name
        raise ConfigError(f"{place}: {err}") from err
    if parsed.value is None and not parsed.problems:
        raise ConfigError(f"{name}: the file is empty")
    if not isinstance(parsed.value, dict):
        line = parsed.marks[()].line
        raise ConfigError(
            [
                *(f"{name}:{p.mark.line}: {p.text}" for p in parsed.problems),
                f"{name}:{line}: a {kind} must be a mapping such as 'name: bench', but this is "
                f"{describe_kind(parsed.value)}",
            ]
        )
    wanted = (WANTED[kind],) if kind in WANTED else ()
    if other := wanted and mistaken(name, kind_of_keys(parsed.value), *wanted):
        raise ConfigError(other)
    return Document(name, folder, parsed.value, parsed.marks, parsed.spoiled, parsed.problems)


def describe_kind(value: Any) -> str:
    """Return the kind of this value, in a word."""
    if value is None:
        return "empty"
    if isinstance(value, bool):
        return "true or false"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    return "text" if isinstance(value, str) else "a number"


def show_value(value: Any) -> str:
    """Return a value as it would be written, shortened."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict | list):
        return describe_kind(value)
    text = repr(value)
    return text if len(text) <= 60 else text[:40] + "..." + text[-8:]


def nearest(word: str, known: Sequence[str], prefix: str = "") -> str:
    """Return `; did you mean 'x'?`, or '' if nothing is close; `prefix` goes before the x."""
    import difflib  # only needed once something is wrong

    close = difflib.get_close_matches(word, known, n=1)
    return f"; did you mean {prefix + close[0]!r}?" if close else ""
