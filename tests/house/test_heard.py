"""What nightly tests wait for is said: a change of wording does not wait for the night."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_what_tests_wait_for_is_said() -> None:
    tests = [path.read_text() for path in (ROOT / "tests/session").glob("*.py")]
    words = {one for text in tests for one in re.findall(r'\.hears\("([^"]+)"\)', text)}
    assert len(words) > 5
    said = "\n".join(path.read_text() for path in (ROOT / "src").rglob("*.py"))
    said = re.sub(r'"\s*f?"', "", said)  # texts over several lines are one
    assert [one for one in sorted(words) if one not in said] == []
