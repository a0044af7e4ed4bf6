"""What other people's files, scripts and packages depend on, as lines of text.

    python -m tests.house.surface            prints what differs from `surface.txt`
    python -m tests.house.surface --write    writes it anew: with the change that means to change it

A line is one fact: a public name, an entry point, a key of a rig file with its types, an option of
a command, a key of `check --json` and of a run's summary. A line that goes is somebody's broken
script; one that comes is a promise. `test_surface.py` compares them, and the exit codes of rigs
that fail. Recorded columns stand in `tests/rigs/row_hashes.txt`.
"""

from __future__ import annotations

import difflib
import json
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

import tautwave
from tautwave import plugin
from tautwave.cli import main
from tautwave.config.schema import rig_schema
from tests.commands import keep_in_one_process
from tests.commands import tautwave as command_line

ROOT = Path(__file__).parents[2]
KEPT = Path(__file__).with_name("surface.txt")

RIG = ROOT / "configs" / "bench-1dof-loopback.yaml"


def names() -> Iterator[str]:
    """Yield the public names and the entry points."""
    for name in tautwave.__all__:
        yield f"name tautwave.{name}"
    for name in plugin.__all__:
        yield f"name tautwave.plugin.{name}"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for script in project["scripts"]:
        yield f"script {script}"
    for group, points in project["entry-points"].items():
        for point in points:
            yield f"entry-point {group}: {point}"
    for extra in project["optional-dependencies"]:
        yield f"extra {extra}"


def rig_keys() -> Iterator[str]:
    """Yield the keys of a rig file by block, with types and whether they are required."""
    schema = rig_schema()
    blocks = {"Rig": schema, **schema["$defs"]}
    for block, definition in blocks.items():
        required = definition.get("required", ())
        for key, value in definition.get("properties", {}).items():
            mark = " required" if key in required else ""
            yield f"rig {block}.{key}: {_types(value)}{mark}"
        if "enum" in definition:
            yield f"rig {block}: {' | '.join(map(str, definition['enum']))}"


def _types(value: Any) -> str:
    """Return the types that a schema admits, in a word or some."""
    if value is True or value == {}:
        return "any"
    if "$ref" in value:
        return str(value["$ref"]).rpartition("/")[2]
    if "const" in value:
        return repr(value["const"])
    if "enum" in value:
        return " | ".join(map(repr, value["enum"]))
    for union in ("anyOf", "oneOf", "allOf"):
        if union in value:
            return " | ".join(dict.fromkeys(_types(part) for part in value[union]))
    kind = value.get("type", "any")
    if isinstance(kind, list):
        return " | ".join(kind)
    if kind == "array" and isinstance(value.get("items"), dict):
        return f"array of {_types(value['items'])}"
    return str(kind)


def options() -> Iterator[str]:
    """Yield every command with its arguments and options."""
    for words, command in _walk(main, ("tautwave",)):
        yield f"command {' '.join(words)}"
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                spelt = "/".join((*parameter.opts, *parameter.secondary_opts))
                takes = "" if parameter.is_flag or parameter.count else f" {parameter.type.name}"
                yield f"command {' '.join(words)} {spelt}{takes}"
            else:
                yield f"command {' '.join(words)} <{parameter.name}> x{parameter.nargs}"


def _walk(
    command: click.Command, words: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    yield words, command
    if isinstance(command, click.Group):
        context = click.Context(command, info_name=" ".join(words))
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None:
                yield from _walk(below, (*words, name))


def json_keys() -> Iterator[str]:
    """Yield the keys of `check --json` and of a short run's `summary.json`."""
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patched:
        checked = command_line("check", RIG, "--json", cwd=Path(folder))
        for key in sorted(set(_keys(json.loads(checked.stdout)))):
            if ".numbers." not in key:
                yield f"check --json {key}"
        keep_in_one_process(patched)
        words = ("run", RIG, "--clock", "fake", "--duration", "0.3", "--out", "run", "--quiet")
        command_line(*words, cwd=Path(folder))
        summary = json.loads((Path(folder) / "run" / "summary.json").read_text())
        for key in sorted(set(_keys(summary))):
            if ".numbers." not in key:
                yield f"summary.json {key}"


def _keys(value: Any, at: str = "") -> Iterator[str]:
    """Yield the paths of a JSON value; names of axes, pairs and elements as they are there."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from _keys(part, f"{at}.{key}" if at else key)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for part in value:
            yield from _keys(part, f"{at}[]")
    else:
        yield at


def surface() -> list[str]:
    """Return all lines."""
    return [*names(), *rig_keys(), *options(), *json_keys()]


def difference() -> list[str]:
    """Return the lines that came (+) and went (-) since they were written."""
    kept = KEPT.read_text().splitlines()
    found = difflib.unified_diff(kept, surface(), lineterm="", n=0)
    return [line for line in found if line[:3] not in ("+++", "---", "@@ ") and line[:2] != "@@"]


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        KEPT.write_text("\n".join(surface()) + "\n")
    else:
        print("\n".join(difference()) or "the surface is as it was")
