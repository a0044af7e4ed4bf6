"""Scripts written for older modules: `python -m tests.lab renamed FILE` rewrites their imports."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import click

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "renamed.md"
ROW = re.compile(r"\| `([\w.:]+)` \| `([\w.:]+)` \|")


def moves(page: str) -> list[tuple[str, str]]:
    """Return the rows of the page: what a module or a name was called, and is called now."""
    return [(was, now) for was, now in ROW.findall(page)]


def rewrite(text: str, rows: Iterable[tuple[str, str]]) -> str:
    """Return a script with its dotted names as they are now; row by row, so a chain is followed."""
    for was, now in rows:
        text = re.sub(rf"(?<![\w.]){re.escape(was)}(?!\w)", now, text)
        (home, _, last), (new_home, _, new) = was.rpartition("."), now.rpartition(".")
        bound = new if new == last else f"{new} as {last}"
        text = re.sub(
            rf"^(\s*)from {re.escape(home)} import {re.escape(last)}(?=\s*(#.*)?$)",
            rf"\1from {new_home} import {bound}",
            text,
            flags=re.MULTILINE,
        )
        text = re.sub(
            rf"^(\s*)from {re.escape(home)} import {re.escape(last)} as ",
            rf"\1from {new_home} import {new} as ",
            text,
            flags=re.MULTILINE,
        )
    return text


@click.command(short_help="Rewrite a script's imports after modules have moved.")
@click.argument("files", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path))
def renamed(files: tuple[Path, ...]) -> None:
    """Rewrite FILES in place by the rows of docs/reference/renamed.md; say which changed."""
    rows = moves(PAGE.read_text(encoding="utf-8"))
    for file in files:
        before = file.read_text(encoding="utf-8")
        after = rewrite(before, rows)
        if after != before:
            file.write_text(after, encoding="utf-8")
        click.echo(f"{file}: {'rewritten' if after != before else 'nothing has moved'}")
