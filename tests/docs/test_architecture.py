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
