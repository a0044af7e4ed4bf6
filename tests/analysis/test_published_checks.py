"""The published numbers this project answers for, D1 to D15: one short test each, in one place.

The parts are tested in depth elsewhere; here each number stands beside its source and tolerance.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.analysis.exact.positive_real import positive_real
from tautwave.analysis.exact.rational import rational
from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import stable_stiffness, wall_mode
from tautwave.laws.limit import truncate
from tautwave.models.foam import FoamParams, foam_movement, foam_step, foam_stored
from tautwave.models.linear import linear_flow
from tautwave.models.plant import FREE, plant_cache, plant_step
from tests.analysis.reference.conversion import (
    conversion_ratio,
    held_ratio,
    hold_matrix,
    mean_magnitude,
    mean_matrix,
    pick_matrix,
    rounding_ratio,
    truncate_wave,
)
from tests.analysis.reference.resonator import cordis_stable
from tests.analysis.reference.wall_rules import bounce_gain
from tests.lab.papers.resonator_loop import (
    RESONATOR,
    Oscillator,
    closed_loop_poles,
    controller_impedance,
    critical_couplings,
    device_admittance,
    features,
)
from tests.lab.papers.resonator_sampled import Scheme, sampled_boundaries, sampled_law
from tests.laws.test_wall import PHASES, Bounce, wall
from tests.laws.waves import decode_effort, encode_wave
from tests.models.plants import plant
from tests.scene.test_delay_line import clamped, drive, flights, free, matched, rig_admittance

T = 1e-3


def test_D1_damping_a_sampled_wall_needs() -> None:
    """Colgate & Schenkel 1997, with |B| for a negative damper."""
    for K, B, needed, theta in [
        (1000.0, 0.2, 0.7, math.pi),
        (1000.0, -0.2, 0.7, 0.0),
        (5000.0, 1.0, 3.5, math.pi),
    ]:
        leak = wall_leak(SampledWall(K, B, T))
        assert leak.damping == pytest.approx(needed, rel=0, abs=1e-6)
        assert leak.theta == pytest.approx(theta, abs=1e-6)


def test_D2_damping_a_late_spring_needs() -> None:
    """Colgate & Schenkel 1997; Diolaiti et al. 2006, eq 19."""
    for delay, needed in enumerate([0.5, 1.5, 2.5, 3.5]):
        found = wall_leak(SampledWall(1000.0, period=T, delay=delay)).damping
        assert found == pytest.approx(needed, rel=0, abs=1e-6)


def test_D3_damping_with_a_filtered_velocity() -> None:
    """Form of Colgate & Brown 1995, appendix A."""
    for B, filter_s, needed in [(0.5, T, 0.6666667), (-0.5, T, 1.0), (0.5, 5 * T, 0.5454545)]:
        found = wall_leak(SampledWall(1000.0, B, T, filter_s=filter_s)).damping
        assert found == pytest.approx(needed, rel=0, abs=1e-6)


def test_D4_greatest_stable_stiffness_of_an_undamped_device() -> None:
    """Closed form of the sampled loop: alpha = 2 beta (2 - beta) / (2 + beta)."""
    m = 0.1
    for beta, alpha in [
        (0.01, 0.01980100), (0.1, 0.18095238), (0.5, 0.6), (1.0, 0.66666667), (1.5, 0.42857143),
    ]:  # fmt: skip
        limit = stable_stiffness(SampledWall(0.0, beta * m / T, T), Device(m)).limit
        assert limit * T * T / m == pytest.approx(alpha, rel=0, abs=1e-6)


def test_D5_greatest_stable_stiffness() -> None:
    """Gil et al. 2009 (a linear rule), against the exact loop, whose numbers these are."""
    for B, delay, limit in [
        (0.0, 0, 200.0333), (0.0, 1, 66.68518), (1.0, 0, 2178.4834),
        (1.0, 1, 725.38746), (5.0, 1, 3211.4264), (50.0, 1, 14017.358),
    ]:  # fmt: skip
        found = stable_stiffness(SampledWall(0.0, B, T, delay), Device(0.1, 0.1)).limit
        assert found == pytest.approx(limit, rel=1e-5)


def test_D6_a_bounce_on_a_held_spring_gains_energy() -> None:
    """Half a sample of hold is a negative damper: exp(pi w0 T / 2); derived and recomputed."""
    sampled = SampledWall(1000.0, period=T)
    assert wall_mode(sampled, Device(0.1)).radius == pytest.approx(1.0024968828, rel=0, abs=1e-9)
    ratio = np.mean([Bounce(wall(), T, phase).restitution ** 2 for phase in PHASES])
    assert ratio == pytest.approx(1.1698, rel=0, abs=3e-4)
    assert bounce_gain(sampled, 0.1) == pytest.approx(1.17009, rel=0, abs=5e-6)


def test_D7_the_virtual_resonator() -> None:
    """Berdahl et al.: its parameters, its peak, the poles of hand and resonator together."""
    got = features()
    assert got.anti_resonance_hz == pytest.approx(299.871, rel=1e-6)
    assert got.resonance_hz == pytest.approx(330.031, rel=1e-6)
    assert got.decay_s == pytest.approx(0.8, rel=1e-6)
    assert abs(controller_impedance()(2j * math.pi * 330.03)) == pytest.approx(209.302, rel=2e-6)
    assert got.peak == pytest.approx(209.302, rel=5e-5)  # its top is 0.7 mHz higher: 209.311
    for delay, poles in [
        (0.0, (-1.26393389 + 2074.52998j, -17.46858 + 144.07973j)),
        (5e-4, (-0.493804 + 2074.10339j, -13.12204 + 144.38184j)),
        (5e-5, (-1.171746 + 2074.52667j, -17.03602 + 144.12983j)),
    ]:
        for found, pole in zip(closed_loop_poles(delay=delay), poles, strict=False):
            assert abs(found - pole) <= 1e-6 * abs(pole)
            assert found.real == pytest.approx(pole.real, rel=0, abs=1e-5)


def test_D8_critical_coupling_half_a_sample_late() -> None:
    """Berdahl et al., appendix B, eq 9; at 1 ms and at 0.1 ms."""
    for delay, coupling, hz in [(0.5e-3, 3986.095, 339.472), (0.5e-4, 15058.934, 432.038)]:
        first = critical_couplings(delay)[0]
        assert first.gain == pytest.approx(coupling, rel=1e-5)
        assert first.frequency / (2 * math.pi) == pytest.approx(hz, rel=1e-5)


def test_D9_critical_coupling_on_a_sampler() -> None:
    """The same loop by discretisation, recomputed; Cadoz, Luciani & Florens 1993 for `cordis`."""
    cases: list[tuple[Scheme, float, int, float]] = [
        ("zoh", 1e-3, 0, 6319.753), ("zoh", 1e-3, 1, 5274.678),
        ("tustin", 1e-3, 0, 3584.589), ("tustin", 1e-3, 1, 3781.477),
        ("cordis", 1e-3, 0, 1779.968),
        ("zoh", 1e-4, 0, 9492.788), ("tustin", 1e-4, 0, 15039.569),
        ("cordis", 1e-4, 0, 15025.919), ("cordis", 1e-4, 1, 7326.028),
    ]  # fmt: skip
    for scheme, period, delay, coupling in cases:
        first = sampled_boundaries(period, scheme, delay, points=40)[0]
        assert first.coupling == pytest.approx(coupling, rel=1e-5)
        assert not first.stable_above


def test_D10_positive_real_or_not() -> None:
    """Six functions that are positive real and seven that are not; recomputed."""
    pade = rational(["-0.00025", 1], ["0.00025", 1])
    real = [
        device_admittance(),
        controller_impedance(),
        rational([1, 1], [1, 2]),
        rational([1, 0], [1, 0, 1]),
        rational([1, 1, 1], [1, 1, 4]),  # touches zero
        rational([1, 1000], ["0.001", 1, 0]),
    ]
    others = [
        rational([1], [1, 0, 0]),
        rational([-1], [1, 0]),
        rational([1, -1], [1, -2]),  # phase within 90 degrees everywhere, and unstable
        rational([1, 1, 1], [1, 1, 4 + 1e-12]),  # no grid sees it
        rational([1], [1, 1, 1]),
        rational(["0.5", 1000], ["0.001", 1, 0]),
        controller_impedance() * pade,
    ]
    assert [positive_real(k).positive_real for k in real] == [True] * 6
    assert [positive_real(k).positive_real for k in others] == [False] * 7


def test_D11_steps_of_a_lossless_line() -> None:
    """Niemeyer & Slotine 1991: b = 10, 50 ms, driven at 0.1 m/s."""
    efforts, speeds = drive(T, free, 600)
    assert flights(efforts[1:], T) == pytest.approx([1.0, -1.0] * 3, abs=1e-9)
    assert flights(speeds[50:], T) == pytest.approx([0.2, 0.0, 0.2, 0.0, 0.2], abs=1e-9)
    efforts, _ = drive(T, clamped, 400)
    assert flights(efforts, T) == pytest.approx([1.0, 3.0, 5.0, 7.0], rel=1e-9)
    efforts, _ = drive(T, matched, 400)
    assert efforts == pytest.approx([1.0] * 400, rel=1e-9)

    period, b, K, stretch = 1e-4, 10.0, 200.0, 0.0

    def spring(arriving: float) -> tuple[float, float]:
        nonlocal stretch  # trapezoid of the spring against the line's own effort at speed 0
        speed = (-decode_effort(arriving, 0.0, b) - K * stretch) / (b + 0.5 * K * period)
        force = K * (stretch + 0.5 * period * speed)
        stretch += period * speed
        return encode_wave(-force, speed, b), force

    _, forces = drive(period, spring, 1001)
    assert forces[1000] == pytest.approx(1.2642, rel=0, abs=2e-3)


@pytest.mark.slow
def test_D12_what_the_hand_feels_through_the_line() -> None:
    """Niemeyer & Slotine 1991: the line's mass b tau joins the rig's, its spring b / tau K's."""
    for damping, mass in [(0.0, 1.5), (1.0, 1.485)]:
        impedance = 1.0 / rig_admittance(0.3, damping, clamped_slave=False)
        assert impedance.imag / 0.3 == pytest.approx(mass, rel=1e-3)
    impedance = 1.0 / rig_admittance(0.05, 0.0, clamped_slave=True)
    assert (impedance * 0.05j).real == pytest.approx(66.6667, rel=1e-3)


def test_D13_waves_between_rates_through_rounding_and_gaps() -> None:
    """Cauchy & Schwarz for the mean; closed forms for the rest."""
    rng = np.random.default_rng(13)
    for count in (2, 8, 10, 16):
        fast = rng.integers(-500, 500, (400, count)).astype(float)
        slow = fast @ mean_matrix(count).T
        held = slow @ hold_matrix(count).T
        into = (fast**2).sum(axis=1)
        for out in (count * slow[:, 0] ** 2, (held**2).sum(axis=1)):
            assert np.all(np.cumsum(into - out) >= 0.0)
        # No gap at all where the mean of whole numbers has no rounding.
        gap = np.abs(np.cumsum(held.sum(axis=1) - fast.sum(axis=1))).max()
        assert gap <= (1e-9 if count == 10 else 0.0)
        assert conversion_ratio(mean_matrix(count)) == pytest.approx(1.0, rel=1e-12)
        assert conversion_ratio(hold_matrix(count)) == pytest.approx(1.0, rel=1e-12)
        assert conversion_ratio(pick_matrix(count)) == pytest.approx(count, rel=1e-12)
    assert mean_magnitude(20.0, 10, T) == pytest.approx(0.936105, rel=0, abs=5e-7)

    assert rounding_ratio(0.6, 1.0) == pytest.approx(2.77778, rel=0, abs=5e-6)
    for wave in rng.uniform(-5.0, 5.0, 2000).tolist():
        for cut in (truncate_wave, truncate):
            assert wave**2 - cut(wave, 0.3) ** 2 >= 0.0

    gaps = [1.0, *[math.nan] * 100]
    out = 0.0
    energy = 0.0
    for wave in gaps:
        out = out if math.isnan(wave) else wave
        energy += out**2
    assert held_ratio(100) == energy == 101.0


def foam_bounce(foam: FoamParams, mass: float, h: float) -> tuple[float, float]:
    """Speed after a bounce that enters at 1 m/s, and time in contact."""
    x, v, t, p = 0.0, 1.0, 0.0, plant(mass)
    while True:
        x, v, *_ = foam_step(p, foam, x, v, 0.0, 0.0, 0.0, h)
        t += h
        if x < 0.0:
            return -v, t - x / v


def test_D14_contacts_in_closed_form() -> None:
    """Hertz; Hunt & Crossley 1975; Kelvin & Voigt, leaving at depth 0 and at force 0."""
    zeta, m, k = 0.2, 0.1, 1000.0
    b, turn = 2.0 * zeta * math.sqrt(k * m), math.sqrt(1.0 - zeta * zeta)
    half = math.pi / (math.sqrt(k / m) * turn)
    x, v, *_ = linear_flow(k, b, m, 0.0, 0.0, 0.0, 1.0, half)
    assert (x, -v) == pytest.approx((0.0, 0.5266205993), rel=0, abs=1e-9)
    p = plant(m, wall=(k, b, 0.0, 1.0))
    cache, x, v, mode = plant_cache(p, T), -0.0003, 1.0, FREE
    for _ in range(60):
        x, v, mode, *_ = plant_step(p, cache, x, v, mode, 0.0, 0.0, 0.0, T)
    assert -v == pytest.approx(0.5717400276, rel=0, abs=1e-9)
    # Second order in the step: two steps give the limit.
    coarse, fine = 1e-5, 5e-6
    for loss, speed in [(0.5, 0.7484349316), (5.0, 0.1969802453)]:
        foam = FoamParams(1e5, 1.5, loss, 0.0, 1.0, 1)
        rough, near = (foam_bounce(foam, m, h)[0] for h in (coarse, fine))
        assert (4.0 * near - rough) / 3.0 == pytest.approx(speed, rel=0, abs=1e-9)
    hertz = FoamParams(1e5, 1.5, 0.0, 0.0, 1.0, 1)
    deepest = (2.5 * m / (2.0 * 1e5)) ** 0.4
    rough, near = (foam_bounce(hertz, m, h)[1] / deepest for h in (coarse, fine))
    assert (4.0 * near - rough) / 3.0 == pytest.approx(2.943275184, rel=0, abs=1e-9)


def test_D15_discrete_gradient_keeps_its_energy() -> None:
    """Chatziioannou & van Walstijn 2015: energy kept, and few iterations of Newton."""
    m, h = 0.01, 22.7e-6
    p = plant(m)
    for stiffness in (1e6, 1e8, 1e10):
        foam = FoamParams(stiffness, 1.5, 0.0, 0.0, 1.0, 1)
        x, v, counts = -0.00031, 1.0, []
        for _ in range(300):
            *_, count = foam_movement(foam, x, h * v, 2.0 * m / h**2, h)
            x, v, *_ = foam_step(p, foam, x, v, 0.0, 0.0, 0.0, h)
            assert sum(foam_stored(p, foam, x, v, 0.0)) == pytest.approx(0.005, rel=1e-13)
            counts += [count] if count else []
        assert v < 0.0
        assert np.mean(counts) <= 5.0  # of the steps in contact; the first may take 11
        assert max(counts) <= 12


@pytest.mark.slow
def test_D15_explicit_mass_interaction_is_stable_within_its_bound() -> None:
    """Cadoz, Luciani & Florens 1993: K' > 0, Z' > 0, K' + 2 Z' < 4, against the scheme's roots."""
    rng = np.random.default_rng(15)
    seen = [0, 0]
    for K, Z in rng.uniform((-1.0, -0.5), (5.0, 2.5), (4000, 2)).tolist():
        m, period = 10.0 ** rng.uniform(-3.0, 1.0), 10.0 ** rng.uniform(-5.0, -2.0)
        r, k = Z * m / period, K * m / period**2
        _, den = sampled_law(period, "cordis", 0.5 * k, Oscillator(m, r, 0.5 * k))
        assert den == pytest.approx([1.0, K + Z - 2.0, 1.0 - Z], rel=0, abs=1e-9)
        growth = float(np.abs(np.roots(den)).max()) - 1.0
        if abs(growth) > 1e-9:  # nearer, the sign is that of rounding
            assert (growth < 0.0) == cordis_stable(period, m, r, k), (K, Z)
            seen[growth < 0.0] += 1
    assert min(seen) > 500
    assert sum(seen) > 3990
    for K, Z in [(0.0, 1.0), (1.0, 0.0), (2.0, 1.0)]:  # the edges themselves are not stable
        assert not cordis_stable(1.0, 1.0, Z, K)
    m, r, k = (float(x) for x in RESONATOR)
    assert not cordis_stable(1e-3, m, r, k + 3000.0)  # K' > 4 at 1 ms
    assert cordis_stable(1e-4, m, r, k + 3000.0)


def test_D15_passivity_controlled_wall_returns_all_speed() -> None:
    """Hannaford & Ryu 2002: restitution 1."""
    for phase in PHASES[::4]:
        run = Bounce(wall(controlled=True), T, phase)
        assert run.restitution == pytest.approx(1.0, rel=0, abs=1e-9)
