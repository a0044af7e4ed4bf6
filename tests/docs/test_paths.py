"""The first hour of four people is short, and all that their pages have them run exists."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.docs.blocks import ROOT, commands
from tests.docs.paths import PATHS, WORDS_A_MINUTE, steps, walk
from tests.docs.test_sentences import prose

MAX_MINUTES, MAX_COMMANDS = 10, 10
"""Of reading and of typing, until the end of a path."""


@pytest.mark.parametrize("name", PATHS)
def test_a_path_is_short(name: str) -> None:
    pages = [ROOT / "docs" / one for one in PATHS[name]]
    words = sum(len(prose(page.read_text(encoding="utf-8")).split()) for page in pages)
    typed = [
        command.words
        for page in pages
        for block in steps(page)
        if block.kind == "console"
        for command in commands(block)
    ]
    assert words <= MAX_MINUTES * WORDS_A_MINUTE
    assert len(typed) <= MAX_COMMANDS


def test_a_command_that_stands_alone_is_a_step_and_one_in_a_block_is_none(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(
        "```console\n$ tautwave example a\n    tautwave run a.yaml --clock fake\n```\n\n"
        "    tautwave run a.yaml --clock fake\n    tautwave run own.yaml --clock fake\n"
        "    tautwave run a.yaml --view\n"
    )
    assert [one.line for one in steps(page)] == [1, 6]


@pytest.mark.nightly
@pytest.mark.parametrize("name", PATHS)
def test_a_path_leads_to_its_end(name: str, tmp_path: Path) -> None:
    done = walk(name, tmp_path)
    assert done.commands
    assert done.printed < 30 * done.commands
