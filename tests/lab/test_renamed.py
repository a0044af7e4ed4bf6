"""Scripts written before modules moved import what they did."""

from __future__ import annotations

import importlib
import importlib.util

import pytest

from tests.lab.renamed import PAGE, moves, rewrite

ROWS = [("a.b.c", "x.y.d"), ("a.b", "q.b")]


@pytest.mark.parametrize(
    ("line", "now"),
    [
        ("import a.b.c", "import x.y.d"),
        ("from a.b.c import f", "from x.y.d import f"),
        ("from a.b import c", "from x.y import d as c"),
        ("    from a.b import c as e  # why", "    from x.y import d as e  # why"),
        ("from a.b.e import f", "from q.b.e import f"),
        ("import a.bc", "import a.bc"),
        ("ba.b.c()", "ba.b.c()"),
    ],
)
def test_a_line_is_rewritten(line: str, now: str) -> None:
    assert rewrite(line + "\n", ROWS) == now + "\n"


def is_there(name: str) -> bool:
    """Return whether a dotted name is a module, or something in one."""
    home, _, last = name.rpartition(".")
    if importlib.util.find_spec(home) is None:
        return False
    module = importlib.import_module(home)
    return hasattr(module, last) or importlib.util.find_spec(name) is not None


def test_every_row_leads_to_a_module_that_is_there() -> None:
    rows = moves(PAGE.read_text())
    assert len(rows) > 20
    final = dict(rows)
    for _, now in rows:
        while now in final:
            now = final[now]
        assert is_there(now), now


def test_no_row_is_undone_by_a_later_one() -> None:
    rows = moves(PAGE.read_text())
    for was, now in rows:
        assert rewrite(f"import {was}\n", rows) == rewrite(f"import {now}\n", rows)
