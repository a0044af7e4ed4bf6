"""Engaging with a loaded contact: what resists may exceed the engage ramp, what pushes may not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.controller import axis
from tautwave.simulation import Simulation, simulate
from tests.rigs.test_recovery import BEHIND

BENCH = Path(__file__).parents[2] / "configs" / "bench-1dof-2khz.yaml"
LOADED = "simulation.environment.lever={type: spring, stiffness: 8.0, position: 0.1}"
RESTING = "simulation.hand.lever={lever_arm: 0.075, reference: {type: hold, position: 0.0}}"
SHOVING = (
    "simulation.hand.lever={lever_arm: 0.075, reference: {type: multisine, ramp_s: 0.05, "
    "components: [[3.0, 0.3, 0.3], [7.0, 0.1, 1.0]]}}"
)
POSITION = "coupling={law: position, pairs: {lever: {stiffness: 20, damping: 0.07}}}"
RAMP_S, LIMIT = 0.2, 1.125


def engaged(*changes: str, duration_s: float = 0.4) -> Simulation:
    run = simulate(load_rig(BENCH, changes), duration_s=duration_s, engine="python")
    assert run.error is None
    return run


def only_the_ceiling(*given: float) -> float:
    return given[-1]


@pytest.mark.parametrize("impedance", [0.05, 0.1])
def test_a_slave_in_front_of_a_loaded_spring_is_not_thrown(
    impedance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """40 mJ: the hand's grip lets it go to 88 mrad; with the ramp alone it went to 143."""
    changes = (LOADED, RESTING, f"coupling.pairs.lever.wave_impedance={impedance}")
    found = np.max(engaged(*changes)["true.slave.lever.position"])
    assert found < 0.1
    monkeypatch.setattr(axis, "rising_bound", only_the_ceiling)
    assert np.max(engaged(*changes)["true.slave.lever.position"]) > 0.14


@pytest.mark.parametrize(
    "changes",
    [
        (LOADED, SHOVING),
        (*BEHIND, SHOVING),
        (*BEHIND, RESTING),
        (POSITION, LOADED, SHOVING),
        (LOADED, SHOVING, "seed=5", "coupling.delay_s=0.02"),
        (LOADED, SHOVING, "simulation.axes.slave.lever.command_delay_s=0.0005"),
    ],
    ids=["thrown", "behind", "left behind", "spring", "line", "late"],
)
def test_no_push_exceeds_the_ramp(changes: tuple[str, ...]) -> None:
    """Beyond it an effort only grows against the motion in which it acts."""
    run = engaged(*changes)
    share = np.minimum(1.0, (np.arange(len(run)) + 1) / (RAMP_S * 2000.0))
    exceeded = 0
    for side in ("master", "slave"):
        sent = run[f"{side}.lever.commanded"]
        at = run[f"true.{side}.lever.position"]
        beyond = np.abs(sent) > share * LIMIT + 1e-9
        grew = np.abs(sent) > np.abs(np.roll(sent, 1)) + 1e-9
        work = sent[:-1] * np.diff(at)
        found = work[(beyond & grew)[:-1]]
        exceeded += len(found)
        # What noise makes of a prediction: of a period, some uJ at most.
        assert np.all(found < 5e-6)
        assert np.sum(found) <= 0.0
        assert np.max(np.abs(sent)) <= LIMIT
    if POSITION in changes:  # its proof rests on ends that are clipped alike
        assert exceeded == 0
    elif LOADED in changes:
        assert exceeded > 0
