"""Rigs with slow buses: live equals offline, to the bit."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tautwave.config import load_rig
from tautwave.errors import SafetyStop
from tautwave.simulation import simulate
from tests.rigs.running import Tree, rig_of, tree
from tests.simulation.family import any_rigs
from tests.simulation.live import CONFIGS, assert_equal, assert_same, live_run

pytest.importorskip("numba")

SWING: Tree = {
    "simulation.hand.a": {
        "reference": {"type": "minimum_jerk", "waypoints": [[0.1, 0.0], [0.4, 0.05], [0.8, 0.0]]}
    },
    "simulation.environment.a": {"type": "wall", "stiffness": 2000.0, "position": 0.02},
    "coupling.delay_s": 0.004,
}


@st.composite
def slow_rigs(draw: st.DrawFn) -> Tree:
    """Rigs of every kind with the wave law, of which one bus or both have a divisor."""
    data = draw(any_rigs().filter(lambda rig: rig["coupling"].get("law") != "position"))
    ratios = st.one_of(st.integers(1, 6), st.integers(1, 50))
    for bus in ("hand", "arm"):
        data["buses"][bus]["divisor"] = draw(ratios)
    nyquist = 500.0 / data["buses"]["hand"]["divisor"]
    for hand in data["simulation"]["hand"].values():
        for component in hand["reference"]["components"]:
            component[0] = min(component[0], 0.9 * nyquist)
    slowest = 500.0 / max(data["buses"][bus]["divisor"] for bus in ("hand", "arm"))
    for pair in data["coupling"]["pairs"].values():
        if isinstance(pair.get("wave_filter_hz"), float):
            pair["wave_filter_hz"] = min(pair["wave_filter_hz"], 0.9 * slowest)
    return data


@pytest.mark.slow
@settings(max_examples=60, suppress_health_check=list(HealthCheck))
@given(slow_rigs())
@pytest.mark.nightly
def test_slow_rigs_of_every_kind(data: Tree) -> None:
    rig = rig_of(data)
    live = live_run(rig)
    error = live.result.error
    for engine in ("compiled",):
        if isinstance(error, SafetyStop) and "engage_tolerance" in str(error):
            with pytest.raises(SafetyStop) as caught:
                simulate(rig, engine=engine)
            assert str(caught.value) == str(error)
        else:
            assert_same(live, simulate(rig, engine=engine))


@pytest.mark.sparse(5)
@pytest.mark.parametrize("divisor", [2, 3, 10, 50])
@pytest.mark.parametrize("slots", [1, 2, 3, 7, 24, 30])
def test_overruns_of_any_length_meet_any_phase(divisor: int, slots: int) -> None:
    """Late requests, skipped answers, exchanges left out: each where the live loop has it."""
    faults = {"overrun_probability": 0.1, "overrun_slots": slots, "missing_probability": 0.1}
    limits = {"missing_limit": 1000, "overrun_limit": 1000}
    changes = {"simulation.faults": faults, "loop": limits, "buses.arm.divisor": divisor}
    live = assert_equal(rig_of(tree(SWING, changes)), "compiled", "python")
    assert live.result.missed_cycles > 50


def test_missing_samples_end_a_slow_run_with_the_same_sentence() -> None:
    changes = {
        "simulation.faults": {"missing_probability": 0.5},
        "loop.missing_limit": 3,
        "buses.arm.divisor": 10,
        "coupling.release_ramp_s": 0.05,
    }
    live = assert_equal(rig_of(tree(SWING, changes)), "compiled", "python")
    assert "in 3 " in str(live.result.error)


def test_the_shipped_multirate_rig_knocks_as_live() -> None:
    [path] = [path for path in CONFIGS if path.stem == "bench-multirate-loopback"]
    assert_equal(load_rig(path), "compiled", duration_s=5.0)
