"""Friction taken off by the motor: by its share, never more than the device has, never twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.certificate import certify
from tautwave.config import Rig
from tautwave.laws.compensation import CompensationParams, compensation_effort
from tautwave.simulation import simulate
from tests.lab.compensation import CERTAIN, ROUNDING, free_motion, surplus
from tests.lab.port.rigs import IMPOSED
from tests.rigs.running import Tree, rig_of, tree

SLOW = {"type": "multisine", "ramp_s": 0.05, "components": [[0.5, 0.2, 0.0]]}
FRICTION = {"value": 0.025, "lower": 0.02, "source": "test"}


def lever(**more: object) -> Tree:
    return {
        "bus": "bench",
        "id": 1,
        "kind": "rotary",
        "inertia": {"value": 1.5e-3, "lower": 1.1e-3, "source": "test"},
        "damping": 1e-3,
        "coulomb": FRICTION,
        "effort_limit": 1.0,
        "effort_rate_limit": 1000.0,
        "velocity_limit": 20.0,
        **more,
    }


def rig(seconds: float = 0.5, wall: Tree | None = None, **compensation: float) -> Rig:
    axis = lever(compensation=compensation) if compensation else lever()
    keys = dict(part.split(": ") for part in IMPOSED.split(", "))
    pair: Tree = {"stiffness": 20.0, "damping": 0.1}
    if wall is not None:
        pair["wall_master"] = wall
    return rig_of(
        tree(
            {
                "rate_hz": 1000.0,
                "duration_s": seconds,
                "buses": {"bench": {"driver": "loopback"}},
                "master": {"axes": {"lever": axis}},
                "slave": {"axes": {"lever": {**axis, "id": 2}}},
                "coupling.law": "position",
                "coupling.pairs": {"lever": pair},
                "simulation.hand": {
                    "lever": {"reference": SLOW, **{k: float(v) for k, v in keys.items()}}
                },
            }
        )
    )


def moving(built: Rig) -> tuple[float, float]:
    """Mean error in steady motion [rad], and what the compensations gave [J]."""
    run = simulate(built, engine="python")
    at = {name: run.data[:, place] for place, name in enumerate(run.columns)}
    assert run.error is None
    given = [column[-1] for name, column in at.items() if "compensation" in name and
             name.endswith("absorbed")]  # fmt: skip
    return float(np.mean(at["lever.position_error"][200:400])), -sum(given)


def test_the_error_of_free_motion_falls_by_the_share_that_is_taken_off() -> None:
    """F = c of the slave on the spring: 80 % of 20 mN m of 25 mN m, inertia and viscosity apart."""
    bare, _ = moving(rig())
    less, given = moving(rig(coulomb=0.8))
    assert 20.0 * (bare - less) == pytest.approx(0.016, rel=0.05)
    assert given > 0.0


def test_the_devices_friction_takes_all_that_the_motors_gave() -> None:
    run = simulate(rig(coulomb=1.0, viscous=1.0), engine="python")
    at = {name: run.data[:, place] for place, name in enumerate(run.columns)}
    for side in ("master", "slave"):
        given = -at[f"lever.compensation_{side}.absorbed"]
        lost = at[f"plant.{side}.lever.coulomb_loss"] + at[f"plant.{side}.lever.viscous_loss"]
        assert np.all(given <= lost + 1e-9)
        assert given[-1] > 0.5 * lost[-1]


@settings(deadline=None)
@given(
    st.lists(st.floats(-20.0, 20.0), min_size=5, max_size=60),
    st.integers(0, 3),
    st.floats(0.01, 1.0),
)
def test_no_motion_delay_or_filter_gets_more_than_the_friction_takes(
    velocities: list[float], late: int, gain: float
) -> None:
    """Motion of piecewise constant velocity: c |path| and b times the sum of squares."""
    p = CompensationParams(coulomb=0.02, viscous=0.05, soft=0.1)
    read, efforts, surplus = 0.0, [0.0] * (late + 1), 0.0
    given = taken = 0.0
    for velocity in velocities:
        given -= efforts[0] * velocity
        taken += 0.02 * abs(velocity) + 0.05 * velocity * velocity
        read += gain * (velocity - read)
        efforts = [*efforts[1:], compensation_effort(p, read)]
        surplus = max(surplus, given - taken)
    assert surplus <= 1e-9


def test_a_bit_more_than_the_friction_makes_energy() -> None:
    p = CompensationParams(coulomb=0.024, viscous=0.0, soft=1e-3)
    given = -compensation_effort(p, 1.0) * 1.0
    assert given > 0.02 * 1.0


def test_what_is_spent_on_it_is_not_there_for_a_wall() -> None:
    """A wall that needs 0.4 of the damping passes beside 0.5 of it, and not beside 0.7."""
    wall = {"position": 0.5, "stiffness": 0.8}
    for share, passes in ((0.5, True), (0.7, False)):
        certificate = certify(rig(wall=wall, viscous=share))
        [found] = [e for e in certificate.elements if e.kind == "wall"]
        assert found.passive.passed is passes
        [spent] = [e for e in certificate.elements if e.axis == "master.lever"
                   and e.kind == "compensation"]  # fmt: skip
        assert spent.numbers["damping"] == pytest.approx([share * 1e-3, 1e-3])


def test_a_truth_with_less_friction_than_believed_is_said() -> None:
    data = rig(coulomb=0.5)
    thin = data.model_copy(
        update={
            "simulation": data.simulation.model_copy(  # type: ignore[union-attr]
                update={
                    "axes": {
                        name: axis.model_copy(update={"coulomb": 1e-3})
                        for name, axis in data.simulation.axes.items()  # type: ignore[union-attr]
                    }
                }
            )
        }
    )
    [found, _] = [e for e in certify(thin).elements if e.kind == "compensation"]
    assert not found.passive.passed
    assert "Coulomb" in found.passive.reason


def test_a_held_effort_within_the_friction_never_has_a_surplus() -> None:
    """Against the plant itself; `python -m tests.lab compensation --runs 10000` tries more."""
    assert max(surplus(seed, 1.0) for seed in range(25)) <= ROUNDING
    assert sum(surplus(seed, 1.2) > ROUNDING for seed in range(25)) >= 5


@pytest.mark.slow
def test_drag_and_error_of_the_bench_fall_by_what_is_stated() -> None:
    bare, less = (free_motion(share, 2.5, "python") for share in (0.0, 0.8))
    stated = 2.0 * 0.8 * CERTAIN
    assert bare.drag - less.drag == pytest.approx(stated, rel=0.02)
    assert bare.error - less.error == pytest.approx(0.5 * stated / 25.4, rel=0.02)
