"""The page in a real browser, in a network namespace that has nothing but its loopback."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tautwave.runtime.operate.states import AFTER_FAULT, STATES
from tests.view.browser import CHROMIUM

ROOT = Path(__file__).parents[2]
UNSHARE = shutil.which("unshare")
ALONE = [UNSHARE or "unshare", "--net"]

pytestmark = [
    pytest.mark.slow,
    pytest.mark.realtime,
    pytest.mark.timeout(300),
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium: apt-get install chromium"),
]


def can_be_alone() -> bool:
    return UNSHARE is not None and not subprocess.run([*ALONE, "true"], check=False).returncode


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    if not can_be_alone():
        pytest.skip("no network namespace of its own here")
    folder = tmp_path_factory.mktemp("page")
    order = [*ALONE, sys.executable, "-m", "tests.view.alone", str(folder)]
    done = subprocess.run(order, cwd=ROOT, capture_output=True, text=True, check=False, timeout=280)
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def test_the_page_loads_from_here_alone_and_shows_the_rows(seen: dict[str, Any]) -> None:
    assert seen["loads"]
    assert seen["problems"] == []
    assert seen["name"] == "<b onclick=alert(1)>bench</b>"  # as text
    assert not seen["token in address"]
    hosts = {re.match(r"\w+://([\d.]+):\d+/", url) for url in seen["requests"]}
    assert {host and host[1] for host in hosts} == {"127.0.0.1"}
    assert seen["ended"]
    assert seen["seen"] >= 0.99 * (seen["rows"] - seen["first"])


def test_every_button_works(seen: dict[str, Any]) -> None:
    assert {name: works for name, works in seen["buttons"].items() if not works} == {}
    assert len(seen["buttons"]) == 20


def test_a_bad_day_does_not_look_good(seen: dict[str, Any]) -> None:
    day = seen["bad day"]
    assert day["events"] == "28 faults, 1 stop, cut off 2 times"
    assert (day["shade"], day["acknowledged"]) == ("badge bad", "badge note")
    assert day["engage"]  # is disabled, and says why
    assert day["title"] == AFTER_FAULT
    assert AFTER_FAULT in day["why"]
    first, last, *others = day["entries"]
    assert first == "2.00 sfirst cause, fault (controller): slave.lever: no power"
    assert last.endswith("slave.lever: 3 samples missing (x 27, last 66.60 s)")
    assert not any(other.endswith("no power") for other in others)  # said once


STATE_SHADES = {"running": "good", "engaged": "good", "holding": "note"}
SEVERITIES = {"ok": "good", "note": "note", "bad": "bad", "open": ""}


def contrast(one: str, other: str) -> float:
    """Contrast of two colours of CSS, `rgb(r, g, b)` (WCAG 2.2)."""

    def luminance(text: str) -> float:
        parts = [int(part) / 255.0 for part in re.findall(r"\d+", text)[:3]]
        r, g, b = [p / 12.92 if p <= 0.04045 else ((p + 0.055) / 1.055) ** 2.4 for p in parts]
        return 0.2126 * r + 0.7152 * g + 0.0722 * b

    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_badge_has_the_colour_of_what_it_says(seen: dict[str, Any], theme: str) -> None:
    states = ["running", *STATES]
    colours = {}
    for after, faulted in (("", False), (" after a fault", True)):
        shown = seen["shades"][theme + after]
        expected = [f"{state}{after}" for state in states]
        assert [text for text, *_ in shown[: len(states)]] == expected
        wanted = ["bad" if faulted else STATE_SHADES.get(state, "") for state in states]
        wanted += SEVERITIES.values()
        assert [level.removeprefix("badge").strip() for _, level, *_ in shown] == wanted
        for _, level, ground, ink in shown:
            assert contrast(ground, ink) >= 4.5
            colours[level] = ground
    assert len(set(colours.values())) == 4
    red, green, blue = (int(part) for part in re.findall(r"\d+", colours["badge note"])[:3])
    assert red > green > blue  # amber


def test_nothing_can_be_asked_of_a_run_that_has_ended(seen: dict[str, Any]) -> None:
    assert set(seen["barred"].values()) == {"the run has ended"}
    assert len(seen["barred"]) == 7


def test_the_page_does_not_scroll_sideways(seen: dict[str, Any]) -> None:
    assert seen["wide"] == [0, 0]


def test_no_number_is_printed_over_a_box(seen: dict[str, Any]) -> None:
    assert seen["overprints"] == [0] * 8


def test_every_grain_of_a_scene_is_in_its_picture(seen: dict[str, Any]) -> None:
    low, high, *grains = seen["grains"]
    assert len(grains) == 12
    assert all(low < y < high for y in grains)


def test_a_trigger_fires_at_the_row_of_the_edge(seen: dict[str, Any]) -> None:
    for mode in ("normal", "auto"):
        nearest = min(abs(seen["fired"][mode] - edge) for edge in seen["edges"])
        assert nearest <= 1.0e-3 + 1e-9, mode


def test_a_refused_change_says_why_and_a_certified_one_acts(seen: dict[str, Any]) -> None:
    assert "K = 20 N m/rad is 6.25 x the passive limit" in seen["refused"]
    assert seen["tuned"].startswith("certified: coupling.pairs.lever.wall_slave.stiffness 3.1")
    assert seen["acts"]
