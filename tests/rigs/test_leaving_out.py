"""What a rig does not need changes nothing when it is there and does nothing."""

from __future__ import annotations

import numpy as np
import pytest

from tests.rigs.closing import CONTACT, FRICTION, MISHAPS, MOTION, SENSORS, delay, line
from tests.rigs.running import Run, Tree, run_rig, tree

BUSY = tree(
    MOTION,
    CONTACT,
    FRICTION,
    SENSORS,
    MISHAPS,
    line(7),
    {"duration_s": 1.0, "loop.missing_limit": 20},
)
INERT_WALL = {"position": 50.0, "stiffness": 500.0, "damping": 3.0}
SECOND = {
    f"{side}.axes.c": {
        "bus": bus, "id": 9, "kind": "linear", "effort_limit": 5.0, "encoder_quantum": 1e-5,
        "velocity_limit": 20.0,
        "inertia": {"value": 0.2, "lower": 0.2, "source": "x"}, "position_noise": 1e-5,
    }
    for side, bus in (("master", "hand"), ("slave", "arm"))
} | {"coupling.pairs.c": {"wave_impedance": 3.0}}  # fmt: skip


def assert_same_rows(one: Run, other: Run) -> None:
    """All columns that both have, row by row, to the bit (NaN equals NaN)."""
    shared = [name for name in one.columns if name in other.columns]
    assert len(shared) >= min(len(one.columns), len(other.columns)) - 3
    for name in shared:
        assert np.array_equal(one[name], other[name], equal_nan=True), name


@pytest.mark.sparse(3)
@pytest.mark.parametrize(
    "extra",
    [
        {"coupling.pairs.a.wall_master": INERT_WALL, "coupling.pairs.a.wall_slave": INERT_WALL},
        {"coupling.pairs.a.wall_slave": {**INERT_WALL, "position": -50.0, "side": "below"}},
        {"coupling.pairs.a.wall_slave": {**INERT_WALL, "passivity_control": True}},
        {"coupling.pairs.a.position_scale": 1.0, "coupling.pairs.a.force_scale": 1.0},
        {"master.axes.a.effort_rate_limit": 1e12},
        {"slave.axes.a.position_range": [-100.0, 100.0]},
        {"coupling.pairs.a.engage_tolerance": 1.0},
        SECOND,
    ],
    ids=["walls", "below", "controlled", "scale", "rate", "guards", "tolerance", "second axis"],
)
def test_present_and_inert_is_absent(extra: Tree) -> None:
    plain = run_rig(BUSY)
    assert_same_rows(plain, run_rig(tree(extra, base=BUSY)))


def test_a_far_wall_of_the_environment_is_free_space() -> None:
    free = tree({"simulation.environment.a": {"type": "free"}}, base=BUSY)
    far = {"type": "wall", "stiffness": 3000.0, "position": 40.0}
    assert_same_rows(run_rig(free), run_rig(tree({"simulation.environment.a": far}, base=free)))


def test_a_scale_that_is_there_does_something() -> None:
    """The comparison can fail."""
    other = run_rig(tree({"coupling.pairs.a.position_scale": 1.5}, base=BUSY))
    assert not np.array_equal(run_rig(BUSY)["slave.a.position"], other["slave.a.position"])


def test_the_order_of_buses_changes_no_bit() -> None:
    turned = tree(base=BUSY)
    turned["buses"] = dict(reversed(list(BUSY["buses"].items())))
    assert_same_rows(run_rig(BUSY), run_rig(turned))


def test_the_order_of_pairs_changes_no_bit() -> None:
    both = tree(SECOND, base=BUSY)
    turned = tree(base=both)
    turned["coupling"]["pairs"] = dict(reversed(list(both["coupling"]["pairs"].items())))
    assert_same_rows(run_rig(both), run_rig(turned))


def test_two_runs_of_a_rig_are_equal_and_another_seed_is_not() -> None:
    first = run_rig(BUSY)
    assert_same_rows(first, run_rig(BUSY))
    other = run_rig(tree({"seed": 2}, base=BUSY))
    assert not np.array_equal(first["master.a.position"][:50], other["master.a.position"][:50])


QUIET = tree(SENSORS, {"duration_s": 0.3, "coupling.pairs.a.wave_impedance": 1e-14})


def noise(run: Run, axis: str) -> np.ndarray:
    """Return what is measured on an axis that stands still: noise, on the encoder's grid."""
    assert np.abs(run[f"true.{axis}.position"]).max() < 1e-12
    return run[f"{axis}.position"]


def test_every_axis_has_a_noise_of_its_own() -> None:
    """Leaving out the noise of one axis, or its missing samples, shifts no other's."""
    both = run_rig(QUIET)
    alone = run_rig(tree({"master.axes.a.position_noise": 0.0}, base=QUIET))
    assert np.array_equal(noise(both, "slave.a"), noise(alone, "slave.a"))
    assert not np.array_equal(noise(both, "master.a"), noise(both, "slave.a"))
    missing = {"simulation.faults": {"missing_probability": 0.1}}
    lossy = run_rig(tree(missing, base=QUIET))
    seen = lossy["slave.a.valid"] == 1.0
    assert 0 < np.count_nonzero(~seen) < 100
    assert np.array_equal(noise(both, "slave.a")[seen], noise(lossy, "slave.a")[seen])
    assert not np.array_equal(lossy["slave.a.valid"], lossy["master.a.valid"])


def test_command_delay_is_not_noise() -> None:
    one, two = run_rig(QUIET), run_rig(tree(delay(2), base=QUIET))
    assert np.array_equal(noise(one, "slave.a"), noise(two, "slave.a"))
