"""What a page holds of its pictures, and what stands beside it."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import pytest

from tautwave.report.run import page
from tautwave.report.run.page import write_page
from tautwave.summary.markup import Markup


class Drawn(NamedTuple):
    """A picture of a size in the page."""

    name: str
    size: int

    def keep(self, directory: Path) -> tuple[int, Callable[[], Markup]]:
        (directory / self.name).write_text("drawn")
        return self.size, lambda: Markup("<p>{} inside</p>").format(self.name)

    def beside(self) -> Markup:
        return Markup("<p>{} beside</p>").format(self.name)


def test_a_page_is_filled_to_the_byte_and_what_stands_beside_it_takes_no_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = {"a": 101, "b": 60, "c": 41, "d": 40, "e": 1, "f": 0}
    body = [Markup("<p>words</p>"), *(Drawn(name, size) for name, size in sizes.items())]
    monkeypatch.setattr(page, "body_of", lambda run: body)
    monkeypatch.setattr(page, "PICTURE_BYTES", 100)
    run: Any = SimpleNamespace(name="bench", directory=tmp_path)
    path = write_page(run)
    assert path == tmp_path / "report.html"
    text = path.read_text()
    assert "<title>bench – tautwave report</title>" in text
    places = {name: "inside" if name in "bdf" else "beside" for name in sizes}
    shown = ["words", *(f"{name} {place}" for name, place in places.items())]
    assert re.findall("<p>(.*?)</p>", text) == shown
    assert all((tmp_path / name).read_text() == "drawn" for name in sizes)
