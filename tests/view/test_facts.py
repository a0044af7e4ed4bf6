"""What a page is told of a run before its rows: how serious a certificate is, what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.runtime.operate.led import LedMasters
from tautwave.runtime.operate.states import COMMANDS, STATES, Standing, follow
from tautwave.runtime.tap import Live
from tautwave.view.facts import facts_of

RIG = load_rig(Path(__file__).parents[2] / "configs" / "bench-1dof-loopback.yaml")


def told(**facts: Any) -> dict[str, Any]:
    return facts_of(Live(0, 0, ("time_s",), 1, 1000.0, {"units": {"lever": "rad"}, **facts}), RIG)


@pytest.mark.parametrize(
    ("passed", "state", "severity"),
    [
        (True, "passed", "ok"),
        (True, "conditional", "note"),
        (False, "failed", "bad"),
        (None, "not evaluated", "open"),
    ],
)
def test_a_certificate_comes_with_how_serious_it_is(
    passed: bool | None, state: str, severity: str
) -> None:
    given = {"passed": passed, "state": state, "require": "passive", "sentences": ["why"]}
    assert told(certificate=given)["certificate"] == {**given, "severity": severity}
    assert told()["certificate"] is None


def test_what_a_run_would_refuse_a_page_knows_beforehand() -> None:
    facts = told()
    for state in STATES:
        for word in COMMANDS:
            possible = follow(Standing(state), word) is not None
            assert (word in facts["refusals"][state]) != possible
    for leader, word in (("person", "take_over"), ("policy", "hand_back")):
        assert facts["leads_already"][word] == LedMasters([], leader).switch(word) != ""
