"""A press that stands, under every law: who lets go says so, and nobody gives unclaimed energy."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

import numpy as np
import pytest

from tautwave.config import Rig
from tautwave.rig import command_delays
from tautwave.session.facts import port_claims
from tautwave.simulation import Simulation, simulate, simulate_pieces
from tests.rigs.holds import FELT, LAWS, Hold, cases, efforts, lets_go_unsaid

SIDES = ("master", "slave")
IN_ACCOUNTS = [law for law in LAWS if law.endswith("account") or law == "wave"]
LONG = [
    pytest.mark.slow,
    pytest.mark.nightly,
    pytest.mark.timeout(900),
    pytest.mark.skipif(importlib.util.find_spec("numba") is None, reason="numba is not installed"),
]
EXACT = ("wave", "position account")
"""What holds a minute to a few per cent in every case of `python -m tests.rigs.holds`."""

HOUR_S, PIECE_ROWS = 3600.0, 200_000


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
def test_what_is_held_for_a_minute_is_held_for_an_hour(law: str) -> None:
    """Or it says that it is not: at the noise that is declared, with a delay and a stiff wall."""
    case = Hold(law, "stiff", 0.02, "9e-5")
    rig = case.rig.model_copy(update={"duration_s": HOUR_S})
    most, pressed = dict.fromkeys(SIDES, 0.0), dict.fromkeys(SIDES, 0.0)
    error, rows, last = None, 0, dict.fromkeys(SIDES, 0.0)
    for piece in simulate_pieces(rig, PIECE_ROWS):
        rows, error = rows + len(piece), piece.error
        for side, joules in given([piece]).items():
            most[side] = max(most[side], joules)
            sizes = np.abs(piece[f"{side}.lever.commanded"])
            time = piece["time_s"]
            if time[0] < 10.0:
                pressed[side] = float(np.mean(sizes[(time > 5.0) & (time < 10.0)]))
            last[side] = float(np.mean(sizes[time < HOUR_S - 2.0]))
    assert_in_the_books(case, rig, most)
    if error is None:
        assert rows == HOUR_S * rig.rate_hz
        share = 0.9 if law in EXACT else 0.25
        for side in SIDES:
            assert pressed[side] < 2.0 * FELT or last[side] > share * pressed[side], side
