"""What pages and examples for authors of plugins import is public, and what is public is there."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from tautwave import plugin

DOCS = Path(__file__).parents[2] / "docs"
PUBLIC = {"tautwave", "tautwave.plugin", "tautwave.testing"}
PAGES = (*sorted(DOCS.glob("add-a-*.md")), *sorted((DOCS / "examples").rglob("*.py")))
BLOCK = re.compile(r"^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)


def imported(source: str) -> set[str]:
    """Return the modules of ours that some Python imports from."""
    return {
        name
        for node in ast.walk(ast.parse(source))
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else []
        )
        if name.split(".")[0] == "tautwave"
    }


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_authors_are_shown_public_names_only(page: Path) -> None:
    text = page.read_text()
    blocks = BLOCK.findall(text) if page.suffix == ".md" else [text]
    assert blocks
    for block in blocks:
        assert imported(block) <= PUBLIC, block


def test_an_inner_module_would_be_noticed() -> None:
    assert imported("from tautwave.contracts import Budget") - PUBLIC == {"tautwave.contracts"}


@pytest.mark.parametrize("name", plugin.__all__)
def test_every_name_is_there_and_on_the_page(name: str) -> None:
    assert getattr(plugin, name) is not None
    assert f"`{name}`" in (DOCS / "reference" / "api.md").read_text()


def test_another_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Loop'"):
        plugin.Loop  # noqa: B018
    assert "Budget" in dir(plugin)
