"""A press that stands, under every law: who lets go says so, and nobody gives unclaimed energy."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

import numpy as np
import pytest

from tautwave.config import Rig
from tautwave.rig import command_delays
from tautwave.session.facts import port_claims
from tautwave.simulation import Simulation, simulate
from tests.rigs.holds import (
    FELT,
    HOUR_S,
    LAWS,
    SIDES,
    Hold,
    Lasted,
    cases,
    efforts,
    lasted,
    lets_go_unsaid,
)

IN_ACCOUNTS = [law for law in LAWS if law.endswith("account") or law == "wave"]
LONG = [
    pytest.mark.slow,
    pytest.mark.nightly,
    pytest.mark.timeout(900),
    pytest.mark.skipif(importlib.util.find_spec("numba") is None, reason="numba is not installed"),
]
EXACT = ("wave", "position account")
"""What holds a minute to a few per cent in every case of `python -m tests.rigs.holds`."""


def given(runs: Sequence[Simulation]) -> dict[str, float]:
    """Return the most that each end had given at any time [J]."""
    return {
        side: max(float(np.max(-run[f"{side}.lever.port_energy"])) for run in runs)
        for side in SIDES
    }


def claims(rig: Rig) -> dict[str, float]:
    """Return what each end claims [J]; nothing of a law that claims nothing."""
    found: dict[str, float] = port_claims(rig, "lever", command_delays(rig)).get("claim_j", {})
    return found


def assert_in_the_books(case: Hold, rig: Rig, given_j: dict[str, float]) -> None:
    for side, claim in claims(rig).items():
        assert given_j[side] <= claim, (case, side)


@pytest.mark.parametrize("law", ["position account", pytest.param("wave", marks=pytest.mark.slow)])
def test_a_press_of_some_seconds_is_held_alike_at_both_ends(law: str) -> None:
    case = Hold(law, "stiff", 0.0, "1.5e-5")
    rig = case.rig
    run = simulate(rig, duration_s=3.2, engine="python")
    assert run.error is None
    one, two = efforts(run, "master")[0], efforts(run, "slave")[0]
    assert min(abs(one), abs(two)) > 8.0 * FELT
    assert abs(one + two) < FELT
    assert_in_the_books(case, rig, given([run]))


@pytest.mark.parametrize("law", [pytest.param(law, marks=LONG) for law in IN_ACCOUNTS])
def test_nothing_lets_go_unsaid(law: str) -> None:
    for case in cases([law]):
        rig = case.rig
        run = simulate(rig, engine="compiled")
        assert not lets_go_unsaid(run), case
        assert_in_the_books(case, rig, given([run]))


@pytest.mark.parametrize("law", [pytest.param(law, marks=LONG) for law in IN_ACCOUNTS])
def test_nothing_lets_go_unsaid_within_an_hour(law: str) -> None:
    """With each wall, delay and encoder; who holds exactly holds all the time."""
    for case in cases([law]):
        found = lasted(case)
        assert not found.lets_go_unsaid, case
        assert_in_the_books(case, case.rig.model_copy(update={"duration_s": HOUR_S}), found.given)
        if found.error is None:
            assert found.seconds == pytest.approx(HOUR_S)
        if law in EXACT:
            assert found.error is None, case
            for side in SIDES:
                assert found.last[side] > 0.9 * found.first[side], (case, side)


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("numba") is None, reason="numba is not installed")
def test_a_press_that_ends_is_said_and_its_last_seconds_are_those_before() -> None:
    found = lasted(Hold("four_channel account", "soft", 0.02, "9e-5"), 20.0)
    assert found.seconds < 10.0
    assert "lost its coupling" in (found.error or "")
    assert not found.lets_go_unsaid


@pytest.mark.parametrize(
    ("last", "error", "unsaid"),
    [(0.2, None, False), (0.04, None, True), (0.04, "lost its coupling", False)],
)
def test_a_side_that_presses_a_quarter_and_runs_on_lets_go_unsaid(
    last: float, error: str | None, unsaid: bool
) -> None:
    first = dict.fromkeys(SIDES, 0.2)
    found = Lasted(first, {"master": 0.2, "slave": last}, first, HOUR_S, error)
    assert found.lets_go_unsaid is unsaid
    loose = Lasted(dict.fromkeys(SIDES, FELT), dict.fromkeys(SIDES, 0.0), first, HOUR_S, None)
    assert not loose.lets_go_unsaid
