"""Nobody but a coupling's own part asks which law it is."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.house.test_source import ROOT, SOURCES

PARTS = ROOT / "src/tautwave/couplings"
ASKED = re.compile(
    r"""\blaw["'](?:, *["']\w+["'])?\) *(==|!=)|\blaw["'\])]* *(==|!=|\bin\b) *[("'\[{A-Z]"""
    r"""|["'](wave|position)["'] *(==|!=) *[\w.]*law|match .*\blaw\b"""
)


def asking(source: str) -> list[str]:
    """Lines that ask which law it is."""
    return [line.strip() for line in source.splitlines() if ASKED.search(line)]


@pytest.mark.parametrize(
    "line",
    [
        'if rig.coupling.law == "wave":',
        'waves = coupling.law != "wave"',
        'if law in ("wave", "position"):',
        'held = block(run.rig, "coupling")["law"] == "wave"',
        'if "position" == keys.law:',
        'if coupling.get("law", "wave") == "wave":',
        "match rig.coupling.law:",
    ],
)
def test_a_planted_question_is_found(line: str) -> None:
    assert asking(f"def f():\n    {line}\n")


def test_nobody_outside_a_part_asks_which_law_it_is() -> None:
    found = {
        str(path.relative_to(ROOT)): lines
        for path in SOURCES
        if not path.is_relative_to(PARTS) and (lines := asking(Path(path).read_text()))
    }
    assert found == {}
