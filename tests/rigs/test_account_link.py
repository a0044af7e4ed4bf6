"""Laws of what each side sees of the other over a network, bare and in an account."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.certificate.couplings import coupling_verdict
from tautwave.errors import ConfigError
from tautwave.laws.counters import ENERGY_QUANTUM, SPAN, apart
from tautwave.link.news import (
    EFFORT_QUANTUM,
    FURTHEST,
    MOTION_QUANTUM,
    STRONGEST,
    credit_said,
    effort_heard,
    effort_said,
    level_heard,
    motion_heard,
    motion_said,
)
from tautwave.rig import command_delays
from tests.rigs.running import Run, Tree, books, rig_of, run_rig, tree
from tests.simulation.live import assert_equal

PAIRS: dict[str, Any] = {
    "position": {"stiffness": 400.0, "damping": 5.0},
    "position_force": {"stiffness": 400.0, "damping": 5.0},
    "four_channel": {"stiffness": 400.0, "damping": 5.0},
    "pd_damping": {"stiffness": 100.0, "damping": 5.0, "injection": 2.0},
}
BAD: Tree = {"delay_s": 0.003, "jitter_s": 0.004, "loss": 0.3, "burst": 3, "duplicate": 0.2}
MOVED: Tree = {
    "duration_s": 0.3,
    "simulation.hand.a": {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.02, 0.0], [0.2, 0.1]]}
    },
}


def data(law: str, account: Any, link: Tree, **pair: Any) -> Tree:
    found = tree(MOVED, {"link": link})
    keys = {**PAIRS[law], **pair}
    found["coupling"].update(law=law, account=account, pairs={"a": keys})
    for side in ("master", "slave"):
        found[side]["axes"]["a"]["effort_rate_limit"] = 1e5
    return found


@given(st.floats(-1999.0, 1999.0), st.floats(-31999.0, 31999.0), st.floats(0.0, 1.0))
def test_what_is_heard_is_what_was_said(motion: float, effort: float, level: float) -> None:
    said = motion_said(motion)
    word = effort_said(effort, level)
    assert 0 <= said < SPAN
    assert 0 <= word < SPAN
    assert motion_heard(said) == pytest.approx(motion, abs=0.5 * MOTION_QUANTUM)
    assert effort_heard(word) == pytest.approx(effort, abs=0.5 * EFFORT_QUANTUM)
    assert level - 1.0 / 1023.0 <= level_heard(word) <= level


@given(st.sampled_from((float("nan"), float("inf"), -float("inf"), 1e9, -1e9)))
def test_what_does_not_fit_is_nothing(value: float) -> None:
    assert motion_heard(motion_said(value)) == 0.0
    assert effort_heard(effort_said(value, value)) == 0.0
    assert motion_heard(motion_said(FURTHEST)) == effort_heard(effort_said(STRONGEST, 0.0)) == 0.0


@given(st.floats(0.0, 1e4), st.floats(0.0, 10.0))
def test_credit_is_rounded_down_and_goes_on_round_the_circle(before: float, more: float) -> None:
    new = apart(credit_said(before + more), credit_said(before)) * ENERGY_QUANTUM
    assert new == pytest.approx(more, abs=2e-11)
    total = credit_said(more) * ENERGY_QUANTUM
    assert more - ENERGY_QUANTUM < total <= more


def assert_kept(run: Run) -> None:
    """The books close, and no more credit was taken than sent: none under way is negative."""
    found = books(run)
    assert found.residual < 1e-9 * found.gross_flow + 1e-10
    assert found.element_residual < 1e-10
    assert run["a.credits.stored"].min() > -1e-15


@pytest.mark.parametrize("law", PAIRS)
def test_books_close_and_simulated_is_live(law: str) -> None:
    scaled = {"position_scale": 2.0, "force_scale": 3.0, "sign": -1}
    run = assert_equal(rig_of(data(law, {}, BAD, **scaled)), "python")
    assert_kept(run)
    assert run["slave.a.link_lost"][-1] > 20.0
    assert run["a.credits.stored"].max() > 0.0
    assert books(run).gross_flow > 1e-3


@pytest.mark.nightly
@pytest.mark.slow  # each compiles for half a minute: one bare law, and the fullest in an account
@pytest.mark.parametrize(
    ("law", "account"),
    [("position", None), ("four_channel", {"kept": 0.05, "tank": 1.0, "reserve": 0.01})],
)
def test_compiled_is_live(law: str, account: Any) -> None:
    assert_equal(rig_of(data(law, account, BAD)), "compiled")


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.data())
def test_books_close_whatever_the_network_is(drawn: st.DataObject) -> None:
    def among(*values: Any) -> Any:
        return drawn.draw(st.sampled_from(values))

    keys = {
        "delay_s": among(0.0, 0.001, 0.05),
        "jitter_s": among(0.0, 0.01),
        "jitter": among("uniform", "exponential", "spikes"),
        "loss": among(0.0, 0.1, 0.5),
        "burst": among(1, 4, 20),
        "duplicate": among(0.0, 0.2),
        "reorder": among(True, False),
        "outage_at_s": 0.1,
        "outage_s": among(0.0, 0.1),
        "seed": drawn.draw(st.integers(0, 99)),
    }
    found = data(among(*PAIRS), {"leader": among("master", "slave")}, keys)
    found["simulation"]["faults"] = {
        "missing_probability": among(0.0, 0.05),
        "overrun_probability": among(0.0, 0.02),
        "overrun_slots": 3,
    }
    run = run_rig(found, raises=False)
    assert_kept(run)
    rig = rig_of(found)
    for side in ("master", "slave"):
        [claimed] = coupling_verdict(rig).axis_elements(rig, f"{side}.a", command_delays(rig), 0.0)
        assert run[f"{side}.a.port_energy"].min() >= -float(claimed.numbers["seen_j"])


def test_a_network_that_only_delays_is_a_line_of_a_slot_more() -> None:
    """What leaves now arrives in the next slot at the earliest."""
    over_link = run_rig(data("position", None, {"delay_s": 0.004}))
    line = data("position", None, {})
    del line["link"]
    line["coupling"]["delay_s"] = 0.004
    over_line = run_rig(line)
    for column in ("slave.a.position", "master.a.port_effort", "a.coupler.dissipated"):
        assert over_link[column] == pytest.approx(over_line[column], rel=1e-6, abs=1e-9)


def test_a_network_is_drawn_from_its_seed_from_the_first_packet_on() -> None:
    first, again, other = (
        run_rig(data("position", None, {**BAD, "seed": seed}))["slave.a.link_silence"]
        for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert np.ptp(first - other) > 0.0


def test_a_far_side_that_is_silent_stands_and_one_that_stays_away_stops_the_run() -> None:
    silent = {"delay_s": 0.001, "silence_s": 0.02, "outage_at_s": 0.1, "outage_s": 1.0}
    held = run_rig(data("position", None, {**silent, "lost_s": 0.5, "depth_s": 0.0}))
    late = held["slave.a.link_silence"] > 0.021
    assert held["slave.a.link_silence"][-1] > 0.15
    damped = held["slave.a.port_effort"] - 5.0 * held["slave.a.velocity"]
    far = held["slave.a.position"] - damped / 400.0
    assert np.ptp(far[late]) < 1e-9
    assert np.ptp(far[~late]) > 1e-2
    lost = run_rig(data("position", {}, {**silent, "lost_s": 0.05, "depth_s": 0.0}), raises=False)
    assert "nothing was received from it for 0.051 s" in str(lost.result.error)


def test_bare_over_a_network_nothing_is_certified() -> None:
    """Without a delay of its own it would be a wall on the relative motion, and pass."""
    rig = rig_of(data("position", None, {"delay_s": 0.0}))
    [found] = coupling_verdict(rig).pair_elements(rig, "a", command_delays(rig))
    assert not found.passive.passed
    assert "over a network its delay is not known" in found.passive.reason


def test_two_sites_without_an_account_are_refused() -> None:
    found = data("position", None, BAD)
    found["sites"] = {"serves": "slave", "slave": {"address": "127.0.0.1"}}
    with pytest.raises(
        ConfigError, match="law position without an account runs in one process only"
    ):
        rig_of(found)
