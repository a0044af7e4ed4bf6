"""Arms whose joints are MIT motors: joined in the simulator, and the ready pair of six joints."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tautwave.certificate.verdict import certify
from tautwave.config import load_rig
from tautwave.rig import command_delays
from tautwave.rig.arms import beyond_file, joint_names
from tautwave.session.claims import claims_of
from tests.arms.openarms import ARMS, pair_of
from tests.arms.openarms import JOINTS as SEVEN
from tests.rigs.running import books, run_rig

RIG = Path(__file__).parents[2] / "configs" / "arms" / "six-mit.yaml"
JOINTS = ("j1", "j2", "j3", "j4", "j5", "j6")


def test_in_a_tenth_of_a_second_all_books_of_the_pair_close() -> None:
    run = run_rig(load_rig(RIG), duration_s=0.1)
    for joint in JOINTS:
        found = books(run, joint)
        assert found.residual < 1e-9 * max(found.gross_flow, 1e-3)
        assert found.plant_residual < 1e-9 * max(found.plant_flow, 1e-3)
    assert np.ptp(run["true.slave.j5.position"]) > 1e-5  # it moves


@pytest.mark.slow
def test_the_joints_of_a_side_are_one_arm() -> None:
    """Its books are an arm's: what the joints gave is in its motion and its height."""
    run = run_rig(load_rig(RIG), duration_s=0.2)
    for side in ("master", "slave"):
        given, kinetic, height = (
            run[f"arm.{side}.{what}"] for what in ("work", "kinetic", "potential")
        )
        assert np.ptp(given) > 1e-6
        assert np.abs(given - kinetic - height).max() < 1e-4 * np.ptp(given) + 1e-7


@pytest.mark.slow
def test_the_pair_is_certified_with_its_wall_and_its_damper() -> None:
    found = certify(load_rig(RIG), brief=True)
    assert found.passed
    (wall,) = (one for one in found.elements if one.kind == "wall")
    # 0.03 N m s/rad alone bear 2 b / 3 T, its command a period late.
    assert wall.numbers["passive_stiffness"] > 3.0 * 2.0 * 0.03 / 3e-3
    assert wall.passive.passed


@pytest.mark.slow
@pytest.mark.nightly
def test_the_follower_goes_where_the_leader_does_and_carries_itself() -> None:
    run = run_rig(load_rig(RIG), duration_s=4.0)
    engaged = run["time_s"] > 1.2
    for joint in JOINTS:
        found = books(run, joint)
        assert found.residual < 1e-9 * max(found.gross_flow, 1e-3)
        assert found.plant_residual < 1e-9 * max(found.plant_flow, 1e-3)
        error = run[f"{joint}.position_error"][engaged]
        if joint != "j5":  # which is held by its wall
            assert np.sqrt(np.mean(error**2)) < 1.5e-3
    assert run["slave.j5.wall_effort"].max() > 0.3
    assert 0.25 < run["true.slave.j5.position"].max() < 0.35
    assert run["slave.j5.damper_least"][-1] > 0.0


OPENARM = RIG.with_name("openarm.yaml")
BIMANUAL = RIG.with_name("openarm-bimanual.yaml")
LEFT = {"tip": "left_hand", "j1": "[-3.49, 1.39]", "j2": "[-3.31, 0.17]"}


def left_arms() -> list[str]:
    """Return what makes the rig one of the left arms."""
    return [
        f"{side}.arm.tip={LEFT['tip']}"
        if key == "tip"
        else f"{side}.axes.{key}.position_range={to}"
        for side in ("master", "slave")
        for key, to in LEFT.items()
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("path", "overrides", "pairs"),
    [
        (OPENARM, [], 1),
        (OPENARM, left_arms(), 1),
        (BIMANUAL, [], 2),
        (BIMANUAL, ["rate_hz=800"], 2),
    ],
    ids=["right", "left", "both", "both at 800 Hz"],
)
def test_openarms_carry_themselves_by_what_their_motors_damp(
    path: Path, overrides: list[str], pairs: int
) -> None:
    rig = load_rig(path, overrides)
    found = certify(rig, brief=True)
    assert found.passed
    loads = {one.axis: one for one in found.elements if one.kind == "load"}
    assert len(loads) == 14 * pairs
    for name, one in loads.items():
        assert one.passive.passed
        assert one.numbers["damping_margin"] > 0.0
        if name.endswith(("j1", "j2")):  # it is not the joint's own that is enough
            assert one.numbers["needed_damping"] > rig.axes[name].damping.lower
    walls = [one.passive.passed for one in found.elements if one.kind == "wall"]
    assert walls == [True] * pairs


@pytest.mark.slow
def test_without_dampers_or_at_the_rate_of_classic_can_openarms_are_refused() -> None:
    rig = load_rig(OPENARM)
    buses = {
        name: bus.model_copy(
            update={
                "options": {
                    **bus.options,
                    "motors": [{**one, "damping": 0.0} for one in bus.options["motors"]],
                }
            }
        )
        for name, bus in rig.buses.items()
    }
    for other in (rig.model_copy(update={"buses": buses}), load_rig(OPENARM, ["rate_hz=400"])):
        found = certify(other, brief=True)
        assert not found.passed
        refused = {one.axis for one in found.elements if not one.passive.passed}
        assert {"master.j1", "slave.j1", "master.j2", "slave.j2"} <= refused


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(900)
def test_an_openarm_follows_another_and_the_wall_is_felt_at_its_elbow() -> None:
    run = run_rig(load_rig(OPENARM), duration_s=3.2)
    engaged = run["time_s"] > 1.2
    for joint in (*JOINTS, "j7"):
        found = books(run, joint)
        assert found.residual < 1e-9 * max(found.gross_flow, 1e-3)
        error = run[f"{joint}.position_error"][engaged]
        if joint != "j4":  # which is held by its wall
            assert np.sqrt(np.mean(error**2)) < 3e-3
        assert np.abs(run[f"slave.{joint}.port_effort"]).max() > 0.01  # all are coupled
    assert run["slave.j4.wall_effort"].max() > 1.0


def test_each_of_four_openarms_is_on_its_own_bus_and_chain() -> None:
    rig = load_rig(BIMANUAL, choose=False)
    arms = [arm for side in ("master", "slave") for arm in rig.arms(side)]
    assert [arm.name for arm in arms] == [
        "master.left", "master.right", "slave.left", "slave.right",
    ]  # fmt: skip
    assert len({rig.axes[name].bus for arm in arms for name in arm.axes}) == len(arms)
    for arm in arms:
        side, _, own = arm.name.partition(".")
        assert not any("position_range" in one for one in beyond_file(rig, arm))
        joints = joint_names(rig, side)
        assert [joints[name] for name in arm.axes] == [f"{own}_{joint}" for joint in SEVEN]


@pytest.mark.slow
def test_the_right_pair_of_four_openarms_does_what_it_does_alone() -> None:
    """To the bit: nothing of the other pair, beside it in one loop, comes into its rows."""
    both, alone = (run_rig(load_rig(path), duration_s=0.1) for path in (BIMANUAL, OPENARM))
    compared = 0
    for name in alone.columns:
        column = re.sub(r"\b(j\d)\b", r"right_\1", name)
        if column == name and name.startswith(("arm.", "load.")):
            column = re.sub("(master|slave)", r"\1.right", name)
        if column != name:
            assert np.array_equal(both[column], alone[name], equal_nan=True), column
            compared += 1
    assert compared > 14 * 20
    assert np.ptp(both["true.slave.left_j4.position"]) > 0.0


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(900)
def test_two_openarms_follow_two_others_and_their_walls_are_felt_at_the_elbows() -> None:
    rig = load_rig(BIMANUAL)
    run = run_rig(rig, duration_s=3.2)
    for arm in ARMS:
        for joint in SEVEN:
            found = books(run, f"{arm}_{joint}")
            assert found.residual < 1e-9 * max(found.gross_flow, 1e-3)
        pair = pair_of(run.__getitem__, rig, arm)
        assert max(pair.rms.values()) < 3e-3
        assert pair.stiffness == pytest.approx(30.0, rel=1e-2)
        assert 0.8 * 30.0 < pair.felt_stiffness < 30.0
        for side in ("master", "slave"):
            assert 0.3 * 10.6 < pair.carried[side] < 10.6
            # What the weight took or gave beyond its own height is little of what it lifted.
            assert run[f"load.{side}.{arm}.given"][-1] < 0.01
    for claim in claims_of(rig, command_delays(rig)):
        assert claim.stated is not None
        given = -run[f"{claim.axis}.port_energy"]
        assert given.max() < claim.stated.prompt_j
