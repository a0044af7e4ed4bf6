"""What is touched, estimated: one filter, intervals that cover, guards, contacts."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator

import numpy as np
import pytest

from tautwave.couplings.mediated.estimate import (
    Contact,
    ContactParams,
    Fit,
    FitParams,
    begin_contact,
    begin_fit,
    half_width,
    learn,
    student,
    surface_variance,
    touch,
)
from tautwave.couplings.mediated.law import (
    Filter,
    SignalParams,
    Slope,
    begin_filter,
    begin_slope,
    pass_filter,
    pass_slope,
)
from tautwave.laws.observer import observe, observer_params

T = 5e-4
TRUE = (12.0, 0.05, 0.3)


def samples(seed: int, count: int, noise: float) -> Iterator[tuple[float, float, float]]:
    """Position and velocity of a hand at 0.5 and 1.3 Hz, and a noisy effort."""
    draw = random.Random(seed)
    phase = draw.uniform(0.0, 6.0), draw.uniform(0.0, 6.0)
    for k in range(count):
        t = 0.02 * k
        a, b = math.tau * 0.5 * t + phase[0], math.tau * 1.3 * t + phase[1]
        x = 0.02 * math.sin(a) + 0.005 * math.sin(b)
        v = math.tau * (0.01 * math.cos(a) + 0.0065 * math.cos(b))
        yield x, v, TRUE[0] * x + TRUE[1] * v + TRUE[2] + draw.gauss(0.0, noise)


@pytest.mark.parametrize("forget", [1.0, 0.93])
def test_intervals_of_95_percent_hold_the_truth_in_95_percent(forget: float) -> None:
    """600 estimates, each of stiffness, damping, offset and surface: a deviation is 0.9 %."""
    hits = np.zeros(4)
    runs = 600
    for seed in range(runs):
        s = Fit()
        begin_fit(s)
        for x, v, y in samples(seed, 40, 5e-3):
            learn(FitParams(forget), s, x, v, y)
        off = (s.stiffness - TRUE[0], s.damping - TRUE[1], s.offset - TRUE[2])
        wide = [half_width(s, c) for c in (s.c11, s.c22, s.c33)]
        hits[:3] += [abs(o) <= w for o, w in zip(off, wide, strict=True)]
        place = -s.offset / s.stiffness + TRUE[2] / TRUE[0]
        hits[3] += abs(place) <= half_width(s, surface_variance(s))
    assert hits / runs == pytest.approx([0.95] * 4, abs=0.03)


def test_without_noise_it_is_the_truth() -> None:
    s = Fit()
    begin_fit(s)
    for x, v, y in samples(1, 30, 0.0):
        learn(FitParams(0.97), s, x, v, y)
    assert (s.stiffness, s.damping, s.offset) == pytest.approx(TRUE, rel=1e-6)


def test_it_is_weighted_least_squares_and_its_covariance() -> None:
    forget, count = 0.95, 60
    rows = list(samples(3, count, 1e-2))
    s = Fit()
    begin_fit(s)
    for x, v, y in rows:
        assert learn(FitParams(forget), s, x, v, y)
    matrix = np.array([(x, v, 1.0) for x, v, _ in rows])
    weights = forget ** np.arange(count - 1, -1, -1)
    inverse = np.linalg.inv(matrix.T @ (weights[:, None] * matrix))
    best = inverse @ matrix.T @ (weights * np.array([y for _, _, y in rows]))
    spread = inverse @ matrix.T @ (weights[:, None] ** 2 * matrix) @ inverse
    assert (s.stiffness, s.damping, s.offset) == pytest.approx(best, rel=1e-5)
    found = [s.c11, s.c12, s.c13, s.c22, s.c23, s.c33]
    assert found == pytest.approx(spread[np.triu_indices(3)], rel=1e-4)


def test_a_device_that_rests_forgets_nothing() -> None:
    s = Fit()
    begin_fit(s)
    p = FitParams(0.9)
    for x, v, y in samples(4, 60, 5e-3):
        learn(p, s, x, v, y)
    known = half_width(s, s.c11)
    taken = sum(learn(p, s, 0.01, 0.0, 12.0 * 0.01 + 0.3) for _ in range(2000))
    assert taken < 30
    assert half_width(s, s.c11) < 1.5 * known
    assert s.stiffness == pytest.approx(12.0, abs=2.0)


@pytest.mark.parametrize(("degrees", "expected"), [(4, 2.7764), (10, 2.2281), (60, 2.0003)])
def test_students_quantile(degrees: float, expected: float) -> None:
    assert student(degrees) == pytest.approx(expected, rel=3e-3)
    assert student(3.9) == math.inf


def test_an_observed_effort_and_a_filtered_motion_have_no_phase_between_them() -> None:
    """A free mass on K and B whose mean effort acts in each period: the fit is exact."""
    mass, pole, stiffness, damping = 1.5e-3, 0.9, 5.0, 0.004
    observer = observer_params(T, mass, pole)
    p = SignalParams(pole, 0.5 / T)
    place, speed = Filter(), Slope()
    x, v, at, seen, push = 0.0, 0.0, 0.0, 0.0, 0.0
    begin_filter(place, x)
    begin_slope(speed)
    off = []
    for k in range(4000):
        motor = 0.3 * math.sin(math.tau * 3.0 * k * T) + 0.1 * math.sin(math.tau * 11.0 * k * T)
        # the device moves by T v + (T^2 / 2m) f with f the mean of K x + B v over the period
        half = 0.5 * T * T / mass
        gain = 0.5 * stiffness + damping / T
        moved = (T * v + half * (-motor - stiffness * x)) / (1.0 + half * gain)
        effort = stiffness * (x + 0.5 * moved) + damping * moved / T
        v = 2.0 * moved / T - v
        x += moved
        at, seen, push = observe(observer, at, seen, push, x, motor, 1.0)
        pass_slope(p, speed, place, x)
        pass_filter(p, place, x)
        if k > 1000:
            off.append(-mass * push - stiffness * place.mean - damping * speed.mean)
        assert abs(effort) < 10.0
    assert max(map(abs, off)) < 1e-9


CONTACT = ContactParams(FitParams(0.95), touch=0.02, every=20.0, sure=0.2, resolution=1e-4)


def press(s: Contact, surface: float, stiffness: float, reach: float, noise: float = 1e-4) -> None:
    """Move in and out of a surface for 2 s, in the filter's own signals."""
    draw = random.Random(5)
    for k in range(4000):
        x = reach * math.sin(math.tau * k * T)
        v = reach * math.tau * math.cos(math.tau * k * T)
        depth = x - surface
        effort = stiffness * depth if depth > 0.0 else 0.0
        touch(CONTACT, s, x, v, effort + draw.gauss(0.0, noise), 1.0)


def test_a_surface_is_found_and_goes_where_the_device_does() -> None:
    s = Contact()
    begin_contact(s, 0.0)
    press(s, 0.08, 200.0, 0.085)
    assert s.reported == 1.0
    assert s.above.stiffness == pytest.approx(200.0, rel=0.02)
    assert s.above.position == pytest.approx(0.08, abs=1e-4)
    assert s.below.stiffness == 0.0
    # it gave way: nothing is felt up to 0.12
    press(s, 0.2, 200.0, 0.12)
    assert s.above.position == pytest.approx(0.12, abs=1e-3)
    # softer, elsewhere: found anew
    press(s, 0.05, 20.0, 0.1)
    assert s.above.stiffness == pytest.approx(20.0, rel=0.02)
    assert s.above.position == pytest.approx(0.05, abs=1e-3)


def test_friction_that_was_taken_for_a_contact_does_not_soften_the_wall_behind_it() -> None:
    """0.025 above a band of 0.02 for 40 mrad, then 200: the fit begins anew at the wall."""
    s = Contact()
    begin_contact(s, 0.0)
    draw = random.Random(6)
    for k in range(2000):
        x = 0.085 * math.sin(0.5 * math.pi * k / 2000.0)
        v = 0.085 * 0.5 * math.pi / 2000.0 / T * math.cos(0.5 * math.pi * k / 2000.0)
        effort = 0.025 + 200.0 * max(x - 0.06, 0.0)
        touch(CONTACT, s, x, v, effort + draw.gauss(0.0, 5e-4), 1.0)
    assert s.above.stiffness == pytest.approx(200.0, rel=0.03)
    assert s.above.position == pytest.approx(0.06, abs=5e-4)


def test_what_no_fit_is_sure_of_has_the_effort_that_there_is() -> None:
    """A slow press, long before a fit is sure: the line from the last sample without contact."""
    s = Contact()
    begin_contact(s, 0.0)
    for k in range(200):
        x = 0.01 + 1e-5 * k
        touch(CONTACT, s, x, 0.02, 200.0 * max(x - 0.01105, 0.0), 1.0)
        felt = s.above.stiffness * max(x - s.above.position, 0.0)
        pressed = 200.0 * max(x - 0.01105, 0.0)
        assert s.wide_stiffness == 0.0  # no fit
        if pressed > 2.0 * CONTACT.touch:
            assert 0.5 * pressed <= felt <= pressed * (1.0 + 1e-9)
    assert pressed > 0.15
    assert 100.0 < s.above.stiffness <= 200.0


def test_friction_that_changes_its_sign_is_no_surface() -> None:
    """What is left of it for a moment is more than the band, and less than half as much again."""
    s = Contact()
    begin_contact(s, 0.0)
    for k in range(4000):
        x = 0.1 * math.sin(math.tau * k * T)
        effort = 1.4 * CONTACT.touch if 0.02 < math.fmod(k * T, 0.25) < 0.05 else 0.0
        touch(CONTACT, s, x, 0.1 * math.tau * math.cos(math.tau * k * T), effort, 1.0)
    assert s.reported == 0.0
    assert s.above.stiffness == 0.0
