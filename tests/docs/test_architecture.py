"""The map of the architecture page leads to where things are."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROW = re.compile(r"^\| ([^|`]+) \| `([^`]+)` \| `(\w+)` \|$", re.MULTILINE)


def defined(path: Path) -> set[str]:
    """Names that a module, or the modules of a folder, define at their top level."""
    found: set[str] = set()
    for module in sorted(path.glob("*.py")) if path.is_dir() else [path]:
        for node in ast.parse(module.read_text()).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                found.add(node.name)
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                found |= {target.id for target in targets if isinstance(target, ast.Name)}
    return found


def wrong_rows(text: str) -> list[str]:
    """What is looked for in a table and is not where the table says."""
    return [
        what
        for what, where, name in ROW.findall(text)
        if not (ROOT / where).exists() or name not in defined(ROOT / where)
    ]


def test_what_is_looked_for_is_where_the_map_says() -> None:
    text = (ROOT / "docs/architecture.md").read_text()
    table = text.partition("## Where is it")[2].partition("\n## ")[0]
    assert len(ROW.findall(table)) == table.count("\n| ") - 1 >= 20
    assert wrong_rows(table) == []


def test_a_row_that_leads_nowhere_is_noticed() -> None:
    assert wrong_rows("| walls | `src/tautwave/laws/wall.py` | `wall_effort` |") == []
    assert wrong_rows("| walls | `src/tautwave/laws/wall.py` | `wal_effort` |") == ["walls"]
    assert wrong_rows("| walls | `src/tautwave/wall.py` | `wall_effort` |") == ["walls"]


def test_every_decision_has_a_number_of_its_own() -> None:
    pages = sorted(path.name for path in (ROOT / "docs" / "decisions").glob("0*.md"))
    numbers = [name.split("-")[0] for name in pages]
    assert len(set(numbers)) == len(numbers), pages[-4:]


def test_the_picture_of_the_floors_has_each_room_once_and_fits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each package and module of `tautwave` is in it, and no box is narrower than its name."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    from _tools.floors import PER_LETTER, WIDTH, floors, floors_svg

    rooms = [room for row in floors() for room in row]
    source = ROOT / "src/tautwave"
    there = {path.stem for path in source.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert sorted(rooms) == sorted(there - {"__init__", "__pycache__"})
    boxes = re.findall(r'<rect x="([\d.]+)" y="\d+" width="([\d.]+)"', floors_svg())
    names = re.findall(r">([a-z_]+)</text>", floors_svg())
    assert names == rooms
    for (x, width), name in zip(boxes, names, strict=True):
        assert float(x) + float(width) <= WIDTH
        assert float(width) >= PER_LETTER * len(name), name


STATUS = re.compile(
    r"^---\norphan: true\n---\n\n# .+\n\n"
    r"(?:Accepted \d{4}-\d\d-\d\d(?:; changed in part by (?:\[\d{4}\]\([\w.-]+\)(?: and )?)+)?\.|"
    r"Replaced by \[\d{4}\]\([\w.-]+\); accepted \d{4}-\d\d-\d\d\.)\n\n\*\*Context\.\*\* "
)


def unlike_decisions(pages: dict[str, str], index: str) -> list[str]:
    """Pages without status and date, or not in exactly one group of the index."""
    return [
        name
        for name, text in pages.items()
        if not STATUS.match(text) or index.count(f"]({name})") != 1
    ]


def test_every_decision_has_a_status_a_date_and_a_group() -> None:
    folder = ROOT / "docs/decisions"
    pages = {path.name: path.read_text() for path in folder.glob("0*.md")}
    assert not unlike_decisions(pages, (folder / "index.md").read_text())


def test_a_decision_without_status_or_group_is_noticed() -> None:
    good = "---\norphan: true\n---\n\n# A title\n\nAccepted 2026-11-28.\n\n**Context.** Text.\n"
    assert not unlike_decisions({"0001-a.md": good}, "- [0001](0001-a.md) A title\n")
    assert unlike_decisions({"0001-a.md": good}, "") == ["0001-a.md"]
    bad = good.replace("Accepted 2026-11-28.\n\n", "")
    assert unlike_decisions({"0001-a.md": bad}, "- [0001](0001-a.md)\n") == ["0001-a.md"]


QUESTIONS = (  # the words of the field that a person searches for, and what is to be found
    ("passivity control", "control_wall"),
    ("wave port", "port_effort"),
    ("rate limit", "limit_effort"),
    ("external effort", "reaction"),
    ("tank", "port_close"),
    ("play-out", "adapt_depth"),
    ("clocks? of two sites", "clock_line"),
    ("replay window", "Opener"),
    ("CiA 402", "TRANSITIONS"),
    ("CRC", "crc16"),
    ("bus watchdog", "bringup"),
    ("Z-width", "z_width"),
    ("limit cycle", "predict_limit_cycle"),
    ("Colgate", "sampled"),
    ("gravity compensation", "SideLoad"),
    ("URDF", "read_urdf"),
    ("least squares", "damped_inverse"),
    ("MCAP", "McapFile"),
    ("shared memory", "Ring"),
    ("exit code", "TautwaveError"),
    ("engage ramp", "ramp_share"),
    ("energy account", "gate_bounds"),
    ("ROS 2 bag", "READERS"),
    ("LeRobot", "lerobot"),
    ("play operator", "follow_play"),
)
SHOWN = 5
"""Of the files that a search lists, those with most lines first, what a person opens."""


def answer(words: str, name: str, texts: dict[str, str]) -> str:
    """Return where one search leads to a name: a file, or a line of map or glossary; else ''."""
    sought = re.compile(words, re.IGNORECASE)
    hits = {path: len(sought.findall(text)) for path, text in texts.items()}
    for path in sorted(hits, key=lambda path: -hits[path])[:SHOWN]:
        there = re.search(rf"^(?:def |class )?{name}\b", texts[path], re.MULTILINE)
        if hits[path] and (there or name in Path(path).stem):
            return path
    for page in ("docs/architecture.md", "docs/reference/glossary.md"):
        lines = [line for line in texts[page].splitlines() if f"`{name}`" in line]
        if any(sought.search(line) for line in lines):
            return page
    return ""


@pytest.mark.slow
def test_one_search_by_the_words_of_the_field_leads_to_the_place() -> None:
    trees = ("src", "drivers", "sim")
    paths = [path for tree in trees for path in sorted((ROOT / tree).rglob("*.py"))]
    paths += [ROOT / "docs/architecture.md", ROOT / "docs/reference/glossary.md"]
    texts = {str(path.relative_to(ROOT)): path.read_text("utf-8") for path in paths}
    unanswered = [words for words, name in QUESTIONS if not answer(words, name, texts)]
    assert unanswered == []
    assert not answer("limit cycle", "no_such_name", texts)
