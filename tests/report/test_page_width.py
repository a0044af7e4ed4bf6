"""The report in Chromium: it does not scroll sideways, on a screen or on a phone."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave.config import load_rig
from tautwave.session import run
from tests.view.browser import CHROMIUM, Browser

CONFIGS = Path(__file__).parents[2] / "configs"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(300),
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium"),
]


@pytest.mark.parametrize(
    ("name", "sets"),
    [
        ("bench-room-loopback", ()),
        ("bench-1dof-loopback", ("operate={start: engaged}", "name=a-name-" + "long" * 12)),
        ("scene-resonator", ()),
        ("bench-mixed-sim", ()),
    ],
)
def test_a_report_does_not_scroll_sideways(
    name: str, sets: tuple[str, ...], tmp_path: Path
) -> None:
    rig = load_rig(CONFIGS / f"{name}.yaml", list(sets))
    run(rig, clock="fake", out=tmp_path / "run", duration_s=0.5, simulate=True,
        allow_unwatched=True)  # fmt: skip
    page = (tmp_path / "run" / "report.html").as_uri()
    with Browser() as browser:
        for width in (1400, 420):
            for dark in (False, True):
                browser.look(width, 1000, dark=dark)
                browser.open(page)
                loaded = f"document.readyState == 'complete' && location.href == {page!r}"
                assert browser.wait(loaded)
                assert browser.run("document.documentElement.scrollWidth") <= width
