"""Fits against exact data, the theory's table, and what a wrong method would say."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.analysis.identification.contact_model import choose, fit_contact
from tautwave.analysis.identification.contact_motion import motion_of, touching_share
from tautwave.analysis.identification.device_model import fit_device
from tautwave.analysis.identification.regression import (
    Array,
    Kernel,
    RecursiveLeastSquares,
    solve,
    student_quantile,
    white_noise,
)
from tautwave.models.plant import plant_cache, plant_step
from tautwave.models.plant_params import PlantParams
from tests.analysis.reference.hunt_crossley import fit_hunt_crossley

PERIOD = 1e-3
HAND = np.array([0.143, 5.0, 538.0])


def hand_motion(count: int = 8000) -> tuple[Array, Array]:
    """Position and exact force of the paper's hand under 1.3, 3.1 and 7.7 Hz."""
    t = np.arange(count) * PERIOD
    omega = 2.0 * np.pi * np.array([1.3, 3.1, 7.7])[:, None]
    x = np.sin(omega * t + 0.3).sum(axis=0)
    v = (omega * np.cos(omega * t + 0.3)).sum(axis=0)
    a = (-(omega**2) * np.sin(omega * t + 0.3)).sum(axis=0)
    return x, HAND @ np.stack([a, v, x])


def filtered_rows() -> tuple[Array, Array]:
    x, force = hand_motion()
    kernel = Kernel(PERIOD, 30.0)
    return np.stack([kernel.apply(x, order) for order in (2, 1, 0)], axis=1), kernel.apply(force)


def test_one_filter_on_both_sides_is_exact_where_backward_differences_are_not() -> None:
    rows, target = filtered_rows()
    np.testing.assert_allclose(solve(rows, target), HAND, rtol=1e-7)
    x, force = hand_motion()
    v = np.diff(x, prepend=x[0]) / PERIOD
    a = np.diff(v, prepend=v[0]) / PERIOD
    found = solve(np.stack([a, v, x], axis=1)[10:], force[10:])
    assert found[0] == pytest.approx(HAND[0] + 0.5 * HAND[1] * PERIOD, rel=1e-3)
    assert found[1] < 0.99 * HAND[1]  # b - m T w^2 / 2, of some mean frequency


def test_recursive_least_squares_ends_where_all_at_once_does() -> None:
    rows, target = filtered_rows()
    recursive = RecursiveLeastSquares(3)
    for row, value in zip(rows[::7], target[::7], strict=True):
        recursive.update(row, value)
    np.testing.assert_allclose(recursive.coefficients, HAND, rtol=1e-7)
    direct = solve(rows[::7], target[::7])
    np.testing.assert_allclose(recursive.coefficients, direct, rtol=1e-7)


def test_forgetting_follows_a_change() -> None:
    rng = np.random.default_rng(0)
    recursive = RecursiveLeastSquares(1, forgetting=0.98)
    for stiffness in (100.0, 300.0):
        for x in rng.normal(size=600):
            recursive.update(np.array([x]), stiffness * x)
        assert recursive.coefficients[0] == pytest.approx(stiffness, rel=1e-4)


def test_a_held_effort_is_filtered_exactly_and_may_be_late() -> None:
    kernel = Kernel(PERIOD, 30.0)
    ramp = np.arange(500.0)
    for delay in (0.0, 0.25, 3.0, 3.6):
        late = kernel.apply(ramp) - kernel.apply_held(ramp, delay)
        np.testing.assert_allclose(late[10:], 0.5 + delay, atol=1e-6)


def test_what_a_filter_makes_of_a_sample_does_not_depend_on_how_long_the_recording_is() -> None:
    kernel = Kernel(PERIOD, 30.0)
    signal = np.sin(0.01 * np.arange(40_000.0) ** 1.1)
    whole = kernel.apply(signal)
    for begin in range(0, 39_000, 3_000):
        part = kernel.apply(signal[begin : begin + 1_000])
        np.testing.assert_allclose(whole[begin : begin + len(part)], part, atol=1e-12)
    assert len(whole) == len(signal) - 2 * kernel.half


def test_hunt_crossley_by_nonlinear_least_squares_is_exact_and_the_logarithm_is_not() -> None:
    rng = np.random.default_rng(1)
    depth, rate = rng.uniform(1e-4, 0.01, 2000), rng.uniform(-0.025, 0.025, 2000)
    force = 5000.0 * depth**1.4 + 3000.0 * depth**1.4 * rate
    assert fit_hunt_crossley(depth, rate, force) == pytest.approx((5000, 3000, 1.4), rel=1e-9)
    columns = np.stack([np.ones_like(depth), rate, np.log(depth)], axis=1)
    level, loss, exponent = solve(columns, np.log(force))
    biased = np.exp(level), loss * np.exp(level), exponent
    for value, truth in zip(biased, (5000, 3000, 1.4), strict=True):
        assert 1e-7 < abs(value / truth - 1.0) < 2e-3


def contact_recording(kind: str, seed: int) -> tuple[Array, Array]:
    """Position and force at a contact, with the bench's noise and a force offset."""
    rng = np.random.default_rng(seed)
    t = np.arange(8000) * 5e-4
    phases = rng.uniform(0.0, 2.0 * np.pi, 3)
    omega = 2.0 * np.pi * np.array([0.9, 2.1, 3.3])[:, None]
    size = np.array([0.05, 0.03, 0.02])[:, None]
    x = (size * np.sin(omega * t + phases[:, None])).sum(axis=0)
    v = (size * omega * np.cos(omega * t + phases[:, None])).sum(axis=0)
    depth = np.maximum(x - 0.01, 0.0)
    if kind == "spring":
        force = 4.0 * x + 0.02 * v
    elif kind == "contact":
        force = 20.0 * depth + 0.1 * v * (depth > 0.0)
    elif kind == "preloaded":
        force = (0.2 + 8.0 * depth + 0.05 * v) * (depth > 0.0)
    else:
        force = 300.0 * depth**1.8 * (1.0 + 0.6 * v)
    noise = 9e-5 * rng.normal(size=len(x))
    quantum = 2.094e-5
    seen = np.round((x + noise) / quantum) * quantum
    return seen, -force - 0.03 + 3e-3 * rng.normal(size=len(x))


TRUTHS = {
    "spring": {"stiffness": 4.0, "damping": 0.02},
    "contact": {"stiffness": 20.0, "damping": 0.1, "surface": 0.01, "offset": -0.03},
    "preloaded": {"stiffness": 8.0, "preload": 0.2, "surface": 0.01, "offset": -0.03},
    "hunt_crossley": {"exponent": 1.8, "loss": 0.6, "surface": 0.01, "offset": -0.03},
}


def test_the_loss_of_a_contact_is_exact_where_nothing_disturbs() -> None:
    t = np.arange(1500) * 1e-3
    x, v = 0.04 * np.sin(9.7 * t), 0.388 * np.cos(9.7 * t)
    depth = np.maximum(x - 0.01, 0.0)
    motion = motion_of(x, -300.0 * depth**1.8 * (1.0 + 0.6 * v), 1e-3, cutoff_hz=40.0)
    fit = fit_contact(motion, "hunt_crossley")
    assert fit is not None
    assert fit.parameters["loss"].value == pytest.approx(0.6, rel=5e-3)
    assert fit.parameters["exponent"].value == pytest.approx(1.8, rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRUTHS)
def test_a_contact_is_found_within_its_interval(kind: str) -> None:
    inside = total = 0
    for seed in range(8):
        position, effort = contact_recording(kind, seed)
        fit = fit_contact(motion_of(position, effort, 5e-4, cutoff_hz=40.0), kind)
        assert fit is not None
        assert fit.sense == -1
        for name, truth in TRUTHS[kind].items():
            estimate = fit.parameters[name]
            inside += estimate.lower <= truth <= estimate.upper
            total += 1
            assert estimate.value == pytest.approx(truth, rel=0.1, abs=1e-3)
    assert inside >= 0.9 * total, f"{inside} of {total}"


@pytest.mark.slow
def test_the_working_stiffness_is_the_slope_at_the_depth_that_a_twentieth_exceeds() -> None:
    t = np.arange(8000) * 5e-4
    x = 0.05 * np.sin(5.7 * t) + 0.03 * np.sin(13.1 * t + 1.0)
    for side, surface in ((1, 0.01), (-1, -0.02)):
        depth = np.maximum(side * (x - surface), 0.0)
        motion = motion_of(x, side * 300.0 * depth**1.8, 5e-4, cutoff_hz=40.0)
        fit = fit_contact(motion, "hunt_crossley")
        assert fit is not None
        assert fit.side == side
        touched = np.maximum(side * (motion.position - fit.parameters["surface"].value), 0.0)
        deep = np.quantile(touched[touched > 0.0], 0.95)
        assert fit.working_stiffness.value == pytest.approx(540.0 * deep**0.8, rel=1e-3)
        assert fit.parameters["stiffness"].value == pytest.approx(300.0, rel=1e-2)
        assert fit.contact_share == pytest.approx(np.mean(depth > 0.0), abs=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("kind", TRUTHS)
def test_the_right_model_is_chosen(kind: str) -> None:
    motion = motion_of(*contact_recording(kind, 3), 5e-4, cutoff_hz=40.0)
    fits = [fit_contact(motion, name) for name in TRUTHS]
    assert choose([fit for fit in fits if fit is not None]).name == kind


def shaken(seed: int, coulomb: float, count: int = 8000) -> tuple[Array, Array]:
    """Position and effort of a device with friction, as an encoder and a drive see them."""
    rng = np.random.default_rng(seed)
    params = PlantParams(1.6e-3, 2e-3, coulomb, 0, 0, 0, 0, 0, 0, 0, 1.0)
    cache = plant_cache(params, PERIOD)
    hz = np.geomspace(0.7, 15.0, 8)[:, None]
    t = np.arange(count) * PERIOD
    phases = rng.uniform(0.0, 2.0 * np.pi, 8)[:, None]
    force = (0.01 * np.sqrt(hz / 15.0) * np.sin(2 * np.pi * hz * t + phases)).sum(axis=0)
    noise = 3e-5 * rng.normal(size=count)
    seen, sent = np.empty(count), np.empty(count)
    x = v = 0.0
    mode = 0
    for k in range(count):
        seen[k] = round((x + noise[k]) / 5e-5) * 5e-5
        sent[k] = round((force[k] - 0.016 * seen[k]) / 1e-4) * 1e-4
        x, v, mode, *_ = plant_step(params, cache, x, v, mode, sent[k], 0.0, 0.0, PERIOD)
    return seen, sent


@pytest.mark.sparse(2)
@pytest.mark.parametrize("coulomb", [0.0, 2e-3])
def test_a_device_is_found_within_its_interval(coulomb: float) -> None:
    truth = {"inertia": 1.6e-3, "damping": 2e-3, "coulomb": coulomb, "bias": 0.0}
    inside = total = 0
    for seed in range(12):
        fit = fit_device(*shaken(seed, coulomb), PERIOD, cutoff_hz=30.0)
        for name, value in truth.items():
            estimate = getattr(fit, name)
            inside += estimate.lower <= value <= estimate.upper
            total += 1
        assert fit.inertia.value == pytest.approx(1.6e-3, rel=5e-3)
    assert inside >= 0.9 * total, f"{inside} of {total}"


def test_what_was_filled_in_for_a_missing_sample_hardly_matters() -> None:
    position, effort = shaken(0, 2e-3)
    known = np.ones(len(position), bool)
    known[::400] = False
    filled = position + np.where(known, 0.0, 0.04 * np.ptp(position))
    fits = [fit_device(x, effort, PERIOD, cutoff_hz=30.0, known=known) for x in (position, filled)]
    assert fits[1].inertia.value == pytest.approx(fits[0].inertia.value, rel=0.02)


def test_a_device_that_stands_still_says_so() -> None:
    with pytest.raises(ValueError, match="hardly moved"):
        fit_device(np.zeros(5000), np.zeros(5000), PERIOD, cutoff_hz=30.0)


def test_noise_and_quantiles() -> None:
    rng = np.random.default_rng(2)
    smooth = np.sin(np.arange(5000) * 0.01)
    assert white_noise(smooth + 1e-3 * rng.normal(size=5000)) == pytest.approx(1e-3, rel=0.05)
    for freedom, quantile in ((5, 2.5706), (16, 2.1199), (100, 1.98397)):  # Student's tables
        assert student_quantile(freedom) == pytest.approx(quantile, rel=2e-3)


@pytest.mark.parametrize("step", [1e-9, 1e-3, 2.0])
def test_the_share_of_a_period_in_contact_is_that_of_a_straight_motion(step: float) -> None:
    ahead = step * np.arange(-2.0, 3.0) + 0.25 * step  # crosses a quarter of a period before 0
    assert touching_share(ahead).tolist() == pytest.approx([0.0, 0.0, 0.75, 1.0, 1.0])
    assert touching_share(np.full(3, step)).tolist() == [1.0, 1.0, 1.0]
    assert touching_share(np.full(3, -step)).tolist() == [0.0, 0.0, 0.0]
