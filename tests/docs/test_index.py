"""The first page leads to every page that is worked by."""

from __future__ import annotations

from pathlib import Path

import pytest

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("folder", ["start", "tutorials", "howto", "explanation"])
def test_every_page_is_in_the_navigation(folder: str) -> None:
    listed = (DOCS / "index.md").read_text(encoding="utf-8").splitlines()
    assert {f"{folder}/{page.stem}" for page in (DOCS / folder).glob("*.md")} <= set(listed)
