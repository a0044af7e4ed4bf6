"""The first hour of four people, walked by their pages and counted: `python -m tests.docs.paths`.

Prints a line for each: words of their pages and minutes of reading, commands typed, lines of code
or rig saved, lines printed, seconds waited, and of processor time. Names of paths after it walk
only these. What was counted before the pages were rewritten: `tests/lab/notes/first-hours.md`.
"""

from __future__ import annotations

import re
import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import pytest

from tautwave.cli.terminal.show import plain_text
from tautwave.tables import Table, of_numbers
from tests.docs.blocks import ROOT, Block, blocks
from tests.docs.running import Page
from tests.docs.test_sentences import prose
from tests.parts.test_pages import follow

PATHS = {
    "two arms and a dataset": ("start/arms.md", "howto/record-episodes.md"),
    "haptics and walls": ("start/walls.md",),
    "drives and fieldbuses": ("start/drives.md", "tutorials/cia402-from-eds.md"),
    "an author of a driver": ("add-a-driver.md",),
}
WORDS_A_MINUTE = 200


class Walk(NamedTuple):
    """What one person did until the end of their pages."""

    words: int
    commands: int
    saved: int
    printed: int
    waited_s: float
    cpu_s: float


class _Followed(Page):
    """A page whose commands are counted, and run as a person's: in a shell, with their figures."""

    timeout_s = 1000.0
    count, lines, waited_s, cpu_s = 0, 0, 0.0, 0.0

    def _command(self, words: str) -> tuple[int, str]:
        begun, spent = time.monotonic(), children_s()
        code, printed = self._shell(words)
        self.waited_s += time.monotonic() - begun
        self.cpu_s += children_s() - spent
        self.count += 1
        self.lines += len(printed.splitlines())
        return code, printed


def children_s() -> float:
    """Return the processor time of children that ended [s]: the waiting on an idle machine."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def steps(page: Path) -> list[Block]:
    """Return what a page has its reader run, in order: blocks, and commands that stand alone."""
    fenced = list(blocks(page))
    inside = {n for one in fenced for n in range(one.line, one.line + one.text.count("\n") + 3)}
    text = page.read_text(encoding="utf-8")
    given = set(re.findall(r"tautwave example (\S+)", text))  # else the rig is the reader's own
    lines = text.splitlines()
    alone = [
        Block("console", number, f"$ {line.strip()}", "")
        for number, line in enumerate(lines, 1)
        if number not in inside
        and (found := re.match(r"    tautwave run (\S+)\.yaml .*--clock fake", line))
        and found[1] in given
    ]
    return sorted([*fenced, *alone], key=lambda one: one.line)


def walk(name: str, folder: Path) -> Walk:
    """Follow the pages of a path, each in a folder of its own in `folder`.

    Raises
    ------
    AssertionError
        A page is wrong: its line, and what was printed.
    """
    words = commands = saved = printed = 0
    waited_s = cpu_s = 0.0
    with pytest.MonkeyPatch.context() as patch:
        for one in PATHS[name]:
            path = ROOT / "docs" / one
            own = folder / path.stem
            own.mkdir()
            page = _Followed(path, own, patch)
            words += len(prose(path.read_text(encoding="utf-8")).split())
            try:
                if one == "add-a-driver.md":
                    begun, spent = time.monotonic(), children_s()
                    tried = follow(path, own)
                    assert tried.returncode == 0, tried.stdout
                    page.waited_s = time.monotonic() - begun
                    page.cpu_s = children_s() - spent
                    page.count, page.lines = 1, len(tried.stdout.splitlines())
                    saved += sum(1 + b.text.count("\n") for b in blocks(path) if b.kind == "python")
                else:
                    for block in steps(path):
                        page.run(block)
                        saved += 1 + block.text.count("\n") if block.kind in ("yaml", "ini") else 0
            finally:
                page.close()
            commands, printed = commands + page.count, printed + page.lines
            waited_s += page.waited_s
            cpu_s += page.cpu_s
    return Walk(words, commands, saved, printed, waited_s, cpu_s)


def main(*names: str) -> None:
    """Walk paths and print what was counted."""
    rows = []
    for name in names or PATHS:
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            done = walk(name, Path(folder))
        rows.append(
            (name, f"{done.words}", f"{done.words / WORDS_A_MINUTE:.0f}", f"{done.commands}",
             f"{done.saved}", f"{done.printed}", f"{done.waited_s:.0f}", f"{done.cpu_s:.0f}")
        )  # fmt: skip
    heads = (
        "path",
        "words",
        "min of reading",
        "commands",
        "lines saved",
        "lines printed",
        "s waited",
        "s of CPU",
    )
    print(plain_text([Table("The first hour", of_numbers(*heads), rows)]))


if __name__ == "__main__":
    main(*sys.argv[1:])
