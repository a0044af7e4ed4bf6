"""No string of a received summary gets into a page as markup."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tautwave.report.run.loading import load_run
from tautwave.report.run.page import write_page
from tautwave.summary import plain_summary, summary_of
from tautwave.summary.markup import Markup, markup

OLDER = Path(__file__).parent / "older"
EVIL = "<h1 class='x'>&\"INJECTED"


def injected(value: Any, at: str = "") -> Any:
    """Return plain data with markup in every string and in every name that is somebody's."""
    if isinstance(value, dict):
        named = at in NAMED
        return {
            f"{key}{EVIL}" if named else key: injected(one, f"{at}.{key}" if at else key)
            for key, one in value.items()
        }
    if isinstance(value, list):
        return [injected(one, at) for one in value]
    return f"{value}{EVIL}" if isinstance(value, str) and at not in WORDS else value


NAMED = {"buses", "axes", "pairs", "cameras", "certificate.verdicts", "certificate.elements"}
WORDS = {"outcome.kind", "pairs.kind", "clock"}


def test_what_is_put_into_markup_is_escaped_unless_it_is_markup() -> None:
    assert markup("<b>") == "&lt;b&gt;"
    assert Markup("<p>{}{}</p>").format("<b>", Markup("<i>")) == "<p>&lt;b&gt;<i></p>"
    assert Markup("").join(["<b>", Markup("<i>")]) == "&lt;b&gt;<i>"
    assert Markup("<i>") + "<b>" == "<i>&lt;b&gt;"
    assert isinstance(Markup("<i>") + "<b>", Markup)
    assert Markup("<p>{}</p>").each("<a") == "<p>&lt;</p><p>a</p>"


@pytest.mark.parametrize(
    "name",
    ["91822ecf-operated", "a9a4accd-canopen", "e8d32118-uncertified", "cc7572d2-fault"],
)
def test_markup_in_every_string_of_a_summary_is_text_in_the_page(name: str, tmp_path: Path) -> None:
    old = plain_summary(summary_of(json.loads((OLDER / f"{name}.json").read_text()))[0])
    evil = injected(old)
    evil |= {"clock": "real", "warnings": [EVIL], "report_error": EVIL, "incomplete": EVIL}
    for bus in evil["buses"].values():
        bus["forced"] = True
    (tmp_path / "summary.json").write_text(json.dumps(evil))
    page = write_page(load_run(tmp_path)).read_text()
    assert "<h1 class" not in page
    assert page.count("&lt;h1 class=&#x27;x&#x27;&gt;&amp;&quot;INJECTED") > 20
    forced = page.count(" --simulate ")
    assert forced >= len(evil["buses"])
