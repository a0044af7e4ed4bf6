"""The command line as click knows it, and what its exit codes mean."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator

import click

from _tools.markdown import table
from tautwave import errors
from tautwave.cli import main
from tautwave.cli.group import EXIT_CODES

HELP = main.context_settings["help_option_names"]


def commands_page() -> str:
    """Return the page: what `--help` prints, command by command."""
    parts = [
        "# Command line\n",
        "What `--help` prints, taken from the program at the build.\n",
    ]
    for words, command in walk(main, ("tautwave",)):
        context = click.Context(
            command, info_name=" ".join(words), terminal_width=90, help_option_names=HELP
        )
        parts += [f"## {' '.join(words)}\n", "```text", command.get_help(context), "```\n"]
    return "\n".join(parts)


def walk(
    command: click.Command, words: tuple[str, ...]
) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    """Yield every command below `command`, itself first."""
    yield words, command
    if isinstance(command, click.Group):
        context = click.Context(command, info_name=" ".join(words))
        for name in command.list_commands(context):
            below = command.get_command(context, name)
            if below is not None:
                yield from walk(below, (*words, name))


def exit_codes_page() -> str:
    """Return the page: codes, their meaning, and the errors that end in them."""
    kinds: dict[int, list[str]] = {}
    for kind in vars(errors).values():
        if isinstance(kind, type) and issubclass(kind, errors.TautwaveError):
            kinds.setdefault(kind.exit_code, []).append(f"`{kind.__name__}`")
    text = EXIT_CODES.removeprefix("Exit codes: ").removesuffix(".")
    tree = inspect.cleandoc(errors.__doc__ or "").partition("\n\n")[2]
    rows = []
    for part in text.split("; "):
        codes, meaning = re.fullmatch(r"([\d, ]+) (.*)", part, re.S).groups()  # type: ignore[union-attr]
        first = int(codes.partition(",")[0])
        rows.append((codes, meaning, ", ".join(kinds.get(first, ())) if first else ""))
    return "\n".join(
        [
            "# Exit codes\n",
            "Scripts may depend on them; `tautwave --help` prints the same list.\n",
            table(("code", "meaning", "errors in Python"), rows),
            "The tree of errors, each with its exit code:\n",
            f"```text\n{tree}\n```\n",
        ]
    )
