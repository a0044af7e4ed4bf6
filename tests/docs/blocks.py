"""The fenced blocks of a Markdown page, and how each is run.

console
    Lines that begin with `$ ` are commands (a backslash continues one); what follows, up to the
    next, is what they print, `...` standing for anything. No such lines: the output is not shown.
    `tautwave` runs in the test's process, everything else in a shell.
python
    All of a page share one namespace.
yaml, ini
    A first line `# NAME` saves the block under that name, for the commands after it.
text
    Pictures of what is said elsewhere: not run, and no command may hide in one.

A comment on the line before a fence says more:
<!-- output -->            text: what the Python block before it printed
<!-- exit 3 -->            console: the exit code of the last command
<!-- slow -->              takes seconds or the real clock: only with `-m slow`
<!-- served by: COMMAND as /dev/ttyUSB0 -->   this command serves the device that the page names
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
KINDS = {"console", "python", "yaml", "ini", "text"}
FOLLOWED = {"add-a-driver.md", "add-a-coupling.md"}
"""Pages that `tests/parts/test_pages.py` follows from nothing to a passing suite."""
MYST = re.compile(r"\{[a-z:-]+\}")  # a directive of the site, no block


class Block(NamedTuple):
    """One fenced block: its kind, the line of its fence, its text, the comment before it."""

    kind: str
    line: int
    text: str
    note: str


class Command(NamedTuple):
    """One command of a console block, and the output shown below it."""

    words: str
    shown: str


def pages() -> list[Path]:
    """README, that of the rig files, and every page of the docs."""
    found = [path for path in sorted((ROOT / "docs").rglob("*.md")) if not _left_out(path)]
    return [ROOT / "README.md", ROOT / "configs" / "README.md", *found]


def _left_out(path: Path) -> bool:
    parts = path.relative_to(ROOT / "docs").parts
    return parts[0] in {"_build", "examples"} | FOLLOWED or "generated" in parts


def blocks(page: Path) -> Iterator[Block]:
    """Yield the fenced blocks of a page."""
    kind, start, fence, indent, text = "", 0, "", 0, [""]
    note = before = ""
    for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
        if fence:
            if line.strip() == fence:
                if not MYST.match(kind):
                    yield Block(kind, start, "\n".join(text), note)
                fence = ""
            else:
                text.append(line[min(indent, len(line) - len(line.lstrip())) :])
        elif opening := re.match(r"(\s*)(`{3,}|~{3,})(.*)", line):
            indent, fence, kind = len(opening[1]), opening[2], opening[3].strip()
            start, text = number, []
            said = re.fullmatch(r"<!-- (.*) -->", before)
            note = said[1] if said else ""
        before = line.strip()


def commands(block: Block) -> list[Command]:
    """Return the commands of a console block with what is shown below each."""
    found: list[Command] = []
    words, shown, going_on = "", [""], False
    for line in [*block.text.splitlines(), "$ "]:
        if line.startswith("$ ") and not going_on:
            if words:
                found.append(Command(words, "\n".join(shown)))
            words, shown = line[2:], []
        elif going_on:
            words += " " + line.strip()
        else:
            shown.append(line)
            continue
        going_on = words.endswith("\\")
        words = words.removesuffix("\\").rstrip()
    return found


def agrees(shown: str, printed: str) -> bool:
    """Return whether `printed` holds what is shown, `...` standing for anything.

    Lines are compared without the spaces at their ends.
    """
    want = "\n".join(line.rstrip() for line in shown.strip("\n").splitlines())
    have = "\n".join(line.rstrip() for line in printed.strip("\n").splitlines())
    pattern = ".*".join(re.escape(part) for part in want.split("..."))
    return re.fullmatch(pattern, have, re.DOTALL) is not None
