"""The wave port without observer and filter: passive against every lossless far end.

Its proof for a free mass m, a believed mass m / rho, and n periods of command delay: with q = 1/z,
a = b T / (2 m), c = cot(theta/2), the held effort gives the mean velocity V = j (T/2m) c R, and
S = -(D + 2 j a c) / D with D = 1 - j a c + (rho - 1) a g, g = (1+q)(1 + q + ... + q**n). As
Im g <= 0, |S| <= 1. The obvious port is kept here as the counterexample.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tautwave.laws.observer import plain_observer
from tautwave.laws.port import port_close, port_effort, port_params
from tautwave.laws.velocity import track_velocity
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


def params(b: float, share: float = 1.0, matched: bool = False, delay: int = 0):
    return port_params(T, b, share * MASS, delay=delay, matched=matched, reserve=RICH)


def seen(share: float = 1.0):
    return plain_observer(T, share * MASS)


@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("name", DEVICES)
def test_no_lossless_far_end_makes_it_unstable(name: str, delay: int) -> None:
    for b, share, end, samples in itertools.product(
        IMPEDANCES, (0.5, 0.8, 1.0), (1.0, -1.0), (1, 2, 7, 20)
    ):
        found = radius(port_loop(params(b, share), seen(share), DEVICES[name], delay, samples, end))
        assert found <= 1.0 + 1e-9, (b, share, end, samples, found)


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0, 1, 2])
@pytest.mark.parametrize("name", DEVICES)
def test_no_lossless_far_end_makes_it_unstable_over_long_lines(name: str, delay: int) -> None:
    for b, share, end, samples in itertools.product(
        (1.0, 20.0, 400.0), (0.5, 1.0), (1.0, -1.0), (50, 200)
    ):
        found = radius(port_loop(params(b, share), seen(share), DEVICES[name], delay, samples, end))
        assert found <= 1.0 + 1e-9, (b, share, end, samples, found)


@pytest.mark.sparse(5)
@pytest.mark.parametrize("delay", [0, 1, 2, 5])
@pytest.mark.parametrize("name", DEVICES)
def test_it_never_reflects_more_than_arrives_at_any_frequency(name: str, delay: int) -> None:
    for b, share in itertools.product(IMPEDANCES, (0.25, 0.5, 0.8, 1.0)):
        response = np.abs(
            port_response(params(b, share), seen(share), DEVICES[name], delay, CIRCLE)
        )
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
    measured = port_response(params(b, share), seen(share), FREE, delay, CIRCLE)
    assert np.allclose(measured, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2])
def test_an_overestimated_mass_is_unstable_somewhere(delay: int) -> None:
    found = max(
        radius(port_loop(params(b, 1.25), seen(1.25), FREE, delay, samples, end))
        for b, samples, end in itertools.product((20.0, 100.0, 400.0), (1, 2, 7), (1.0, -1.0))
    )
    assert found > 1.0 + 1e-4


# -- the counterexamples -----------------------------------------------------------------------


def test_the_naive_port_is_unstable() -> None:
    assert radius(naive_loop(10.0, T, FREE, 2, 1.0)) == pytest.approx(1.00995, abs=5e-6)
    assert radius(port_loop(params(10.0), seen(), FREE, 0, 2, 1.0)) <= 1.0 + 1e-9


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
        radius(port_loop(params(b), seen(), FREE, 1, m, end)) <= 1.0 + 1e-9
        for b in (20.0, 100.0)
        for m in (2, 7)
        for end in (1.0, -1.0)
    )


# -- matched ends ------------------------------------------------------------------------------


def test_a_matched_port_on_a_blocked_device_returns_nothing() -> None:
    p = port_params(T, 10.0, 1e18, matched=True, reserve=RICH)
    for arriving in (1.0, -0.3, 1e-6):
        effort = port_effort(p, RICH, 0.0, 0.0, 0.0, arriving)
        energy = 0.5 * T * arriving**2
        leaving, _, _, _, absorbed, dissipated, _ = port_close(
            p, RICH, 0.0, 0.0, 0.0, 0.0, 1.0, effort, arriving, energy, False
        )
        assert abs(leaving) <= 1e-12 * abs(arriving)
        assert dissipated == pytest.approx(energy, rel=1e-12)
        assert abs(absorbed + dissipated - energy) <= 1e-12 * dissipated


@pytest.mark.parametrize("delay", [0, 1])
def test_a_matched_port_is_passive_too(delay: int) -> None:
    for b, share, (_, device) in itertools.product(IMPEDANCES, (0.5, 1.0), DEVICES.items()):
        response = np.abs(port_response(params(b, share, True), seen(share), device, delay, CIRCLE))
        assert response.max() <= 1.0 + 1e-12


# -- the tank ----------------------------------------------------------------------------------

finite = st.floats(-1e3, 1e3)


@given(
    st.floats(0.1, 1000.0), st.floats(0.01, 10.0), st.booleans(), st.floats(-1.0, 1.0),
    finite, st.integers(1, 5), finite, finite, st.floats(-1, 1), st.booleans(),
)  # fmt: skip
def test_nothing_leaves_that_the_tank_cannot_pay(
    b: float, mass: float, matched: bool, account: float, moved: float, periods: int,
    effort: float, wave: float, gap: float, cut: bool,
) -> None:  # fmt: skip
    p = port_params(T, b, mass, matched=matched, reserve=1.0)
    energy = 0.5 * T * wave * wave
    span = periods * T
    leaving, after, _, _, absorbed, dissipated, spilled = port_close(
        p, account, gap, 0.0, moved, moved, float(periods), effort, wave, energy, cut
    )
    flow = abs(account) + abs(effort * moved) + dissipated + energy
    funds = account + effort * (moved - span * p.slip * effort) + energy
    if funds <= 0.0:
        assert leaving == 0.0
    else:
        assert 0.5 * T * leaving * leaving <= funds * (1.0 + 1e-12)
        assert after >= -1e-12 * flow
    # Its own books: what came in is what is held or spilled.
    assert abs(absorbed - (after - account) - spilled) <= 1e-12 * flow
    left = absorbed + dissipated + 0.5 * T * leaving**2
    assert abs(left - effort * moved - energy) <= 1e-12 * flow


@given(
    st.floats(0.1, 1000.0), st.floats(0.01, 10.0), st.booleans(), st.floats(-1, 10), finite, finite
)
def test_no_effort_is_planned_to_give_what_is_not_there(
    b: float, mass: float, matched: bool, account: float, free_velocity: float, arriving: float
) -> None:
    p = port_params(T, b, mass, matched=matched, reserve=RICH)
    effort = port_effort(p, account, free_velocity, 0.0, 0.0, arriving)
    free = port_effort(p, RICH, free_velocity, 0.0, 0.0, arriving)
    assert abs(effort) <= abs(free)
    ahead = free_velocity - p.half_mobility * effort
    given = -effort * (ahead - p.slip * effort) * T
    funds = max(0.0, account + 0.5 * T * arriving * arriving)
    scale = abs(effort) * (abs(free_velocity) + p.half_mobility * abs(effort)) * T + funds
    assert given <= funds + 1e-12 * scale


@given(st.floats(0.1, 1000.0), st.floats(0.01, 10.0), finite, finite)
def test_an_unclipped_port_on_a_mass_it_knows_keeps_the_wave_identity(
    b: float, mass: float, free_velocity: float, arriving: float
) -> None:
    """Planned energy into the port is exactly (leaving**2 - arriving**2) / 2 over the period."""
    p = port_params(T, b, mass, reserve=RICH)
    effort = port_effort(p, RICH, free_velocity, 0.0, 0.0, arriving)
    ahead = free_velocity - p.half_mobility * effort
    moved = ahead * T
    leaving, *_ = port_close(p, RICH, 0.0, 0.0, moved, moved, 1.0, effort, arriving, 0.0, False)
    scale = leaving**2 + arriving**2 + 1e-30
    assert abs(effort * ahead - 0.5 * (leaving**2 - arriving**2)) <= 1e-11 * scale


def test_an_unsent_wave_integral_is_repaid() -> None:
    p = port_params(T, 10.0, MASS, reserve=RICH)
    gap, sent = 1e-3, 0.0
    for _ in range(1000):
        leaving, _, gap, *_ = port_close(p, RICH, gap, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, False)
        sent += T * leaving
    assert sent == pytest.approx(1e-3, rel=1e-6)


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
