"""`identify RIG --load`: masses and centres of an arm, the load of one axis, from slow motion."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from tautwave.analysis.identification.load_model import fit_weights, moved
from tautwave.cli import main
from tautwave.config import Rig, load_rig
from tautwave.config.inputs.chains import chain_constants, chain_links
from tautwave.models.chain.build import Body, Link
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames
from tautwave.rig.arms import joint_ranges, postures
from tautwave.session.identification.weighing import (
    SlowMotion,
    bodies_of,
    identify_load,
)

CONFIGS = Path(__file__).parents[2] / "configs"
ONE = CONFIGS / "bench-1dof-loopback.yaml"
ARMS = CONFIGS / "arms-loopback.yaml"


def slow_motion(seconds: float, noise: float) -> tuple[Any, Any]:
    """Return position and effort of one joint that carries 0.2 - 0.5 cos x + 0.3 sin x."""
    time = np.arange(int(seconds * 1000)) * 1e-3
    x = 0.8 * np.sin(2 * np.pi * 0.2 * time) + 0.2 * np.sin(2 * np.pi * 0.46 * time)
    v = np.gradient(x, 1e-3)
    effort = 0.05 * np.gradient(v, 1e-3) + 0.06 * v + 0.1 * np.sign(v)
    effort -= 0.2 - 0.5 * np.cos(x) + 0.3 * np.sin(x)
    rng = np.random.default_rng(1)
    return np.round((x + noise * rng.normal(size=len(x))) / 1e-5) * 1e-5, effort


def test_constant_and_sine_of_one_joint_are_found_with_its_friction() -> None:
    position, effort = slow_motion(12.0, 2e-5)
    joint = moved(position, effort, np.ones(len(position), dtype=bool), 1e-3, 0.0, 4.0)
    every = np.flatnonzero(joint.rows > 0.5)
    x = joint.position[every]
    parts = -np.stack([np.ones_like(x), np.cos(x), np.sin(x)], axis=1)
    fit = fit_weights([joint], every, np.zeros((len(x), 1)), parts[:, None, :], [1.0] * 3)
    for estimate, true in zip(fit.found, (0.2, -0.5, 0.3), strict=True):
        assert estimate.value == pytest.approx(true, abs=5e-3)
        assert estimate.lower < estimate.value < estimate.upper
    assert fit.coulomb[0].value == pytest.approx(0.1, abs=2e-3)
    assert fit.damping[0].value == pytest.approx(0.06, abs=4e-3)
    assert fit.after[0] < 0.02 * fit.before[0]


def test_what_the_motion_does_not_tell_stays_as_believed() -> None:
    position, effort = slow_motion(12.0, 2e-5)
    joint = moved(position, effort, np.ones(len(position), dtype=bool), 1e-3, 0.0, 4.0)
    every = np.flatnonzero(joint.rows > 0.5)
    x = joint.position[every]
    same = np.stack([-np.cos(x), -np.cos(x), np.zeros_like(x)], axis=1)
    fit = fit_weights([joint], every, np.zeros((len(x), 1)), same[:, None, :], [1.0, 0.1, 0.3])
    first, second, none = fit.found
    assert first.value / second.value == pytest.approx(100.0, rel=1e-4)  # by what each may change
    assert none.value == pytest.approx(0.0, abs=1e-9)
    assert none.upper == pytest.approx(1.96 * 0.3, rel=1e-3)


def test_a_joint_that_stands_is_refused() -> None:
    position, effort = slow_motion(3.0, 2e-5)
    known = np.ones(len(position), dtype=bool)
    with pytest.raises(ValueError, match="it hardly moved"):
        moved(0.0 * position, effort, known, 1e-3, 0.0, 4.0)
    with pytest.raises(ValueError, match="too short"):
        moved(position[:50], effort[:50], known[:50], 1e-3, 0.0, 4.0)


def test_slow_motion_stays_in_the_room_that_there_is() -> None:
    rig = load_rig(ONE)
    for start in (0.0, 0.3):
        mover = SlowMotion(rig, "slave.lever", 0, 5.0, 0.4)
        mover.start(start)
        places = []
        for _ in range(5000):
            mover.pass_slots(1)
            places.append(mover.far(0.0, 0.0))
        assert max(places) <= 0.5
        assert max(places) - min(places) > 0.2


def test_the_body_behind_a_joint_is_its_own_or_that_which_is_fixed_to_it() -> None:
    heavy = Body(1.0)
    links = (
        Link("a", "turns"),
        Link("", "fixed", body=heavy),
        Link("b", "turns", body=heavy),
        Link("tool", "fixed", body=heavy),
    )
    assert bodies_of(links) == [1, 2]


def identify(rig: Rig, out: Path, axis: str | None, seconds: float) -> Any:
    return identify_load(
        rig, axis=axis, out=out, duration_s=seconds, reach=None, clock="fake",
        allow_uncertified=False, simulate=(), attach=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("believed", [True, False])
def test_the_load_of_one_axis_is_found_whether_a_part_is_carried_or_not(
    tmp_path: Path, believed: bool
) -> None:
    more = ["simulation.axes.slave.lever.load={constant: 0.05, cosine: -0.2, sine: 0.1}"]
    more += ["slave.axes.lever.load={cosine: -0.15}"] if believed else []
    result = identify(load_rig(ONE, more), tmp_path / "out", "slave.lever", 12.0)
    x = np.linspace(-0.2, 0.2, 9)
    constant, cosine, sine = (weight.estimate.value for weight in result.weights)
    wrong = constant - 0.05 + (cosine + 0.2) * np.cos(x) + (sine - 0.1) * np.sin(x)
    assert np.abs(wrong).max() < 4e-3
    assert result.snippet.startswith("load: {constant: ")
    assert json.loads((tmp_path / "out/identification.json").read_text())["kind"] == "load"


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(600)
def test_an_arm_is_weighed_by_its_own_servos(tmp_path: Path) -> None:
    """Encoder step and noise of the rig; belief 30 % too light, its centres 20 % too near."""
    truth = load_rig(ARMS)
    arm = truth.slave.arm
    assert arm is not None
    assert arm.dh is not None
    light = tuple(
        row.model_copy(
            update={"mass": 0.7 * row.mass, "centre": tuple(0.8 * c for c in row.centre)}
        )
        for row in arm.dh
    )
    slave = truth.slave.model_copy(update={"arm": arm.model_copy(update={"dh": light})})
    rig = truth.model_copy(update={"slave": slave})
    result = identify(rig, tmp_path / "out", "slave.waist", 14.0)
    found = []
    for number, row in enumerate(light):
        mass, *centre = (w.estimate.value for w in result.weights[4 * number : 4 * number + 4])
        found.append(row.model_copy(update={"mass": max(mass, 0.0), "centre": tuple(centre)}))
    chains = [
        chain_constants(keys)
        for keys in (arm, slave.arm, arm.model_copy(update={"dh": tuple(found)}))
    ]
    before, after = [], []
    for q in list(postures(joint_ranges(truth, truth.arms("slave")[0])))[-300:]:
        narrow = [0.5 * at for at in q]
        weights = []
        for chain in chains:
            weight = [0.0] * 6
            chain_gravity(chain, chain_frames(chain, narrow), weight)
            weights.append(np.array(weight))
        before.append(np.abs(weights[1] - weights[0]))
        after.append(np.abs(weights[2] - weights[0]))
    assert np.max(before, axis=0)[1] > 0.5  # N m at the shoulder
    assert np.max(after) < 0.1
    assert np.mean(after, axis=0)[1] < 0.03 * np.mean(before, axis=0)[1]
    assert [link.kind for link in chain_links(arm)[0]].count("turns") == 6


def test_the_command_refuses_what_it_cannot_weigh(tmp_path: Path) -> None:
    runner = CliRunner()
    for arguments, said in (
        ((str(ONE), "--load"), "choose an axis, or one of an arm's, with --axis"),
        ((str(ONE), "--load", "--axis", "slave.lift"), "there is no axis 'slave.lift'"),
        ((str(ONE), "--load", "--share", "0.2"), "--share cannot be combined with --load"),
        ((str(ONE), "--load", "--noise"), "--load cannot be combined with --noise"),
        (
            (str(CONFIGS / "bench-admittance-loopback.yaml"), "--load", "--axis", "slave.lever"),
            "slave.lever is an admittance axis: its drive compensates for the load itself",
        ),
    ):
        found = runner.invoke(main, ["identify", *arguments, "--out", str(tmp_path / "out")])
        assert found.exit_code != 0
        assert said in found.output + str(found.exception)


@pytest.mark.slow
def test_the_command_shows_what_it_found(tmp_path: Path) -> None:
    arguments = ["identify", str(ONE), "--load", "--axis", "slave.lever", "--clock", "fake"]
    arguments += ["--set", "slave.axes.lever.load.constant=-0.05", "--duration", "8"]
    found = CliRunner().invoke(main, [*arguments, "--out", str(tmp_path / "out")])
    assert found.exit_code == 0, found.output
    for word in ("constant", "effort left, rms", "believed", "load: {constant: -0.0"):
        assert word in found.output
