"""The sampled wave port of an impedance device: passive against every lossless far end.

Theory: docstring of `laws.tracked_port`. The obvious port is kept here as the counterexample.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tautwave.laws.tracked_port import (
    port_close,
    port_effort,
    port_params,
    rigid_port,
    sensor_allowance,
    track_velocity,
)
from tests.laws.loops import (
    DAMPED,
    FREE,
    HAND,
    RICH,
    Device,
    matrix_of,
    naive_loop,
    port_loop,
    port_response,
    radius,
)

T = 1e-3
MASS = 0.5
IMPEDANCES = (1.0, 5.0, 20.0, 100.0, 400.0)
DEVICES = {"free": FREE, "damped": DAMPED, "hand": HAND}
CIRCLE = np.concatenate([np.geomspace(1e-4, 0.1, 60), np.linspace(0.1, np.pi, 240)])


def params(b: float, share: float = 1.0, matched: bool = False, drift_time: float = 0.05):
    return port_params(T, b, share * MASS, matched, drift_time, 0.0)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("name", DEVICES)
def test_no_lossless_far_end_makes_it_unstable(name: str, delay: int) -> None:
    for b, share, end, samples in itertools.product(
        IMPEDANCES, (0.5, 0.8, 1.0), (1.0, -1.0), (1, 2, 7, 20)
    ):
        found = radius(port_loop(params(b, share), DEVICES[name], 1.0, delay, samples, end))
        assert found <= 1.0 + 1e-9, (b, share, end, samples, found)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("name", DEVICES)
def test_no_lossless_far_end_makes_it_unstable_over_long_lines(name: str, delay: int) -> None:
    for b, share, end, samples in itertools.product(
        (1.0, 20.0, 400.0), (0.5, 1.0), (1.0, -1.0), (50, 200)
    ):
        found = radius(port_loop(params(b, share), DEVICES[name], 1.0, delay, samples, end))
        assert found <= 1.0 + 1e-9, (b, share, end, samples, found)


@pytest.mark.sparse(5)
@pytest.mark.parametrize("delay", [0, 1, 2, 5])
@pytest.mark.parametrize("name", DEVICES)
def test_it_never_reflects_more_than_arrives_at_any_frequency(name: str, delay: int) -> None:
    for b, share in itertools.product(IMPEDANCES, (0.25, 0.5, 0.8, 1.0)):
        response = np.abs(port_response(params(b, share), DEVICES[name], 1.0, delay, CIRCLE))
        assert response.max() <= 1.0 + 1e-12, (b, share)
        # A rigid mass believed exactly is a lossless far end itself.
        if name == "free" and share == 1.0:
            assert response.min() >= 1.0 - 1e-9


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_response_is_that_of_the_proof(delay: int) -> None:
    """S = -(D + 2 j a c) / D with the D of the docstring, up to the delay that passes both ways."""
    b, share = 100.0, 0.5
    rho, a = 1.0 / share, b * T / (2.0 * MASS)
    q = np.exp(-1j * CIRCLE)
    c = 1.0 / np.tan(0.5 * CIRCLE)
    g = (1.0 + q) * sum(q**i for i in range(delay + 1))
    assert np.allclose(g, -1j * c * (1.0 - q ** (delay + 1)), rtol=1e-9)
    d = 1.0 - 1j * a * c + (rho - 1.0) * a * g
    expected = -(d + 2j * a * c) / d * q ** (delay + 1)
    measured = port_response(params(b, share), FREE, 1.0, delay, CIRCLE)
    assert np.allclose(measured, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_an_overestimated_mass_is_unstable_somewhere(delay: int) -> None:
    found = max(
        radius(port_loop(params(b, 1.25), FREE, 1.0, delay, samples, end))
        for b, samples, end in itertools.product((20.0, 100.0, 400.0), (1, 2, 7), (1.0, -1.0))
    )
    assert found > 1.0 + 1e-4


@pytest.mark.parametrize("delay", [0, 1])
@pytest.mark.parametrize("gain", [0.5, 0.2])
def test_velocity_tracking_keeps_it_stable_where_the_impedance_is_moderate(
    gain: float, delay: int
) -> None:
    """With a free or damped device everywhere; with a hand up to b T / m = gain / 2."""
    for (name, device), share, end, samples in itertools.product(
        DEVICES.items(), (0.5, 1.0), (1.0, -1.0), (1, 7, 20)
    ):
        for b in IMPEDANCES:
            if name == "hand" and b * T / MASS > 0.5 * gain:
                continue
            found = radius(port_loop(params(b, share), device, gain, delay, samples, end))
            assert found <= 1.0 + 1e-9, (name, b, share, end, samples, found)


def test_velocity_tracking_with_a_hand_and_a_large_impedance_rests_on_the_account() -> None:
    """The linear part alone is active there: known, and the reason why the account has to stay."""
    found = radius(port_loop(params(400.0), HAND, 0.2, 0, 7, 1.0))
    assert 1.001 < found < 1.003


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_a_steady_force_that_nobody_predicts_costs_b_T_over_m_of_the_effort(share: float) -> None:
    """At rest in a hand's steady grip, R (1 + b T / believed mass) = -root a: known, not free."""
    b, arriving, effort = 20.0, -0.7, 0.0
    p = params(b, share)
    for _ in range(200):
        effort, _ = port_effort(p, RICH, -p.half_mobility * effort, arriving)
    assert effort * (1.0 + b * T / (share * MASS)) == pytest.approx(-p.root * arriving, rel=1e-12)


# -- the counterexamples -----------------------------------------------------------------------


def test_the_naive_port_is_unstable() -> None:
    assert radius(naive_loop(10.0, T, FREE, 2, 1.0)) == pytest.approx(1.00995, abs=5e-6)
    assert radius(port_loop(params(10.0), FREE, 1.0, 0, 2, 1.0)) <= 1.0 + 1e-9


@pytest.mark.parametrize("damping", [0.0, 2.0, 20.0, 200.0])
@pytest.mark.parametrize("end", [1.0, -1.0])
def test_the_naive_port_is_unstable_at_any_device_damping(damping: float, end: float) -> None:
    for b, samples in itertools.product((5.0, 20.0, 400.0), (2, 7, 50)):
        assert radius(naive_loop(b, T, Device(MASS, damping), samples, end)) > 1.0 + 1e-9


def test_a_predictor_that_forgets_the_command_delay_is_unstable() -> None:
    """Fix A of theory 3.3 as written, on a device that acts one period later."""

    def loop(b: float, samples: int, end: float) -> float:
        mobility = T / (2.0 * MASS)
        root = math.sqrt(2.0 * b)
        row_x, row_v = FREE.flow(T)

        def cycle(state: list[float]) -> list[float]:
            moved, v, last, acting, wave, *line = state
            mean = moved / T
            leaving = root * mean - wave  # from the measured velocity, but the newest wave
            arriving = end * line[0]
            effort = (b * (mean - mobility * last) - root * arriving) / (1.0 + b * mobility)
            displacement = row_x[1] * v + row_x[2] * acting
            return [
                displacement,
                v + row_v[2] * acting,
                effort,  # believed to act now
                effort,  # acts one period later
                arriving,
                *line[1:],
                leaving,
            ]

        return radius(matrix_of(cycle, 5 + samples))

    worst = max(loop(b, m, end) for b in (20.0, 100.0) for m in (2, 7) for end in (1.0, -1.0))
    assert worst > 1.001
    assert all(
        radius(port_loop(params(b), FREE, 1.0, 1, m, end)) <= 1.0 + 1e-9
        for b in (20.0, 100.0)
        for m in (2, 7)
        for end in (1.0, -1.0)
    )


# -- matched ends ------------------------------------------------------------------------------


def test_a_matched_port_on_a_blocked_device_returns_nothing() -> None:
    p = port_params(T, 10.0, 1e18, True, 0.05, 0.0)
    for arriving in (1.0, -0.3, 1e-6):
        effort, _ = port_effort(p, RICH, 0.0, arriving)
        leaving, _, _, absorbed, burnt, _ = port_close(
            p, RICH, 0.0, 0.0, 1.0, 0.0, effort, arriving, 0.5 * T * arriving**2
        )
        assert abs(leaving) <= 1e-12 * abs(arriving)
        assert burnt == pytest.approx(0.5 * T * arriving**2, rel=1e-12)
        assert abs(absorbed + burnt - 0.5 * T * arriving**2) <= 1e-12 * burnt


@pytest.mark.parametrize("delay", [0, 1])
def test_a_matched_port_is_passive_too(delay: int) -> None:
    for b, share, (_, device) in itertools.product(IMPEDANCES, (0.5, 1.0), DEVICES.items()):
        response = np.abs(port_response(params(b, share, True), device, 1.0, delay, CIRCLE))
        assert response.max() <= 1.0 + 1e-12


# -- the account -------------------------------------------------------------------------------

finite = st.floats(-1e3, 1e3)


@given(
    st.floats(0.1, 1000.0), st.floats(0.01, 10.0), st.booleans(), st.floats(-1.0, 1.0),
    finite, st.integers(1, 5), finite, finite, st.floats(-1, 1),
)  # fmt: skip
def test_nothing_leaves_that_the_account_cannot_pay(
    b: float, mass: float, matched: bool, account: float, moved: float, periods: int,
    effort: float, wave: float, gap: float,
) -> None:  # fmt: skip
    p = port_params(T, b, mass, matched, 0.05, 0.0)
    energy = 0.5 * T * wave * wave
    span = periods * T
    leaving, after, _, absorbed, burnt, forgiven = port_close(
        p, account, gap, moved, float(periods), moved / span, effort, wave, energy
    )
    flow = abs(account) + abs(effort * moved) + burnt + energy
    assert forgiven == 0.0
    funds = account + effort * (moved - span * p.slip * effort) + energy
    if funds <= 0.0:
        assert leaving == 0.0
    else:
        assert 0.5 * T * leaving * leaving <= funds * (1.0 + 1e-12)
        assert after >= -1e-12 * flow
    # Its own books: what came in is what is held.
    assert abs(absorbed - (after - account)) <= 1e-12 * flow
    assert abs(absorbed + burnt + 0.5 * T * leaving**2 - effort * moved - energy) <= 1e-12 * flow


@given(
    st.floats(0.1, 1000.0), st.floats(0.01, 10.0), st.booleans(), st.floats(-1, 10), finite, finite
)
def test_no_effort_is_planned_to_give_what_is_not_there(
    b: float, mass: float, matched: bool, account: float, coast: float, arriving: float
) -> None:
    p = port_params(T, b, mass, matched, 0.05, 0.0)
    effort, ahead = port_effort(p, account, coast, arriving)
    free, _ = port_effort(p, RICH, coast, arriving)
    assert abs(effort) <= abs(free)
    assert ahead == coast - p.half_mobility * effort
    given = -effort * (ahead - p.slip * effort) * T
    funds = max(0.0, account + 0.5 * T * arriving * arriving)
    scale = abs(effort) * (abs(coast) + p.half_mobility * abs(effort)) * T + funds
    assert given <= funds + 1e-12 * scale


@given(st.floats(0.1, 1000.0), st.floats(0.01, 10.0), finite, finite)
def test_an_unclipped_port_on_a_mass_it_knows_keeps_the_wave_identity(
    b: float, mass: float, coast: float, arriving: float
) -> None:
    """Planned energy into the port is exactly (leaving**2 - arriving**2) / 2 over the period."""
    p = port_params(T, b, mass, False, 0.05, 0.0)
    effort, ahead = port_effort(p, RICH, coast, arriving)
    leaving, *_ = port_close(p, RICH, 0.0, ahead * T, 1.0, ahead, effort, arriving, 0.0)
    scale = leaving**2 + arriving**2 + 1e-30
    assert abs(effort * ahead - 0.5 * (leaving**2 - arriving**2)) <= 1e-11 * scale


def test_an_unsent_wave_integral_is_repaid_with_the_drift_time() -> None:
    p = port_params(T, 10.0, MASS, False, 0.05, 0.0)
    gap, sent = 1e-3, 0.0
    for _ in range(1000):
        leaving, _, gap, *_ = port_close(p, RICH, gap, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)
        sent += T * leaving
    assert sent == pytest.approx(1e-3, rel=1e-6)
    one_time_constant = (1.0 - p.repay) ** 50
    assert one_time_constant == pytest.approx(math.exp(-1.0), rel=0.02)


def test_the_account_forgives_sensor_noise_up_to_its_allowance_and_says_so() -> None:
    p = port_params(T, 10.0, MASS, False, 0.05, 1e-6)
    *_, absorbed, _, forgiven = port_close(p, 0.0, 0.0, -1e-9, 1.0, -1e-6, 1.0, 0.0, 0.0)
    assert absorbed == -1e-9
    assert forgiven == pytest.approx(1e-9)
    _, account, _, absorbed, _, forgiven = port_close(p, 0.0, 0.0, -1e-5, 2.0, -1e-2, 1.0, 0.0, 0.0)
    assert forgiven == pytest.approx(2e-6)
    assert account == pytest.approx(-1e-5 + 2e-6)


def test_the_allowance_covers_what_a_noisy_encoder_feigns() -> None:
    """Twice the mean of what measured energy loses per period on a device at rest."""
    rng = np.random.default_rng(5)
    b, noise, gain = 10.0, 1e-5, 0.5
    p = port_params(T, b, 1e9, False, 0.05, 0.0)
    seen = noise * rng.standard_normal(40_000)
    velocity = feigned = effort = 0.0
    for k in range(1, len(seen)):
        moved = float(seen[k] - seen[k - 1])
        feigned += effort * moved
        velocity = track_velocity(gain, velocity, moved, T)
        effort, _ = port_effort(p, RICH, velocity, 0.0)
    mean = -feigned / (len(seen) - 1)
    assert mean == pytest.approx(0.5 * sensor_allowance(T, b, gain, 0.0, noise), rel=0.05)


@given(st.floats(0, 1), finite, st.floats(-1, 1), st.integers(1, 9))
def test_tracker_ends_between_prediction_and_measurement(
    gain: float, predicted: float, moved: float, periods: int
) -> None:
    assume(abs(moved) < 1.0)
    span = periods * T
    tracked = track_velocity(gain, predicted, moved, span)
    low, high = sorted((predicted, moved / span))
    slack = 1e-12 * (abs(low) + abs(high))
    assert low - slack <= tracked <= high + slack
    assert track_velocity(0.0, predicted, moved, span) == predicted


def test_rigid_port_does_not_predict() -> None:
    p = rigid_port(T, 10.0, 0.05, 1e-9)
    assert (p.half_mobility, p.divisor, p.slip) == (0.0, 1.0, 0.0)
    assert p.root == math.sqrt(20.0)


@pytest.mark.parametrize("share", [0.9, 0.5, 0.1, 0.0, -1.0])
def test_with_a_debt_it_plans_to_give_only_what_is_left(share: float) -> None:
    """Most is asked for where the port matches the device: funds are `share` of what arrives."""
    p = params(10.0)
    arriving = 2.0
    energy = 0.5 * T * arriving**2
    account = (share - 1.0) * energy
    coast = p.root * arriving / (2.0 * 10.0)
    wanted, _ = port_effort(p, RICH, coast, arriving)
    effort, ahead = port_effort(p, account, coast, arriving)
    assert -wanted * (coast - p.half_mobility * wanted) * T > 0.9 * energy
    assert -effort * ahead * T <= max(0.0, share) * energy * (1.0 + 1e-12)
    if share <= 0.0:
        assert effort == 0.0
    else:
        assert -effort * ahead * T >= 0.9 * share * energy
