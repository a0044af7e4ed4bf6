"""YAML text to plain values with a line for every key: YAML 1.2 scalars, unique keys, no aliases.

PyYAML reads YAML 1.1, where `12:30` is 750, `no` is False, `1e3` is text and a second key of the
same name wins silently. On a haptic rig that is a lost limit, so the values are built here from
PyYAML's events by the rules of the YAML 1.2 core schema (yaml.org/spec/1.2.2, section 10.3).
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple

import yaml
from yaml.parser import Parser
from yaml.reader import Reader, ReaderError
from yaml.scanner import Scanner

from tautwave.config.guard import whole_number
from tautwave.errors import ConfigError

KeyPath = tuple[str | int, ...]

DEEPEST = 24
"""A rig needs 8 levels; anything deeper is a mistake or an attack, and is refused."""

_INT = re.compile(r"[-+]?[0-9]+")
_OCTAL = re.compile(r"0o[0-7]{1,20}")
_HEX = re.compile(r"0x[0-9a-fA-F]{1,16}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INFINITE = re.compile(r"[-+]?\.(inf|Inf|INF)")
_FIXED: dict[str, Any] = dict.fromkeys(("", "~", "null", "Null", "NULL"))
_FIXED |= dict.fromkeys(("true", "True", "TRUE"), True)
_FIXED |= dict.fromkeys(("false", "False", "FALSE"), False)
_FIXED |= dict.fromkeys((".nan", ".NaN", ".NAN"), float("nan"))


class Mark(NamedTuple):
    """Where a value was written: a line of the file, or the `--set` argument in `argument`."""

    line: int
    argument: str | None = None
    target: KeyPath = ()


class Problem(NamedTuple):
    """One mistake: where, at which key (may be empty) and what, as a sentence."""

    mark: Mark
    path: KeyPath
    text: str


class Parsed(NamedTuple):
    """Plain values, a mark per path, paths whose value was refused, and the mistakes."""

    value: Any
    marks: dict[KeyPath, Mark]
    spoiled: set[KeyPath]
    problems: list[Problem]


class SyntaxProblem(ConfigError):
    """The text is not YAML at all; `line` and `column` count from 1 (0: not known)."""

    def __init__(self, line: int, column: int, text: str) -> None:
        super().__init__(text)
        self.line = line
        self.column = column


class _Events(Reader, Scanner, Parser):
    """PyYAML's event parser without its composer and resolver."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)


def read_scalar(text: str) -> Any:
    """Return the value of a plain scalar by the YAML 1.2 core schema; text if nothing matches."""
    if text in _FIXED:
        return _FIXED[text]
    if _INT.fullmatch(text):
        return whole_number(text)
    if _OCTAL.fullmatch(text):
        return int(text[2:], 8)
    if _HEX.fullmatch(text):
        return int(text[2:], 16)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _INFINITE.fullmatch(text):
        return float("-inf") if text.startswith("-") else float("inf")
    return text


def parse_yaml(text: str, mark: Mark | None = None) -> Parsed:
    """Parse one YAML document.

    Parameters
    ----------
    text : str
        The document.
    mark : Mark, optional
        Given to every value instead of its line, for text that is not from a file.

    Returns
    -------
    Parsed
        `value` is None for an empty document; `problems` holds everything that YAML allows and a
        rig file does not (duplicate keys, anchors, aliases, tags, keys that are not plain text).

    Raises
    ------
    SyntaxProblem
        The text is not YAML, holds several documents, or is nested too deeply.
    """
    try:
        builder = _Builder(text, mark)
        value = builder.document()
    except SyntaxProblem:
        raise
    except yaml.MarkedYAMLError as err:
        raise _syntax(err, text) from err
    except ReaderError as err:
        line = text.count("\n", 0, err.position) + 1
        column = err.position - (text.rfind("\n", 0, err.position) + 1) + 1
        raise SyntaxProblem(
            line, column, f"the character U+{ord(text[err.position]):04X} is not allowed in YAML"
        ) from err
    except (yaml.YAMLError, ValueError, OverflowError) as err:
        raise SyntaxProblem(0, 0, f"not YAML: {err}") from err
    return Parsed(value, builder.marks, builder.spoiled, builder.problems)


class _Builder:
    """Builds values from events; recursion is bounded by `DEEPEST`."""

    def __init__(self, text: str, mark: Mark | None) -> None:
        self.events: Any = _Events(text)  # PyYAML's own methods are not typed
        self.mark = mark
        self.marks: dict[KeyPath, Mark] = {}
        self.spoiled: set[KeyPath] = set()
        self.problems: list[Problem] = []

    def document(self) -> Any:
        events = self.events
        events.get_event()
        if events.check_event(yaml.StreamEndEvent):
            return None
        events.get_event()
        first = events.peek_event()
        self.marks[()] = self.mark or Mark(first.start_mark.line + 1)
        value = self.value(())
        events.get_event()
        if not events.check_event(yaml.StreamEndEvent):
            mark = events.peek_event().start_mark
            raise SyntaxProblem(
                mark.line + 1,
                mark.column + 1,
                "a second document begins here; only one per file is allowed",
            )
        return value

    def here(self, event: Any) -> Mark:
        return self.mark or Mark(event.start_mark.line + 1)

    def refuse(self, event: Any, path: KeyPath, text: str) -> None:
        self.problems.append(Problem(self.here(event), path, text))

    def value(self, path: KeyPath) -> Any:
        event = self.events.get_event()
        if len(path) > DEEPEST:
            raise SyntaxProblem(
                event.start_mark.line + 1,
                event.start_mark.column + 1,
                f"nested deeper than {DEEPEST} levels",
            )
        if isinstance(event, yaml.AliasEvent):
            self.spoiled.add(path)
            self.refuse(event, path, f"aliases (*{event.anchor}) are not supported; write it out")
            return None
        if event.anchor is not None:
            self.refuse(event, path, f"anchors (&{event.anchor}) are not supported; write it out")
        if event.tag is not None:
            self.spoiled.add(path)
            tag = event.tag.replace("tag:yaml.org,2002:", "!!")
            self.refuse(event, path, f"tags ({tag}) are not supported; write the plain value")
        if isinstance(event, yaml.ScalarEvent):
            return self.scalar(event, path)
        if isinstance(event, yaml.SequenceStartEvent):
            return self.items(path)
        return self.entries(path)

    def scalar(self, event: yaml.ScalarEvent, path: KeyPath) -> Any:
        text = event.value
        if event.style is None:
            return read_scalar(text)
        if any("\ud800" <= letter <= "\udfff" for letter in text):
            self.spoiled.add(path)
            self.refuse(event, path, "the text contains an unpaired surrogate")
            return ""
        return text

    def items(self, path: KeyPath) -> list[Any]:
        items: list[Any] = []
        while not self.events.check_event(yaml.SequenceEndEvent):
            at = (*path, len(items))
            self.marks[at] = self.here(self.events.peek_event())
            items.append(self.value(at))
        self.events.get_event()
        return items

    def entries(self, path: KeyPath) -> dict[str, Any]:
        entries: dict[str, Any] = {}
        while not self.events.check_event(yaml.MappingEndEvent):
            event = self.events.peek_event()
            key = self.key(path)
            if key is None or key in entries:
                if key is not None:
                    first = self.marks[(*path, key)]
                    place = (
                        "in the same mapping"
                        if first.argument is not None
                        else f"first at line {first.line}"
                    )
                    self.refuse(event, (*path, key), f"duplicate key {key!r}, {place}")
                self.skip()
                continue
            at = (*path, key)
            self.marks[at] = self.here(event)
            entries[key] = self.value(at)
        self.events.get_event()
        return entries

    def key(self, path: KeyPath) -> str | None:
        """Return the key's text as written (`on: 1` has the key `on`), None if it has none."""
        event = self.events.peek_event()
        plain = isinstance(event, yaml.ScalarEvent) and event.tag is None and event.anchor is None
        if plain and not any("\ud800" <= letter <= "\udfff" for letter in event.value):
            return str(self.events.get_event().value)
        self.skip()
        self.refuse(event, path, "a key must be plain text, without anchor, alias or tag")
        return None

    def skip(self) -> None:
        """Read one value and discard it."""
        depth = 0
        while True:
            event = self.events.get_event()
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            if depth == 0:
                return


def _syntax(err: yaml.MarkedYAMLError, text: str) -> SyntaxProblem:
    """Turn PyYAML's error into one sentence with line and column."""
    mark = err.problem_mark or err.context_mark
    line = mark.line + 1 if mark else 0
    column = mark.column + 1 if mark else 0
    problem = (err.problem or err.context or "not YAML").replace("<", "").replace(">", "")
    if mark and ("\\t" in problem or _tab_before(text, mark.line)):
        return SyntaxProblem(line, column, "tab in the indentation; YAML requires spaces")
    if err.context and err.context_mark and err.context_mark.line + 1 != line:
        problem += f" ({err.context}, begun at line {err.context_mark.line + 1})"
    elif err.context and err.problem:
        problem += f" ({err.context})"
    return SyntaxProblem(line, column, f"YAML syntax: {problem}")


def _tab_before(text: str, line: int) -> bool:
    """Return whether the line is indented with a tab."""
    lines = text.splitlines()
    if line >= len(lines):
        return False
    return "\t" in lines[line][: len(lines[line]) - len(lines[line].lstrip())]
