"""Hybrid matrices, Llewellyn and scattering: theory's tables, and random hands by delayed roots."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest

from tautwave.analysis.exact.delay_roots import DelayLoop
from tautwave.analysis.exact.polynomials import Poly, add, multiply, scale
from tautwave.analysis.ports.two_port import (
    Ends,
    destabilising_ends,
    llewellyn,
)
from tests.analysis.reference.absolute import absolute_stability, refined_minimum
from tests.analysis.reference.delay_loops import unstable_count
from tests.analysis.reference.hybrids import (
    Channels,
    Rig,
    four_channel,
    position_force,
    position_position,
    scattering_matrix,
    scattering_norm,
    wave_line,
)

INF = math.inf
W = 1j * np.geomspace(1e-2, 1e3, 1500)


def position_loop(rig: Rig, ends: Ends) -> DelayLoop:
    """Closed loop of a position pair between a hand and an environment, times s**2."""

    def exact(*values: float) -> Poly:
        return tuple(Fraction(value) for value in values)

    coupler = exact(rig.damping, rig.stiffness)
    (mh, bh, kh), (me, be, ke) = ends
    master = add(exact(rig.master_mass + mh, rig.master_damping + bh, kh), coupler)
    slave = add(exact(rig.slave_mass + me, rig.slave_damping + be, ke), coupler)
    crossing = scale(multiply(coupler, coupler), -1)
    return DelayLoop(multiply(master, slave), crossing, rig.to_slave_s + rig.to_master_s)


def random_rig(rng: np.random.Generator) -> Rig:
    def spread(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    stiffness, tau = spread(10, 2000), spread(1e-3, 0.2)
    size = stiffness * tau
    return Rig(
        spread(0.05, 2),
        size * spread(0.2, 6),
        spread(0.05, 2),
        size * spread(0.2, 6),
        stiffness,
        size * spread(0.01, 1) * float(rng.integers(2)),
        tau * float(rng.uniform(0.5, 1)),
        tau,
    )


# -- absolute stability against roots --------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.nightly
def test_hundred_random_passive_terminations_agree_with_llewellyn() -> None:
    rng = np.random.default_rng(11)
    passed = failed = 0
    while passed < 70 or failed < 30:
        rig = random_rig(rng)
        found = absolute_stability(lambda s, rig=rig: position_position(rig, s), 1e-3, 3e3, 400)
        if found.stable and passed < 70:
            passed += 1
            values = np.exp(rng.uniform(np.log(1e-3), np.log(1e4), 6)).tolist()
            ends = Ends(tuple(values[:3]), tuple(values[3:]))
            assert unstable_count(position_loop(rig, ends)) == 0
        elif not found.stable and failed < 30:
            failed += 1
            ends = destabilising_ends(lambda s, rig=rig: position_position(rig, s), found.frequency)
            assert ends is not None
            assert min(*ends.hand, *ends.environment) >= 0.0
            assert unstable_count(position_loop(rig, ends)) > 0


@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("tau", [1e-3, 0.05])
def test_position_pair_needs_b_of_k_tau(share: float, tau: float) -> None:
    # b_m b_s >= (K tau)^2, Nuno et al.: the same number as Llewellyn's
    stiffness = 800.0
    for ratio in (1.0, 3.0):
        master, slave = stiffness * tau * share * ratio, stiffness * tau * share / ratio
        rig = Rig(0.5, master, 0.5, slave, stiffness, 0.0, tau, tau)
        found = absolute_stability(lambda s, rig=rig: position_position(rig, s), 1e-3, 3e3)
        assert found.stable == (share > 1.0)
        if not found.stable:  # low frequencies fail first
            assert found.frequency < 1.0 / tau


def test_without_delay() -> None:
    rig = Rig(0.5, 0.1, 0.5, 0.1, 1000.0, 10.0)
    assert absolute_stability(lambda s: position_position(rig, s), 1e-3, 1e4).stable
    assert not absolute_stability(lambda s: position_force(rig, s), 1e-3, 1e4).stable
    control = absolute_stability(lambda s: position_force(rig, s, measured=False), 1e-3, 1e4)
    assert control.stable
    late = rig._replace(to_slave_s=1e-3, to_master_s=1e-3)
    assert not absolute_stability(
        lambda s: position_force(late, s, measured=False), 1e-3, 1e4
    ).stable


def test_formulas_of_section_6() -> None:
    rig = Rig(0.4, 1.0, 0.6, 2.0, 300.0, 7.0, 0.02, 0.03)
    s = W
    c, zm, zs = 7.0 + 300.0 / s, 0.4 * s + 1.0, 0.6 * s + 2.0
    e1, e2 = np.exp(-s * 0.02), np.exp(-s * 0.03)
    h = position_position(rig, s)
    assert h.h11 == pytest.approx(zm + c - c * c * e1 * e2 / (zs + c), rel=1e-9, abs=1e-9)
    assert h.h12 == pytest.approx(c * e2 / (zs + c), rel=1e-12)
    assert h.h21 == pytest.approx(-c * e1 / (zs + c), rel=1e-12)
    assert h.h22 == pytest.approx(1 / (zs + c), rel=1e-12)
    f = position_force(rig, s, force_scale=0.7)
    assert f.h11 == pytest.approx(zm, rel=1e-12)
    assert f.h12 == pytest.approx(0.7 * e2, rel=1e-12)
    g = position_force(rig, s, force_scale=0.7, measured=False)
    reported = zm + 0.7 * e2 * c * (e1 - c * e1 / (zs + c))
    assert g.h11 == pytest.approx(reported, rel=1e-9, abs=1e-9)
    assert g.h12 == pytest.approx(0.7 * e2 * c / (zs + c), rel=1e-12)
    still = position_position(rig, np.zeros(1, complex))
    assert still.h11[0] == pytest.approx(1.0 + 2.0 + 300.0 * 0.05)
    assert still.h22[0] == 0.0


# -- four channels ---------------------------------------------------------------------------------


@pytest.mark.parametrize("tau", [0.0, 0.05])
def test_four_channels(tau: float) -> None:
    s = np.array([10j])
    one = np.ones(1, complex)
    cm, cs = 5 + 100 / s, 20 + 400 / s
    zm, zs = 0.5 * s + 1, 0.7 * s + 2
    rig = Rig(0.5, 1.0, 0.7, 2.0, 1.0, 0.0, tau, tau)
    channels = Channels(cm, cs, zs + cs, 0.8 * one, 1.3 * one, -(zm + cm), 0.3 * one, -0.2 * one)
    h = four_channel(rig, s, channels)
    if tau == 0.0:
        assert np.abs(np.array([h.h11, h.h12 - 1, h.h21 + 1, h.h22])).max() < 1e-14
    else:
        assert h.h11[0] == pytest.approx(6.36 + 3.84j, abs=5e-3)


# -- waves -----------------------------------------------------------------------------------------


def test_the_line_is_a_transmission_line() -> None:
    # Z_in = b (Z_e + b tanh s tau) / (b + Z_e tanh s tau)
    b, tau = 10.0, 0.05
    rig = Rig(0.0, 0.0, 0.0, 0.0, INF, 0.0, tau, tau, b)
    s = 0.3 + W[:1200]
    h = wave_line(rig, s)
    for load in (0.7 * s + 3.0, 40.0 / s, np.full_like(s, b)):
        felt = h.h11 - h.h12 * h.h21 * load / (1.0 + h.h22 * load)
        tanh = np.tanh(s * tau)
        assert felt == pytest.approx(b * (load + b * tanh) / (b + load * tanh), rel=1e-9)


def test_d12_mass_and_stiffness_of_the_rig() -> None:
    rig = Rig(0.5, 0.0, 0.5, 0.0, 100.0, 10.0, 0.05, 0.05, 10.0)
    s = np.array([1e-4j])
    h = wave_line(rig, s)
    assert (h.h11 / s)[0].real == pytest.approx(1.5, rel=1e-3)
    clamped = (h.h11 - h.h12 * h.h21 / h.h22) * s
    assert clamped[0].real == pytest.approx(66.6667, rel=1e-3)
    damped = rig._replace(master_damping=1.0, slave_damping=1.0)
    s = np.array([1e-4 + 0j])
    assert ((wave_line(damped, s).h11 - 2.0) / s)[0].real == pytest.approx(1.485, rel=1e-3)


@pytest.mark.sparse(3)
@pytest.mark.parametrize("matched", [False, True])
@pytest.mark.parametrize(("stiffness", "damping"), [(INF, 0.0), (100.0, 10.0), (500.0, 0.0)])
def test_waves_are_absolutely_stable_and_passive_at_any_delay(
    stiffness: float, damping: float, matched: bool
) -> None:
    for delays in ((0.05, 0.03), (0.001, 0.4)):
        rig = Rig(0.5, 0.0, 0.5, 0.0, stiffness, damping, *delays, 10.0)
        found = absolute_stability(
            lambda s, rig=rig: wave_line(rig, s, matched=matched), 1e-2, 500.0, 3000
        )
        assert found.stable
        norm = scattering_norm(wave_line(rig, W, matched=matched), 10.0)
        assert norm.max() <= 1.0 + 1e-9


def test_a_lossless_line_sits_on_the_limit() -> None:
    rig = Rig(0.5, 0.0, 0.5, 0.0, INF, 0.0, 0.05, 0.03, 10.0)
    found = absolute_stability(lambda s: wave_line(rig, s), 1e-2, 500.0)
    assert found.stable
    assert found.eta == pytest.approx(1.0, abs=1e-9)


def test_scattering_of_a_line_is_its_delay() -> None:
    rig = Rig(0.0, 0.0, 0.0, 0.0, INF, 0.0, 0.05, 0.02, 10.0)
    s = np.array([7j])
    reported = np.array([[0, np.exp(-0.02 * s[0])], [np.exp(-0.05 * s[0]), 0]])
    found = scattering_matrix(wave_line(rig, s), 10.0)[0]
    assert np.abs(found) == pytest.approx(np.abs(reported), abs=1e-12)
    assert found[1, 0] == pytest.approx(reported[1, 0], abs=1e-12)


def test_a_delayed_position_pair_is_not_passive() -> None:
    rig = Rig(0.5, 0.1, 0.5, 0.1, 100.0, 1.0, 0.05, 0.05)
    assert scattering_norm(position_position(rig, W), 10.0).max() > 1.05
    prompt = rig._replace(to_slave_s=0.0, to_master_s=0.0)
    assert scattering_norm(position_position(prompt, W), 10.0).max() <= 1.0 + 1e-12


def test_the_least_is_refined_beyond_the_grid() -> None:
    place, value = refined_minimum(
        lambda x: (x - 1.23456789) ** 2 - 1.0, np.geomspace(0.1, 10.0, 7)
    )
    assert place == pytest.approx(1.23456789, abs=1e-7)
    assert value == pytest.approx(-1.0, abs=1e-12)


def test_eta_keeps_its_digits_towards_standstill() -> None:
    # (b_m + b_s + 2 K tau) b_s >= (K tau + b_s)^2: share independent of the frequency
    rig = Rig(0.5, 12.0, 0.5, 9.0, 200.0, 0.0, 0.05, 0.05)
    shares = [llewellyn(position_position(rig, np.array([1j * w])))[1][0] for w in (1e-5, 1e-3)]
    gain, turned = 2 * (12 + 9 + 20) * 9, 2 * (10 + 9) ** 2
    assert shares[1] == pytest.approx((gain - turned) / (gain + turned), rel=1e-3)
    assert shares[0] in (0.0, pytest.approx(shares[1], rel=1e-3))
