"""The gallery shows what `python -m tests.lab papers` makes, all of it, and is small.

The command itself is a block of its page, run with the others (`test_blocks`).
"""

from __future__ import annotations

import re
from pathlib import Path

from tests.lab.papers import CHAPTERS, chapter

DOCS = Path(__file__).parents[2] / "docs"
KEPT = {path.name for path in (DOCS / "gallery").iterdir() if path.suffix in (".svg", ".txt")}


def test_the_gallery_has_every_figure_and_table() -> None:
    figures = {f"{name}.svg" for each in CHAPTERS for name in chapter(each).figures}
    tables = {f"{name}.txt" for name in CHAPTERS}
    assert figures | tables == KEPT
    shown = re.findall(r"gallery/([\w-]+\.(?:svg|txt))", (DOCS / "gallery.md").read_text())
    assert sorted(shown) == sorted(KEPT)


def test_its_pictures_are_small_and_follow_dark_mode() -> None:
    drawn = [path.read_text() for path in (DOCS / "gallery").glob("*.svg")]
    assert all("prefers-color-scheme: dark" in text for text in drawn)
    assert sum(map(len, drawn)) < 600_000
