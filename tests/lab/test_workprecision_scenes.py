"""Work-precision of the shipped scenes: what is measured is right, in plain Python."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from tautwave_scenes.bench import precision as scenes
from tautwave_scenes.bench.precision import Stage, refined
from tautwave_scenes.networks.network import String
from tautwave_scenes.simulation.playing import Played
from tests.lab.peers import network as peers_network
from tests.lab.workprecision.scenes import DRUM, GRANULAR, NET, RESONATOR, STRING


def stage_of(scene: scenes.SceneRig, begin_s: float, span_s: float) -> Stage:
    return Stage(scene._replace(begin_s=begin_s, span_s=span_s), engine="python")


def played(stage: Stage, scheme: str, factor: int) -> Played:
    found = stage.run(scheme, Fraction(factor))
    assert found is not None
    return found


@pytest.fixture(scope="module")
def resonator() -> tuple[Stage, Played]:
    stage = stage_of(RESONATOR, 0.2, 0.02)
    return stage, played(stage, "exact", 64)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "low", "high"),
    [("exact", 1.8, 2.2), ("discrete_gradient", 1.7, 2.3), ("symplectic", 0.8, 2.3)],
)
def test_schemes_converge_to_one_truth(
    resonator: tuple[Stage, Played], scheme: str, low: float, high: float
) -> None:
    stage, oracle = resonator
    errors = [stage.error(played(stage, scheme, f).places, oracle) for f in (2, 4, 8)]
    assert errors[-1] < 2e-4
    for coarse, fine in pairwise(errors):
        assert low < math.log2(coarse / fine) < high


@pytest.mark.slow
def test_steps_longer_than_the_rigs_are_compared_where_they_end(
    resonator: tuple[Stage, Played],
) -> None:
    stage, oracle = resonator
    half = stage.run("exact", Fraction(1, 2))
    assert half is not None
    assert len(half.places) == stage.slots // 2
    assert stage.error(half.places, oracle) < 1e-2
    assert stage.error(oracle.places, oracle) == 1e-17
    assert math.isinf(stage.error(half.places * math.inf, oracle))


def test_only_held_forces_make_energy(resonator: tuple[Stage, Played]) -> None:
    stage, oracle = resonator
    for scheme in ("exact", "discrete_gradient"):
        assert stage.energy_error(played(stage, scheme, 1), oracle) < 1e-12
    made = [stage.energy_error(played(stage, "symplectic", f), oracle) for f in (1, 4)]
    assert made[0] > 1e-4
    assert made[0] / made[1] == pytest.approx(4.0, rel=0.2)


@pytest.mark.slow
@pytest.mark.parametrize(("scene", "begin_s"), [(GRANULAR, 0.0), (DRUM, 0.138)])
def test_scipy_s_equations_are_those_of_the_steps(scene: scenes.SceneRig, begin_s: float) -> None:
    pytest.importorskip("scipy")
    stage = stage_of(scene, begin_s, 0.012)
    oracle = played(stage, "discrete_gradient", 8)
    assert np.abs(oracle.efforts).max() > (0.1 if scene is DRUM else -1.0)  # it was touched
    own = stage.error(played(stage, "discrete_gradient", 1).places, oracle)
    found = list(peers_network.scipy_network(stage, oracle, (1e-6,)))
    assert {point.method for point in found} == {"scipy DOP853", "scipy Radau"}
    assert all(point.peer and point.error < max(own, 1e-5) for point in found)


def test_a_string_s_samples_stay_whole_and_its_pitch_the_same() -> None:
    string = String("s", 0.4, 6, 48, 1.0, 0.5)
    finer = refined(string, Fraction(4))
    assert finer is not None
    samples = 2 * (string.near + string.far) + 4
    assert 2 * (finer.near + finer.far) + 4 == 4 * samples
    assert (1.0 - finer.smoothing) ** 4 == pytest.approx(1.0 - string.smoothing)
    assert refined(string, Fraction(1, 2)) is None  # 7 samples have no half
    stage = stage_of(STRING, 0.0, 0.005)
    assert stage.run("discrete_gradient", Fraction(1, 2)) is None
    assert list(peers_network.scipy_network(stage, played(stage, "discrete_gradient", 1), ())) == []


@pytest.mark.slow
def test_a_scene_in_space_is_run_at_any_step(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(scenes, "FINEST_IN_SPACE", 8)
    stage = stage_of(NET, 0.1, 0.008)
    oracle = played(stage, "discrete_gradient", 8)
    errors = [stage.error(played(stage, "symplectic", f).places, oracle) for f in (1, 2, 4)]
    assert 0.0 < errors[2] < errors[1] < errors[0] < 0.1
    assert stage.run("symplectic", Fraction(16)) is None  # finer than the oracle
    assert stage.energy_error(oracle, oracle) < 1e-12
    assert list(peers_network.scipy_network(stage, oracle, (1e-3,))) == []
    points = list(scenes.scheme_points(stage, oracle, (Fraction(1),), 0))
    assert [point.method for point in points] == [
        *("discrete_gradient", "linearly_implicit", "symplectic_euler")
    ]
    assert points[0].error < points[2].error


def test_a_scene_is_named_with_what_its_rig_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    made = Stage.__init__
    monkeypatch.setattr(Stage, "__init__", lambda s, scene: made(s, scene, "python"))
    monkeypatch.setattr(scenes, "FINEST", 8)
    monkeypatch.setattr(scenes, "FACTORS", {False: (Fraction(1, 2), Fraction(1), Fraction(2))})
    short = RESONATOR._replace(begin_s=0.21, span_s=0.01)
    scene = scenes.network_scene(short, False, 1e-4, 1)
    assert {point.method for point in scene.points} == {
        *("exact", "discrete_gradient", "symplectic_euler", "rk4")
    }
    assert scene.chosen is not None
    assert scene.chosen.step_s == 1e-4
    assert "exact at 10000 Hz is what the rig runs" in scene.why
    assert "auto takes exact: springs and dampers only" in scene.why
    assert scene.label == "auto at 10 kHz"
    assert all(point.cpu_s > 0.0 for point in scene.points)
