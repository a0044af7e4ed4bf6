"""The second seed's worked example, number by number: D7, D8, D9."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy import signal

from tautwave.analysis.exact.axis import passivity_margin
from tautwave.analysis.exact.positive_real import positive_real
from tautwave.analysis.exact.rational import Delayed, rational
from tautwave.errors import ConfigError
from tests.analysis.reference.bilinear import angle_of, bilinear
from tests.analysis.reference.delay_loops import unstable_count
from tests.analysis.reference.gains import unconditionally_stable
from tests.analysis.reference.passivity_scan import scan_passivity
from tests.analysis.reference.resonator import rendered_hz, sampled_loop
from tests.lab.papers.loops import modulus_margin, revised_bode
from tests.lab.papers.resonator_loop import (
    COUPLING,
    HAND,
    RESONATOR,
    closed_loop_poles,
    controller_impedance,
    critical_couplings,
    delayed_controller,
    device_admittance,
    features,
    greatest_passive_delay,
    loop,
    table,
)
from tests.lab.papers.resonator_sampled import (
    Scheme,
    sampled_boundaries,
    sampled_law,
    sampled_poles,
)

TABLE = [  # f, |G|, ph G, |K0K|, ph K0K, with half a sample at 1 ms, at .1 ms
    (1, 0.0117821, 86.623, 394.185, -89.99996, -90.180, -90.018),
    (20, 0.068619, -69.935, 19.694, -89.9991, -93.599, -90.359),
    (100, 0.0112191, -86.784, 3.85767, -89.9945, -107.995, -91.795),
    (290, 0.00384148, -88.899, 0.386305, -89.1311, -141.331, -94.351),
    (310, 0.00359321, -88.971, 0.742263, 88.3049, 32.505, 82.725),
    (330.03, 0.00337481, -89.033, 209.302, -0.1903, -59.596, -6.131),
    (340, 0.00327571, -89.062, 5.39725, -89.1416, -150.342, -95.262),
    (1000, 0.00111306, -89.681, 0.487644, -89.9995, -269.9995, -107.9995),
]


@pytest.mark.parametrize("row", TABLE, ids=lambda row: f"{row[0]} Hz")
def test_table_2_1(row: tuple[float, ...]) -> None:
    (got,) = table(np.array([row[0]]))
    assert (got.device, got.controller) == pytest.approx((row[1], row[3]), rel=2e-6 + 5e-6)
    phases = (got.device_phase_deg, got.controller_phase_deg, *got.delayed_phase_deg)
    assert phases == pytest.approx((row[2], row[4], row[5], row[6]), abs=6e-4)


def test_eqs_7_and_8_are_the_networks() -> None:
    m, r, k = HAND
    assert device_admittance() == rational([1, 0], [m, r, k])
    d = rational([*RESONATOR])
    assert controller_impedance() == rational([COUPLING], [1, 0]) * d / (d + COUPLING)


def test_D7_frequencies_decay_and_poles() -> None:
    got = features()
    assert (got.anti_resonance_hz, got.resonance_hz) == pytest.approx((299.8709, 330.0307), 1e-6)
    assert got.decay_s == pytest.approx(0.8)
    assert (got.anti_resonance_quality, got.resonance_quality) == pytest.approx(
        (753.66, 829.46), 1e-5
    )
    assert abs(controller_impedance()(2j * math.pi * 330.03)) == pytest.approx(209.302, 2e-6)
    assert got.peak == pytest.approx(209.3107, 1e-6)  # at 330.0307 Hz; 209.302 is at 330.03 Hz
    hand = device_admittance()
    poles = hand.poles()
    assert abs(poles[0]) / (2 * math.pi) == pytest.approx(9.7621, 1e-5)
    assert -poles[0].real / abs(poles[0]) == pytest.approx(0.285024, 1e-5)


@pytest.mark.parametrize(
    ("delay", "first", "second"),
    [
        (0.0, -1.26393389 + 2074.52998j, -17.46858 + 144.07973j),
        (5e-4, -0.493804 + 2074.10339j, -13.12204 + 144.38184j),
        (5e-5, -1.171746 + 2074.52667j, -17.03602 + 144.12983j),
    ],
)
def test_D7_closed_loop_poles(delay: float, first: complex, second: complex) -> None:
    got = closed_loop_poles(delay=delay)
    assert got[0].real == pytest.approx(first.real, abs=1e-6)
    assert got[0].imag == pytest.approx(first.imag, abs=1e-5)
    assert got[1] == pytest.approx(second, abs=1e-5)
    if not delay:
        num = controller_impedance() * device_admittance()
        scipy_poles = np.roots([float(c) for c in (num + 1).num])
        assert np.min(np.abs(scipy_poles - got[0])) < 1e-6


@pytest.mark.parametrize(
    ("delay", "coupling", "hz"),
    [
        (0.5e-3, 3986.095, 339.472),
        (1.0e-3, 4050.331, 339.835),
        (1.5e-3, 4424.225, 25.961),
        (0.5e-4, 15058.934, 432.038),
        (1.0e-4, 9431.686, 387.689),
        (1.5e-4, 7335.387, 369.858),
    ],
)
def test_D8_critical_coupling_with_a_pure_delay(delay: float, coupling: float, hz: float) -> None:
    first = critical_couplings(delay)[0]
    assert first.gain == pytest.approx(coupling, rel=1e-6)
    assert first.frequency / (2 * math.pi) == pytest.approx(hz, abs=6e-4)
    for factor, unstable in ((0.999, 0), (1.001, 2)):
        assert unstable_count(loop(factor * first.gain, delay)) == unstable
        growth = closed_loop_poles(factor * first.gain, delay)[0].real
        assert (growth > 0) == (unstable > 0)


@pytest.mark.parametrize("coupling", [6000.0, 20_000.0, 50_000.0, 100_000.0])
def test_pure_delay_never_becomes_stable_again(coupling: float) -> None:
    assert unstable_count(loop(coupling, 5e-4)) > 0


SAMPLED: list[tuple[Scheme, float, int, tuple[float, ...]]] = [
    ("zoh", 1e-3, 0, (6319.753, 15895.58, 31273.236)),
    ("zoh", 1e-3, 1, (5274.678, 28528.778)),
    ("foh", 1e-3, 0, (6771.427, 21124.907, 34134.832)),
    ("foh", 1e-3, 1, (4426.307,)),
    ("tustin", 1e-3, 0, (3584.589,)),
    ("tustin", 1e-3, 1, (3781.477,)),
    ("cordis", 1e-3, 0, (1779.968,)),
    ("cordis", 1e-3, 1, (1780.032,)),
    ("cordis_late", 1e-3, 0, (1780.032,)),
    ("zoh", 1e-4, 0, (9492.788,)),
    ("zoh", 1e-4, 1, (6222.682,)),
    ("foh", 1e-4, 0, (15149.888,)),
    ("foh", 1e-4, 1, (7365.214,)),
    ("tustin", 1e-4, 0, (15039.569,)),
    ("tustin", 1e-4, 1, (7326.112,)),
    ("cordis", 1e-4, 0, (15025.919,)),
    ("cordis", 1e-4, 1, (7326.028,)),
    ("cordis_late", 1e-4, 0, (7351.015,)),
]


@pytest.mark.parametrize(("scheme", "period", "delay", "expected"), SAMPLED)
def test_D9_sampled_boundaries(
    scheme: Scheme, period: float, delay: int, expected: tuple[float, ...]
) -> None:
    found = sampled_boundaries(period, scheme, delay, points=80)
    assert [b.coupling for b in found] == pytest.approx(expected, rel=3e-7)
    assert [b.stable_above for b in found] == [bool(i % 2) for i in range(len(found))]


@pytest.mark.parametrize("scheme", ["zoh", "foh", "tustin"])
def test_discretisations_are_those_of_scipy(scheme: str) -> None:
    d = [float(x) for x in RESONATOR]
    whole = (COUPLING * np.array(d), [d[0], d[1], d[2] + COUPLING])
    method = {"tustin": "bilinear"}.get(scheme, scheme)
    num, den, _ = signal.cont2discrete(whole, 1e-3, method)
    got, below = sampled_law(1e-3, scheme)  # type: ignore[arg-type]
    np.testing.assert_allclose(below / below[0], den, rtol=1e-9)
    np.testing.assert_allclose(got / below[0], num.ravel(), rtol=1e-8, atol=1e-9)


def test_schemes_ring_at_other_pitches_or_not_at_all() -> None:
    assert rendered_hz(330.0307, 1e-3, "tustin") == pytest.approx(255.8, abs=0.05)
    assert rendered_hz(330.0307, 1e-4, "tustin") == pytest.approx(328.86, abs=0.005)
    assert rendered_hz(330.0307, 1e-4, "cordis") == pytest.approx(330.63, abs=0.006)
    assert rendered_hz(330.0307, 1e-3, "zoh") == 330.0307
    with pytest.raises(ConfigError, match=r"w T < 2 \(got 2.074\)"):
        rendered_hz(330.0307, 1e-3, "cordis")
    with pytest.raises(ConfigError, match="no scheme"):
        sampled_law(1e-3, "euler")  # type: ignore[arg-type]
    assert np.abs(sampled_poles(3000.0, 1e-3, "cordis")).max() > 1.0  # the seed's own k_c
    assert np.abs(sampled_poles(3000.0, 1e-3, "tustin")).max() < 1.0


def test_ideal_is_passive_and_eq_9_is_not_at_low_frequencies() -> None:
    ideal = controller_impedance()
    assert positive_real(ideal).positive_real
    assert 2 * greatest_passive_delay() == pytest.approx(2.4566e-7, rel=1e-5)
    for factor, passive in ((0.99, True), (1.01, False)):
        late = delayed_controller(factor * greatest_passive_delay())
        assert (late(2j * math.pi * 0.1).real > 0) == passive
    for delay in (5e-4, 5e-5):
        found = scan_passivity(delayed_controller(delay), 1.0, 2 * math.pi * 900)
        (low, end), (start, _) = found.negative
        assert low == 1.0
        assert 297 < end / 2 / math.pi < 299.8
        assert 330 < start / 2 / math.pi < 340  # passive in a narrow band only
    w = 2 * math.pi * np.linspace(314, 316, 20_001)
    phase = np.degrees(np.angle(ideal.at(1j * w)))
    assert phase.max() == pytest.approx(88.4875, abs=1e-4)
    assert w[phase.argmax()] / 2 / math.pi == pytest.approx(314.95, abs=0.02)
    assert passivity_margin(ideal).margin_deg == 0.0


def test_any_gain_is_stable_only_in_the_ideal() -> None:
    ideal = controller_impedance() * device_admittance()
    assert unconditionally_stable(ideal)
    assert revised_bode(ideal).sufficient
    for delay in (5e-4, 5e-5):
        late = Delayed(ideal, delay)
        assert revised_bode(late).stable
        assert not revised_bode(Delayed(ideal * 1000, delay)).stable
    assert modulus_margin(Delayed(ideal, 5e-4), 1.0, 1e4).margin < modulus_margin(ideal).margin


def test_modulus_margin_of_the_sampled_loop_is_that_of_the_circle() -> None:
    whole = sampled_loop(1e-3, "tustin", 1)
    found = modulus_margin(bilinear(whole))
    theta = np.linspace(1e-4, math.pi, 400_001)
    distance = np.abs(1 + whole.at(np.exp(1j * theta)))
    assert found.margin == pytest.approx(distance.min(), rel=1e-6)
    assert angle_of(found.frequency) == pytest.approx(theta[distance.argmin()], abs=1e-5)
