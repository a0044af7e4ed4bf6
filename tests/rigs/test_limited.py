"""The column `limited`: why less is sent than asked for, the same live and simulated."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave import load_rig, simulate
from tautwave.laws.limit import (
    AT_LIMIT,
    CLIPPED,
    RAMPED,
    RATE_LIMITED,
    STALL_BOUND,
    STEPPED,
    STOPPED,
)
from tests.rigs.row_hashes import ROOT
from tests.rigs.running import BASE, Tree, rig_of, run_rig, tree
from tests.simulation.live import assert_equal

PULLED = tree(
    {
        "duration_s": 0.6,
        "coupling.law": "position",
        "coupling.pairs.a": {"stiffness": 100.0, "damping": 2.0},
        "simulation.hand": {
            "a": {
                "mass": 0.1,
                "damping": 5.0,
                "stiffness": 500.0,
                "reference": {"type": "minimum_jerk", "waypoints": [[0.05, 0.0], [0.3, 0.1]]},
            }
        },
    },
    base=BASE,
)
"""A hand that pulls an axis by a spring: some newtons."""


@pytest.mark.parametrize(
    ("change", "bit"),
    [
        ({"master.axes.a.effort_limit": 0.5}, AT_LIMIT + CLIPPED),
        ({"slave.axes.a.effort_limit": 0.5}, CLIPPED),
        ({"master.axes.a.effort_rate_limit": 20.0}, RATE_LIMITED),
        ({"master.axes.a.effort_quantum": 0.1}, STEPPED),
        ({"coupling.engage_ramp_s": 5.0, "master.axes.a.effort_limit": 20.0}, RAMPED),
    ],
    ids=["limit", "far limit", "rate", "steps", "ramp"],
)
def test_each_limit_shows_in_the_rows_of_either_engine(change: Tree, bit: int) -> None:
    free = assert_equal(rig_of(PULLED), "python")
    assert not free["master.a.limited"].any()
    run = assert_equal(rig_of(tree(change, base=PULLED)), "python")
    of_master = run["master.a.limited"]
    assert set(np.unique(of_master)) == {0.0, float(bit)}
    clipped = bit & CLIPPED
    assert bool(run["slave.a.limited"].any()) == (bit in (CLIPPED, AT_LIMIT + CLIPPED, RAMPED))
    if clipped:
        assert (np.abs(run["master.a.commanded"][of_master == bit]) == 0.5).all()


def test_the_bound_for_stalls_shows() -> None:
    """A hundredth of the kinetic energy at the velocity limit leaves a tenth of the effort."""
    path = ROOT / "configs/bench-1dof-2khz.yaml"
    sides = [f"{side}.axes.lever.stall_energy_j=0.002" for side in ("master", "slave")]
    run = assert_equal(load_rig(path, sides), "python", duration_s=1.0)
    cut = run["master.lever.limited"] == STALL_BOUND
    assert 0.01 < cut.mean() < 1.0
    free = assert_equal(load_rig(path), "python", duration_s=1.0)
    assert not (free["master.lever.limited"] >= STALL_BOUND).any()
    efforts = [np.abs(one["master.lever.commanded"]).max() for one in (run, free)]
    assert efforts[0] < efforts[1]


@pytest.mark.slow
def test_the_bound_for_stalls_is_the_same_compiled() -> None:
    sides = [f"{side}.axes.lever.stall_energy_j=0.002" for side in ("master", "slave")]
    rig = load_rig(ROOT / "configs/bench-1dof-2khz.yaml", sides)
    plain, compiled = (simulate(rig, duration_s=1.0, engine=way) for way in ("python", "compiled"))
    assert (plain["master.lever.limited"] == STALL_BOUND).any()
    for column in ("commanded", "limited", "position"):
        assert (compiled[f"master.lever.{column}"] == plain[f"master.lever.{column}"]).all()


def test_a_velocity_that_is_cut_shows_too() -> None:
    """The drive of the shipped rig, with a velocity limit that its motion passes."""
    path = ROOT / "configs/bench-admittance-loopback.yaml"
    rig = load_rig(path, ["slave.axes.lever.velocity_limit=0.2"])
    run = assert_equal(rig, "python", duration_s=1.0)
    cut = run["slave.lever.limited"] == AT_LIMIT
    assert cut.any()
    assert np.abs(run["slave.lever.commanded"][cut]) == pytest.approx(0.2, rel=1e-12)
    ramped = run["slave.lever.limited"] == AT_LIMIT + RAMPED  # the other axis stops
    assert ramped.any()
    assert (np.abs(run["slave.lever.commanded"][ramped]) < 0.2).all()


def test_a_stop_acts_in_place_of_coupling_and_wall() -> None:
    """The hand carries the axis out of its range."""
    change = {"master.axes.a.position_range": [-1.0, 0.05], "master.axes.a.effort_limit": 0.5}
    change["coupling.release_ramp_s"] = 0.05
    rig = rig_of(tree(change, base=PULLED))
    run = run_rig(rig, raises=False)
    out = int(np.flatnonzero(run["master.a.position"] > 0.05)[0])
    assert set(run["master.a.limited"][out - 5 : out]) == {AT_LIMIT + CLIPPED}
    assert set(run["master.a.limited"][out:]) == {STOPPED}
    assert set(run["slave.a.limited"][out + 1 :]) == {STOPPED}
