"""Every fenced block of READMEs and docs runs; what is shown below a command is what it prints."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.blocks import KINDS, ROOT, Block, agrees, blocks, commands, pages
from tests.docs.running import Page

PAGES = [page for page in pages() if any(blocks(page))]


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix()


def _run(path: Path, chosen: list[Block], folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = Page(path, folder, monkeypatch)
    if path.name == "README.md":  # read in a clone; pages of the site do without
        (folder / "configs").symlink_to(ROOT / "configs")
    try:
        for block in chosen:
            page.run(block)
    finally:
        page.close()


LONG = ("delay-and-waves.md", "dynamixel-arms.md", "modbus-profile.md", "cia402-from-eds.md",
        "operate.md", "export.md", "calibrate.md", "with-the-device.md", "first-day.md",
        "dynamixel.md", "modbus.md", "virtual-wall.md", "read-a-recording.md")  # fmt: skip
"""Their quick blocks take seconds too."""


@pytest.mark.realtime
@pytest.mark.parametrize(
    "path",
    [pytest.param(p, marks=pytest.mark.slow) if p.name in LONG else p for p in PAGES],
    ids=_name,
)
def test_blocks_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    quick = [block for block in blocks(path) if not block.note.startswith("slow")]
    _run(path, quick, tmp_path, monkeypatch)


OFFLINE = ("docs/gallery.md",)
"""Their slow blocks need no real clock, but most of a minute."""


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize(
    "path",
    [
        pytest.param(
            page, marks=pytest.mark.nightly if _name(page) in OFFLINE else pytest.mark.realtime
        )
        for page in PAGES
        if any(block.note.startswith("slow") for block in blocks(page))
    ],
    ids=_name,
)
def test_slow_blocks_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _run(path, list(blocks(path)), tmp_path, monkeypatch)


@pytest.mark.parametrize("path", PAGES, ids=_name)
def test_each_block_is_of_a_kind_that_is_held(path: Path) -> None:
    for block in blocks(path):
        assert block.kind in KINDS, f"{path}:{block.line}: {block.kind!r}"


@pytest.mark.parametrize(
    "name", ["README.md", "CONTRIBUTING.md", "configs/README.md", "tests/README.md"]
)
def test_links_between_pages_lead_somewhere(name: str) -> None:
    """Those of the site are Sphinx' to check."""
    page = ROOT / name
    for target in re.findall(r"\]\(([^)#]+)[^)]*\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), target


def test_commands_of_a_block() -> None:
    block = Block("console", 1, "$ one \\\n  more\nprints\n$ two", "")
    assert commands(block) == [("one more", "prints"), ("two", "")]


@pytest.mark.parametrize(
    ("shown", "same"), [("a\n...\nd", True), ("a...d", True), ("a\nb", False), ("b\n...", False)]
)
def test_what_is_shown_has_to_be_printed(shown: str, same: bool) -> None:
    assert agrees(shown, "a\nb \nc\nd\n") is same


@pytest.mark.parametrize(
    "text",
    [
        "```console\n$ tautwave drivers\nnothing\n```",
        "```console\n$ tautwave check none.yaml\n```",
        "```console\n$ false\n```",
        "```console\ntautwave drivers\n```",
        "```python\nassert 1 == 2\n```",
        "```yaml\na: 1\n```",
        "```text\n$ tautwave drivers\n```",
        "```python\nprint(1)\n```\n<!-- output -->\n```text\n2\n```",
    ],
)
def test_a_wrong_block_is_found(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "page.md"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(AssertionError):
        _run(path, list(blocks(path)), tmp_path, monkeypatch)
