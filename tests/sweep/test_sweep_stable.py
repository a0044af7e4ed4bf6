"""`stable` of a sweep means that a pair comes to rest with its hand."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tautwave.config import load_rig
from tautwave.report.figures.sweep import Curve, stability_sentences
from tautwave.sweep.measure import Scales, is_stable, measure_run, rest_of, scales_of
from tautwave.sweep.rows import Simulator

CONFIGS = Path(__file__).parents[2] / "configs"
BENCH = CONFIGS / "bench-1dof-2khz.yaml"
T = 1e-3
TIME = T * np.arange(10_000)
SCALES = Scales("lever", T, 1.0, 1.0, 1.0, 4.0)
POINTS = "[[0.2, 0.0], [0.8, 0.02], [3.0, 0.02], [3.4, 0.09]]"
LATER = f"simulation.hand.lever.reference={{type: minimum_jerk, waypoints: {POINTS}}}"


@pytest.mark.parametrize(
    ("energy", "stable"),
    [
        (np.exp(-TIME) * (1.2 + np.sin(40.0 * TIME)), 1.0),
        (np.exp(0.05 * TIME) * (1.2 + np.sin(40.0 * TIME)), 0.0),
        (np.exp(0.002 * TIME) * (1.0 + 1e-6 * np.sin(40.0 * TIME)), 0.0),  # slowly, but steadily
        (1.0 - 0.2 * np.exp(-0.5 * TIME), 1.0),  # pressed against a spring, creeping
        (1e-3 * (TIME < 4.0) + 1e-14 * TIME, 1.0),  # at rest but for rounding
        (np.where(TIME < 4.0, 1.0, 50.0 * np.exp(-(TIME - 4.0))), 1.0),  # it moved more at the end
        (np.zeros(10_000), 1.0),
        (np.where(TIME < 9.0, 1.0, math.inf), 0.0),
    ],
    ids=["decays", "grows", "slowly", "creeps", "rests", "moved", "nothing", "inf"],
)
def test_what_comes_to_rest_with_its_hand_is_stable(energy: np.ndarray, stable: float) -> None:
    assert is_stable(energy, SCALES) == stable


@pytest.mark.parametrize("rest", [math.inf, 9.99, 20.0])
def test_a_hand_that_never_rests_is_not_judged(rest: float) -> None:
    assert math.isnan(is_stable(np.ones(10_000), SCALES._replace(rest_s=rest)))


def test_a_short_rest_is_halved() -> None:
    """0.4 s: growth in the second half of it counts."""
    energy = np.where(TIME < 9.8, 1.0, 1.0 + 5.0 * (TIME - 9.8)) + 1e-3 * np.sin(500.0 * TIME)
    assert is_stable(energy, SCALES._replace(rest_s=9.6)) == 0.0
    assert is_stable(energy[::-1].copy(), SCALES._replace(rest_s=9.6)) == 1.0


@pytest.mark.parametrize(
    ("reference", "rest"),
    [
        ("{type: hold, position: 0.1}", 0.0),
        ("{type: minimum_jerk, waypoints: [[0.5, 0.0], [1.5, 0.1], [2.5, 0.1]]}", 1.5),
        ("{type: minimum_jerk, waypoints: [[0.5, 0.1]]}", 0.0),
        ("{type: multisine, components: [[1.0, 0.1, 0.0]]}", math.inf),
    ],
)
def test_when_a_hand_stands_still(reference: str, rest: float) -> None:
    rig = load_rig(BENCH, [f"simulation.hand.lever.reference={reference}"])
    assert rest_of(rig, "lever") == scales_of(rig, "lever").rest_s == rest
    assert rest_of(load_rig(BENCH, ["simulation.hand={}"]), "lever") == 0.0


def judged(*changes: str) -> float:
    rig = load_rig(BENCH, [LATER, "duration_s=5", *changes])
    columns, _, outcome = Simulator("python", whole=True).simulate(rig, "lever", 5.0)
    finished = outcome == "finished"
    return measure_run(scales_of(rig, "lever"), ("stable",), columns, finished=finished)["stable"]


@pytest.mark.slow
def test_a_stable_rig_whose_hand_moves_more_in_the_second_half_is_stable() -> None:
    assert judged("rate_hz=1000") == 1.0
    law = "coupling.law=position"
    spring = "coupling.pairs={lever: {stiffness: 20, damping: 0}}"
    free = ("simulation.environment={}", "coupling.delay_s=0.02", "rate_hz=1000")
    assert judged(law, spring, *free) == 0.0


def test_what_is_not_judged_is_said() -> None:
    rows = [{"x": "1", "stable": "nan"}, {"x": "2", "stable": "1.0"}]
    curve = Curve("wave", "wave", "black", "o", False, [1.0, 2.0], rows)
    figure = type("Figure", (), {"label": "K [N m/rad]"})()
    [(_, said)] = stability_sentences(curve, figure)
    assert said == "wave: 1 of 2 not judged: the hand does not come to rest."
