"""Command-line options from a plugin's pydantic model: `tautwave sim` and `tautwave scan`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any

import click

from tautwave.errors import ConfigError


def parse_model(model: type[Any], arguments: Sequence[str], command: str) -> Any:
    """Return the model filled from `--some-key value` arguments.

    A key of type bool is a flag; of a list or tuple, values separated by commas, and whole numbers
    may be written 1-6.

    Raises
    ------
    ConfigError
        An option is unknown, lacks its value, or has a wrong one.
    """
    from pydantic import ValidationError

    keys = {f"--{name.replace('_', '-')}": name for name in model.model_fields}
    given: dict[str, Any] = {}
    left = list(arguments)
    while left:
        word = left.pop(0)
        option, equals, value = word.partition("=")
        if option not in keys:
            raise ConfigError(_unknown(option, command, sorted(keys)))
        name = keys[option]
        kind = model.model_fields[name].annotation
        if kind is bool and not equals:
            given[name] = True
            continue
        if not equals:
            if not left:
                raise ConfigError(f"{command}: {option} needs a value")
            value = left.pop(0)
        given[name] = _value(value, kind)
    try:
        return model.model_validate_json(json.dumps(given), strict=True)
    except ValidationError as err:
        raise ConfigError(
            [_sentence(command, problem) for problem in _root_causes(err.errors())]
        ) from err


def describe_model(model: type[Any]) -> list[tuple[str, str]]:
    """Return each option with its description, for `--help`."""
    rows = []
    for name, field in model.model_fields.items():
        given = "" if field.is_required() else _shown(field.get_default())
        default = f" [default: {given}]" if given else ""  # an empty default is not printed
        rows.append((f"--{name.replace('_', '-')}", f"{field.description or ''}{default}".strip()))
    return rows


def print_help(command: str, summary: str, model: type[Any]) -> None:
    """Print the options of a plugin's command."""
    formatter = click.HelpFormatter(max_width=100)
    formatter.write_usage(f"tautwave {command}", "[OPTIONS]")
    formatter.write_paragraph()
    formatter.write_text(summary)
    with formatter.section("Options"):
        formatter.write_dl(describe_model(model))
    click.echo(formatter.getvalue(), nl=False)


def _value(text: str, kind: Any) -> Any:
    origin = getattr(kind, "__origin__", None)
    if origin in (tuple, list):
        (item, *_) = kind.__args__
        whole = getattr(item, "__origin__", item) is int
        parts = [part for part in text.split(",") if part]
        return [one for part in parts for one in (_span(part) if whole else [_value(part, None)])]
    if kind is str:
        return text
    from tautwave.config.guard import parse_json

    try:
        return parse_json(text)
    except ValueError:
        return text


def _span(text: str) -> list[Any]:
    """Return the numbers of `1-6`; what is no such span is read as one value."""
    first, _, last = text.partition("-")
    small = all(word.isascii() and word.isdigit() and len(word) < 4 for word in (first, last))
    if not (small and int(first) <= int(last)):
        return [_value(text, None)]
    return list(range(int(first), int(last) + 1))


def _shown(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, tuple | list):
        return ",".join(str(item) for item in value)
    return str(value)


def _root_causes(problems: Sequence[Any]) -> list[Any]:
    """Keep the first problem of each list, without "too short" that follows from invalid items."""
    wrong = {problem["loc"][0]: problem for problem in reversed(problems) if problem["loc"][1:]}
    return [
        problem
        for problem in problems
        if problem is wrong.get(problem["loc"][0] if problem["loc"] else "", problem)
    ]


def _sentence(command: str, problem: Any) -> str:
    where = "".join(f" --{str(part).replace('_', '-')}" for part in problem["loc"][:1])
    got = "" if problem["type"] == "missing" else f" (got {problem['input']!r})"
    return f"{command}:{where}: {problem['msg']}{got}"


def _unknown(option: str, command: str, known: Sequence[str]) -> str:
    close = get_close_matches(option, known, n=1)
    hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(known) or 'none'}"
    return f"{command}: no such option {option}; {hint}"
