"""Published rules, adversarial motions, leaks, and the verdict with its sentences."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.analysis.walls.limits import is_passive
from tautwave.analysis.walls.messages import (
    passivity_sentence,
    quantum_sentence,
    stability_sentence,
)
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.rules import (
    quantised_stiffness,
    quantum_activity,
    quantum_force,
    velocity_quantum,
)
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.verdict import WallDevice, assess_wall
from tautwave.laws.wall import WallParams, wall_depth, wall_effort
from tautwave.models.encoder import quantise
from tautwave.models.hand import PAPER_HAND
from tautwave.models.plant import PlantParams, plant_cache, plant_step
from tests.analysis.reference.wall_rules import (
    adversarial_energy,
    adversarial_positions,
    best_stroke,
    bounce_gain,
    damper_step,
    friction_region,
    penetration_leak,
    predicting_damping,
    quantiser_gain,
    swing_threshold,
)
from tests.examples import tried

T = 1e-3


def given_back(
    positions: list[float], K: float, b: float, c: float, Q: float, period: float
) -> float:
    """Energy a user who moves at constant speed between the samples gets in all [J].

    Effort of the live law on the quantised position, less what friction takes.
    """
    law = WallParams(-1.0, 1.0, K, 0.0, controlled=False)
    offset = wall_effort(law, 1.0, 0.0)
    total = 0.0
    for here, there in itertools.pairwise(positions):
        step = there - here
        push = wall_effort(law, wall_depth(law, quantise(here, Q)), 0.0) - offset
        total -= push * step + b * step * step / period + c * abs(step)
    return total


# -- quantisation ---------------------------------------------------------------------------------


def test_adversarial_motion_yields_what_the_formula_says() -> None:
    K, Q, c, b, d = 1000.0, 1e-4, 0.03, 0.7, 2e-6
    per_cycle = adversarial_energy(K, b, c, T, Q, d)
    assert per_cycle == pytest.approx(7.44e-8, rel=1e-6)
    positions = adversarial_positions(0.5 * Q, d, 2001)
    assert given_back(positions, K, b, c, Q, T) == pytest.approx(1000 * per_cycle, rel=1e-6)
    assert best_stroke(K, b, c, T, Q) == pytest.approx(1.42857e-5, rel=1e-5)


def test_best_stroke_is_best() -> None:
    best = best_stroke(1000.0, 0.7, 0.03, T, 1e-4)
    energy = [adversarial_energy(1000.0, 0.7, 0.03, T, 1e-4, best * f) for f in (0.99, 1.0, 1.01)]
    assert energy[1] > max(energy[0], energy[2])
    assert best_stroke(1000.0, 0.7, 0.06, T, 1e-4) == 0.0


@given(st.floats(0.1, 3.0), st.floats(0.0, 0.1), st.floats(1.0, 5000.0))
def test_abbott_and_okamura_is_where_the_motion_begins_to_pay(b: float, c: float, K: float) -> None:
    Q = 1e-4
    limit = quantised_stiffness(b, c, T, Q)
    strokes = [*np.geomspace(1e-12, 1.0, 200), *(Q * n * (1 + 1e-9) for n in range(1, 2000, 37))]
    best = max(adversarial_energy(K, b, c, T, Q, float(d)) for d in strokes)
    if limit * 0.999 >= K:
        assert best <= 0.0
    if limit * 1.01 + 1.0 <= K:
        assert best > 0.0


@given(
    st.floats(0.51, 3.0),
    st.floats(0.0, 0.1),
    st.floats(1e-6, 1e-3),
    st.lists(st.floats(-3e-4, 3e-4), min_size=2, max_size=60),
)
@settings(max_examples=tried(150))
def test_no_motion_yields_more_than_the_bound(
    b: float, c: float, Q: float, steps: list[float]
) -> None:
    wall = SampledWall(1000.0, period=T)
    positions = [0.0, *itertools.accumulate(steps)]
    got = given_back(positions, 1000.0, b, c, Q, T)
    bound = 0.5 * quantum_activity(wall, b, c, Q) * len(steps)
    assert got <= bound + 1e-12


def test_bound_is_within_reach_of_the_best_motion() -> None:
    wall, b, Q = SampledWall(100.0, period=T), 0.7, 1e-4  # far from the viscous limit
    best = adversarial_energy(100.0, b, 0.0, T, Q, best_stroke(100.0, b, 0.0, T, Q))
    assert best <= quantum_activity(wall, b, 0.0, Q) <= 1.1 * best


def test_activity_is_zero_covered_by_friction_and_unbounded_without_damping() -> None:
    wall = SampledWall(1000.0, period=T)
    assert quantum_activity(wall, 0.5, 0.05, 1e-4) == 0.0
    assert quantum_activity(wall, 0.5, 0.04, 1e-4) == math.inf
    assert quantum_activity(wall, 0.4, 0.05, 1e-4) == math.inf


def test_velocity_quanta() -> None:
    assert velocity_quantum(2 * math.pi / 4096, T) == pytest.approx(1.534, abs=1e-3)
    wall = SampledWall(1000.0, 0.2, T, filter_s=1e-3)
    assert damper_step(wall, 1e-4) == pytest.approx(0.2 * 0.1 / 2)
    assert quantum_force(wall, 1e-4) == pytest.approx(0.05 + 0.01)
    assert quantised_stiffness(0.7, 0.0, T, 1e-4) == 0.0
    assert quantised_stiffness(0.7, 0.0, T, 0.0) == pytest.approx(1400.0)


def test_quantiser_describing_function() -> None:
    assert quantiser_gain(1 / math.sqrt(2), 1.0) == pytest.approx(4 / math.pi)
    assert quantiser_gain(0.4, 1.0) == 0.0
    phase = (np.arange(200_000) + 0.5) / 200_000 * 2 * np.pi
    for amplitude in (0.6, 1.3, 7.7):
        output = np.floor(amplitude * np.sin(phase) + 0.5)
        expected = 2 * np.mean(output * np.sin(phase)) / amplitude
        assert quantiser_gain(amplitude, 1.0) == pytest.approx(expected, rel=1e-4)


# -- Diolaiti -------------------------------------------------------------------------------------


def test_regions_of_friction() -> None:
    wall = SampledWall(1000.0, period=T, delay=1.0)
    assert friction_region(wall, 1.6, 0.06, 1e-4).name == "passive"
    above = friction_region(wall, 1.6, 0.03, 1e-4)
    assert (above.name, above.speed) == ("passive_above", pytest.approx(0.2))
    below = friction_region(wall, 1.3, 0.06, 1e-4)
    assert (below.name, below.speed) == ("stable_below", pytest.approx(0.05))
    assert friction_region(wall, 1.3, 0.03, 1e-4).name == "none"
    assert (above.beta, above.sigma, above.lag) == (
        pytest.approx(1.6),
        pytest.approx(0.3),
        1.0,
    )
    # beta >= 1/2 + lag is Colgate and Schenkel's condition of the spring.
    assert is_passive(wall, 1.5)
    assert friction_region(wall, 1.5, 1.0, 1e-4).name == "passive"


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_coulomb_friction_stops_what_is_slower_than_the_threshold(share: float) -> None:
    m, b, c, K = 0.1, 0.2, 0.05, 1000.0
    wall = SampledWall(K, period=2e-4 * 5)
    # Bilateral here, as the describing function has it: a spring held for a period.
    speed = share * swing_threshold(wall, b, c)
    plant = PlantParams(m, b, c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    cache = plant_cache(plant, wall.period)
    x, v, mode, peaks = 0.0, speed, 0, [0.0, 0.0]
    for k in range(4000):
        x, v, mode, *_ = plant_step(plant, cache, x, v, mode, -K * x, 0.0, 0.0, wall.period)
        half = 0 if k < 400 else 1 if k >= 3600 else 2
        if half < 2:
            peaks[half] = max(peaks[half], abs(v))
    assert (peaks[1] < peaks[0]) == (share < 1.0)


# -- leaks and cures ------------------------------------------------------------------------------


def bounce(K: float, B: float, m: float, period: float, phase: float) -> float:
    """Energy ratio of one penetration at 1 m/s, `phase` of a period before the next sample."""
    law = WallParams(0.0, 1.0, K, B, controlled=False)
    x, v, before = -period * (1.0 - phase), 1.0, -2 * period
    for _ in range(10_000):
        effort = wall_effort(law, wall_depth(law, x), (x - before) / period)
        if x < -2 * period and v < 0.0:
            break
        before = x
        x, v = x + v * period - 0.5 * effort / m * period**2, v - effort / m * period
    return v * v


@pytest.mark.parametrize(
    ("period", "mean", "formula"),
    [(1e-3, 1.16984, 1.17009), (5e-4, 1.0816777, 1.0817064), (1e-4, 1.0158318, 1.0158320)],
)
def test_D6_energy_of_a_bounce(period: float, mean: float, formula: float) -> None:
    got = np.mean([bounce(1000.0, 0.0, 0.1, period, (i + 0.5) / 200) for i in range(200)])
    assert got == pytest.approx(mean, abs=3e-4)
    wall = SampledWall(1000.0, period=period)
    assert bounce_gain(wall, 0.1) == pytest.approx(formula, abs=1e-5)
    assert bounce_gain(wall, 0.1) == pytest.approx(math.exp(math.pi * 100 * period / 2))
    assert penetration_leak(wall, 0.1, 2.0) == pytest.approx(0.2 * (formula - 1), rel=1e-4)


def test_half_a_sample_of_prediction_is_a_damper() -> None:
    wall = SampledWall(1000.0, period=T)
    B = predicting_damping(wall)
    assert predicting_damping(wall) == pytest.approx(0.5)
    x, before = 0.003, 0.0027
    law = WallParams(0.0, 1.0, 1000.0, B, controlled=False)
    velocity = (x - before) / T
    assert wall_effort(law, x, velocity) == pytest.approx(1000.0 * (x + 0.5 * T * velocity))
    for factor, restitution in ((0.0, 1.0816), (0.5, 1.0406), (1.0, 1.0016), (2.0, 0.9296)):
        energy = [bounce(1000.0, factor * B, 0.1, T, (i + 0.5) / 100) for i in range(100)]
        assert np.mean(np.sqrt(energy)) == pytest.approx(restitution, abs=5e-3)
    assert wall_leak(wall._replace(damping=B)).damping == pytest.approx(1.0)  # KT/2 + B


# -- the verdict ----------------------------------------------------------------------------------

walls = st.builds(
    SampledWall,
    st.floats(0, 6).map(lambda e: 10.0**e),
    st.one_of(st.just(0.0), st.floats(-3, 1).map(lambda e: 10.0**e)),
    st.sampled_from([1e-4, 1e-3, 1e-2]),
    st.sampled_from([0.0, 1.0, 0.3, 4.0]),
    st.sampled_from([0.0, 2e-3]),
)
devices = st.builds(
    WallDevice,
    st.floats(-3, 0).map(lambda e: 10.0**e),
    st.floats(-3, 2).map(lambda e: 10.0**e),
    st.sampled_from([0.0, 0.1]),
    st.sampled_from([0.0, 1e-4]),
)


@pytest.mark.slow
@given(walls, devices, st.sampled_from([None, PAPER_HAND]))
@settings(max_examples=40)
def test_every_remedy_works_alone_and_the_blame_adds_up(
    wall: SampledWall, device: WallDevice, hand: object
) -> None:
    verdict = assess_wall(wall, device, PAPER_HAND if hand else None)
    assert sum(verdict.blame) == pytest.approx(verdict.leak.damping, abs=1e-12)
    assert verdict.passive == (verdict.margin >= -1e-9 * device.damping)
    remedies = verdict.remedies
    if remedies.stiffness > 0.0:
        assert is_passive(wall._replace(stiffness=remedies.stiffness), device.damping)
    if remedies.damping > -math.inf:
        assert is_passive(wall._replace(damping=remedies.damping), device.damping)
    if math.isfinite(remedies.rate):
        assert is_passive(wall._replace(period=1.0 / remedies.rate), device.damping)
    assert is_passive(wall, device.damping + remedies.added)
    # Passive means stable with every hand, this one among them.
    if verdict.passive and verdict.margin > 1e-6 * device.damping:
        assert verdict.coupled_stable
    assert verdict.coupled_stable == (verdict.decay <= 0.0) or wall.damping > 0.0
    for words in (passivity_sentence, stability_sentence, quantum_sentence):
        text = words(verdict, "slave wall")
        assert text.startswith("slave wall: ")
        assert text.endswith(".")
        assert "nan" not in text
        assert "inf " not in text


def test_sentence_of_the_readme() -> None:
    verdict = assess_wall(SampledWall(5000.0, 0.0, T, 1.0), WallDevice(0.1, 2.418))
    text = passivity_sentence(verdict, "slave wall", rotary=True)
    assert text == (
        "slave wall: K = 5000 N m/rad is 3.1 x the passive limit 1612; one period of delay costs "
        "3 x of it. Lower K to 1612, or raise the rate to 3.11 kHz, or "
        "add 5.09 N m s/rad of damping."
    )


@pytest.mark.parametrize("damping", [-1e-6, 0.0, 1e-6])
@pytest.mark.parametrize("filtered", [-1e-6, 0.0, 1e-6])
def test_what_takes_damping_is_named_however_small(damping: float, filtered: float) -> None:
    verdict = assess_wall(SampledWall(5000.0, 0.0, T, 1.0), WallDevice(0.1, 2.418))
    blame = verdict.blame._replace(damping=damping, filter=filtered)
    text = passivity_sentence(verdict._replace(blame=blame))
    assert ("B takes 1e-06" in text) == (damping > 0.0)
    assert ("its filter 1e-06" in text) == (filtered > 0.0)


@pytest.mark.slow
@given(st.floats(0, 6), st.floats(-3, 1), st.sampled_from([0.0, 1.0, 2.6]))
@settings(max_examples=40)
def test_advice_as_printed_is_enough(stiffness: float, damping: float, delay: float) -> None:
    wall = SampledWall(10.0**stiffness, 0.0, T, delay)
    b = 10.0**damping
    text = passivity_sentence(assess_wall(wall, WallDevice(0.1, b)))
    number = r"([0-9.e+-]+)"
    if found := re.search(rf"[Ll]ower K to {number}", text):
        assert is_passive(wall._replace(stiffness=float(found[1].rstrip(","))), b)
    if found := re.search(rf"rate to {number} (k?)Hz", text):
        rate = float(found[1]) * (1000.0 if found[2] else 1.0)
        assert is_passive(wall._replace(period=1.0 / rate), b)
    if found := re.search(rf"[Aa]dd {number} N", text):
        assert is_passive(wall, b + float(found[1]))


def test_quantised_verdict_and_its_words() -> None:
    wall = SampledWall(1000.0, period=T)
    fine = assess_wall(wall, WallDevice(0.1, 0.7, 0.06, 1e-4))
    assert (fine.passive, fine.passive_quantised, fine.activity) == (True, True, 0.0)
    rough = assess_wall(wall, WallDevice(0.1, 0.7, 0.0, 1e-4))
    assert (rough.passive, rough.passive_quantised) == (True, False)
    assert rough.activity == pytest.approx(T * 0.05**2 / (2 * 0.2))
    assert "no wall passes" in quantum_sentence(rough)
    assert "6.25e-06 J" in quantum_sentence(rough)
    assert "no encoder step" in quantum_sentence(assess_wall(wall, WallDevice(0.1, 0.7)))


def test_negative_damper_is_not_offered_as_a_cure() -> None:
    verdict = assess_wall(SampledWall(1000.0, -0.2, T), WallDevice(0.1, 0.6))
    assert not verdict.passive
    assert verdict.blame.damping == pytest.approx(0.2)
    assert "lower B" not in passivity_sentence(verdict)
