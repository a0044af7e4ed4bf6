"""Every command that a page names exists, with its options: in blocks, on lines, in a sentence."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

from tautwave.cli import main
from tautwave.config.shipped import find_example
from tautwave.errors import ConfigError
from tests.docs.test_facts import ROOT, pages

INLINE = re.compile(r"`tautwave ((?:[^`\n]|\n(?!\n))+)`")
LINE = re.compile(r"^(?: {4}|\$ )tautwave ((?:.+\\\n)*.+)", flags=re.M)
OWN_OPTIONS = {"scan", "sim"}
"""Their options are those of a driver, and looked at in the tests of these commands."""


def named(page: Path) -> Iterator[str]:
    """Yield the commands of a page, without `tautwave`."""
    text = page.read_text(encoding="utf-8")
    for found in (*LINE.finditer(text), *INLINE.finditer(text)):
        words = found[1].replace("\\\n", " ").replace("\n", " ")
        yield re.split(r"\s+#\s|\s+[|>&]", words)[0].strip()


def wrong(words: str) -> str:
    """Return what is wrong with a command, "" if nothing is."""
    try:
        args = shlex.split(words)
    except ValueError:
        return f"{words}: its quotes"
    command: click.Command = main
    context = click.Context(main)
    while isinstance(command, click.Group) and args and not args[0].startswith("-"):
        found = command.get_command(context, args[0])
        if found is None:
            return f"{words}: no command {args[0]}"
        command, args = found, args[1:]
        context = click.Context(command, parent=context)
        if command.name in OWN_OPTIONS:
            return ""
    if command.name == "example" and args and re.fullmatch(r"[\w/.-]+", args[0]):
        try:
            find_example(args[0])
        except ConfigError as error:
            return f"{words}: {error}"
    try:
        command.make_parser(context).parse_args(args)
    except click.NoSuchOption as error:
        return f"{words}: {error.format_message()}"
    except click.UsageError:
        pass  # an option that a sentence names without its value
    return ""


OF_NOW = [page for page in pages() if page.name != "renamed.md"]


@pytest.mark.parametrize("page", OF_NOW, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_a_page_exist(page: Path) -> None:
    assert [text for words in named(page) if (text := wrong(words))] == []


def test_a_command_or_an_option_that_is_none_is_found() -> None:
    assert wrong("check rig.yaml --set a=1") == ""
    assert "no command" in wrong("chek rig.yaml")
    assert "--sett" in wrong("check rig.yaml --sett a=1")
    assert "no example" in wrong("example scene-resonater")
