"""The schemes against closed forms, and the account that closes to rounding."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave_scenes.networks.compiling import compile_network
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.schemes.exact import exact_islands
from tautwave_scenes.networks.schemes.gradient import step_gradient
from tests.lab.papers.resonator_sampled import sampled_law
from tests.scene.networks import RESONATOR, everything, granular


@pytest.mark.parametrize("rate", [50.0, 1000.0, 10_000.0, 44_100.0])
def test_the_resonator_rings_at_its_own_pitch_and_decay_at_any_rate(rate):
    model = SceneModel(
        RESONATOR._replace(masses=(RESONATOR.masses[0]._replace(position=1e-3),)), "exact", 1 / rate
    )
    sigma = 0.01 / 0.008
    w = math.sqrt((14200.0 + 3000.0) / 0.004 - sigma**2)
    assert w / (2.0 * math.pi) == pytest.approx(330.0307, abs=1e-4)
    for k in range(1, 400):
        model.advance([0.0])
        t = k / rate
        want = 1e-3 * math.exp(-sigma * t) * (math.cos(w * t) + sigma / w * math.sin(w * t))
        assert model.arrays.x[0] == pytest.approx(want, abs=1e-14 + 1e-17 * w * t)


@pytest.mark.parametrize("period", [1e-3, 1e-4])
def test_the_exact_scheme_is_the_zoh_law_of_the_analysis(period):
    num, den = sampled_law(period, "zoh")
    rng = np.random.default_rng(3)
    x = rng.normal(size=300) * 1e-3
    model = SceneModel(RESONATOR, "exact", period)
    u = np.array([model.advance([value])[0] for value in x])
    want = np.zeros(300)
    for k in range(300):
        for i in range(3):
            want[k] += num[i] * x[k - i] if k >= i else 0.0
            want[k] -= den[i] * want[k - i] if 0 < i <= k else 0.0
    assert np.abs(u - want / den[0]).max() < 1e-9 * np.abs(want).max()


def without_plastic(network):
    return network._replace(links=tuple(k for k in network.links if k.kind != "plastic"))


@pytest.mark.sparse(3)
@pytest.mark.parametrize("scheme", ["symplectic", "rk4", "discrete_gradient"])
def test_every_kind_of_link_keeps_its_books(scheme):
    period = 1e-4
    network = without_plastic(everything()) if scheme == "rk4" else everything()
    model = SceneModel(network, scheme, period)
    for k in range(4000):
        model.advance([0.005 * math.sin(30 * k * period)], [math.sin(200 * k * period)])
        if k % 100 == 0:
            assert abs(model.residual()) < 1e-12
    reported = model.ledger()
    assert reported.made > 0.01
    assert reported.lost > 0.01
    elements = model.elements()
    assert {link.name for link in network.links} <= set(elements)
    for key in ("made", "lost"):
        total = math.fsum(element.get(key, 0.0) for element in elements.values())
        assert total == pytest.approx(getattr(reported, key), rel=1e-9)
    assert min(element.get("lost", 0.0) for element in model.elements().values()) > -1e-4
    if scheme == "discrete_gradient":
        assert reported.numeric == 0.0
        assert min(element.get("lost", 0.0) for element in model.elements().values()) > -1e-15


def test_the_exact_scheme_keeps_its_books_with_dampers_at_the_port():
    network = Network(
        (Mass("a", 0.004, 0.001, damping=0.01), Mass("b", 0.01)),
        (
            Link("one", "spring", "a", "ground", stiffness=14200.0, damping=0.2),
            Link("two", "spring", "hand", "b", stiffness=3000.0, damping=0.5),
            Link("three", "spring", "a", "b", stiffness=2000.0, damping=0.1, rest=1e-3),
        ),
        ("hand",),
        forced=("a",),
        gravity=9.81,
    )
    model = SceneModel(network, "exact", 1e-3)
    for k in range(2000):
        model.advance([1e-3 * math.sin(0.3 * k)], [math.sin(0.05 * k)])
        assert abs(model.residual()) < 1e-12
    assert model.ledger().lost > 0.01


@pytest.mark.parametrize("k", [1e3, 1e5, 1e7, 1e9])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0, 3.0])
def test_a_bounce_gives_back_its_speed_with_discrete_gradients(k, exponent):
    rng = np.random.default_rng(int(k) + int(10 * exponent))
    for start in rng.uniform(1e-3, 3e-3, 5):  # any phase: T must not divide the contact
        network = Network(
            (Mass("m", 0.1, float(start), -1.0),),
            (Link("wall", "contact", "m", "ground", stiffness=k, exponent=exponent),),
        )
        arrays = compile_network(network).arrays
        most = 0
        while arrays.v[0] < 0.0 or arrays.stored[0] > 0.0:
            most = max(most, step_gradient(arrays, 1e-3))
        assert abs(arrays.v[0] - 1.0) <= 1e-13
        assert most <= 40


@pytest.mark.parametrize("k", [1e3, 1e5, 1e7, 1e9])
@pytest.mark.parametrize("steps", [0.3, 2.2, 31.0, 333.0, 1000.0])
def test_a_bounce_gives_back_its_speed_however_many_steps_it_takes(k, steps):
    for exponent, phase in ((1.0, 0.11), (1.5, 0.47), (2.0, 0.73), (3.0, 0.92)):
        one = exponent + 1.0
        deepest = (one * 0.1 / (2.0 * k)) ** (1.0 / one)
        shape = math.sqrt(math.pi) * math.gamma(1.0 + 1.0 / one) / math.gamma(0.5 + 1.0 / one)
        period = 2.0 * deepest * shape / steps
        network = Network(
            (Mass("m", 0.1, phase * period, -1.0),),
            (Link("wall", "contact", "m", "ground", stiffness=k, exponent=exponent),),
        )
        arrays = compile_network(network).arrays
        while arrays.v[0] < 0.0 or arrays.stored[0] > 0.0:
            step_gradient(arrays, period)
        assert abs(arrays.v[0] - 1.0) <= 3e-14


def test_w1_symplectic_contact_converges_to_the_closed_form():
    m, k, errors = 0.1, 1000.0, []
    for steps in (173.3, 346.6, 693.2):
        period = math.pi * math.sqrt(m / k) / steps
        network = Network(
            (Mass("m", m, 0.0, -1.0),), (Link("w", "contact", "m", "ground", stiffness=k),)
        )
        model = SceneModel(network, "symplectic", period)
        deepest = 0.0
        while model.arrays.x[0] < 0.0 or model.arrays.v[0] < 0.0:
            model.advance([])
            deepest = min(deepest, model.arrays.x[0])
        errors.append(abs(-deepest - math.sqrt(m / k)) / math.sqrt(m / k))
    assert errors[2] < 0.6 * errors[1] < 0.36 * errors[0]


@pytest.mark.parametrize(
    ("zeta", "want"), [(0.05, 0.8544678930), (0.2, 0.5266205993), (0.5, 0.1630335348)]
)
def test_w2_a_spring_and_damper_give_back_what_they_should(zeta, want):
    m, k = 0.1, 1000.0
    w = math.sqrt(k / m)
    period = math.pi / (w * math.sqrt(1.0 - zeta**2)) / 97
    damping = 2.0 * zeta * math.sqrt(k * m)
    network = Network(
        (Mass("m", m, 0.0, -1.0),),
        (Link("w", "spring", "m", "ground", stiffness=k, damping=damping),),
    )
    model = SceneModel(network, "exact", period)
    for _ in range(97):
        model.advance([])
    assert model.arrays.x[0] == pytest.approx(0.0, abs=1e-12)
    assert model.arrays.v[0] == pytest.approx(want, abs=1e-9)
    assert abs(model.residual()) < 1e-14


def test_w3_hertz_contact_is_as_deep_and_as_long_as_the_closed_form():
    m, k, deepest, lasts = 0.01, 1e6, 0.6898648e-3, 2.03046204e-3
    errors = []
    for steps in (61.7, 123.4, 246.8):
        network = Network(
            (Mass("m", m, 0.0, -1.0),),
            (Link("w", "contact", "m", "ground", stiffness=k, exponent=1.5),),
        )
        arrays = compile_network(network).arrays
        period = lasts / steps
        places = [0.0]
        while arrays.v[0] < 0.0 or arrays.stored[0] > 0.0:
            step_gradient(arrays, period)
            places.append(arrays.x[0])
        at = int(np.argmin(places))
        a, b, c = places[at - 1 : at + 2]  # the parabola through the three deepest
        assert b - (c - a) ** 2 / (8.0 * (a - 2.0 * b + c)) == pytest.approx(-deepest, rel=1e-6)
        # It leaves at its own speed: where it is now tells when it left.
        errors.append(abs((len(places) - 1) * period - places[-1] / 1.0 - lasts) / lasts)
    assert errors[2] < 2e-4
    assert errors[0] / errors[2] == pytest.approx(16.0, rel=0.3)  # second order


@pytest.mark.slow
def test_w4_hunt_and_crossley_restitution():
    for a, want in ((0.5, 0.7484349316), (5.0, 0.1969802453)):
        network = Network(
            (Mass("m", 0.1, 0.0, -1.0),),
            (Link("w", "contact", "m", "ground", stiffness=1e5, exponent=1.5, loss=a),),
        )
        arrays = compile_network(network).arrays
        for _ in range(40_000):
            step_gradient(arrays, 2e-6)
        assert arrays.v[0] == pytest.approx(want, rel=2e-5)


@pytest.mark.slow
def test_w8_ten_grains_keep_their_energy_and_push_back_as_much():
    lossless = granular()
    links = tuple(link._replace(loss=0.0) for link in lossless.links)
    model = SceneModel(lossless._replace(links=links), "discrete_gradient", 1 / 44_100)
    model.reset([-0.012])
    for m in range(10):
        model.arrays.x[m] += 0.002 + 3e-4 * m  # dropped, and thrown at the bar
        model.arrays.v[m] = 0.9
    model.start = model.ledger()
    knocked = 0
    for _ in range(6000):
        (effort,) = model.advance([-0.012])
        pulls = [t for t, name in zip(model.arrays.tension, model.compiled.links, strict=True)
                 if name.startswith("bar")]  # fmt: skip
        assert effort == pytest.approx(sum(pulls), abs=1e-12)
        knocked += effort != 0.0
        assert abs(model.ledger().energy - model.start.energy) < 1e-13
    assert knocked > 50


@pytest.mark.parametrize("k", [1e6, 1e8, 1e10])
def test_d15_discrete_gradient_keeps_energy_in_five_iterations(k):
    network = Network(
        (Mass("m", 0.01, 1e-4, -1.0),),
        (Link("wall", "contact", "m", "ground", stiffness=k, exponent=1.5),),
    )
    arrays = compile_network(network).arrays
    for _ in range(200):
        assert step_gradient(arrays, 22.7e-6) <= 5
        energy = 0.005 * arrays.v[0] ** 2 + arrays.stored[0]
        assert abs(energy - 0.005) <= 1e-13 * 0.005


def test_d15_cordis_bound():
    # z**2 - (2 - K' - Z') z + (1 - Z') is stable exactly for K' + 2 Z' < 4 (and K', Z' > 0).
    for stiff, loss in ((3.9, 0.04), (3.9, 0.06), (1.0, 1.49), (1.0, 1.51), (4.1, 0.01)):
        network = Network(
            (Mass("m", 1.0, 1e-3),),
            (Link("w", "spring", "m", "ground", stiffness=stiff, damping=loss),),
        )
        model = SceneModel(network, "symplectic", 1.0)
        for _ in range(3000):
            model.advance([])
        assert (abs(model.arrays.x[0]) < 1e-3) == (stiff + 2.0 * loss < 4.0)


def test_the_exact_scheme_says_what_it_cannot_do():
    with pytest.raises(ConfigError, match="only springs and dampers"):
        exact_islands(compile_network(granular()).arrays, 1e-3)
    with pytest.raises(ConfigError, match="there are exact, symplectic, rk4, discrete_gradient"):
        SceneModel(RESONATOR, "euler", 1e-3)


def ringing_error(scheme, period, time_s):
    """Distance of three linked masses from the exact scheme's, the port held."""
    masses = tuple(Mass(f"m{at}", 0.01 * (at + 1), 1e-3 * at, 0.1, damping=0.05) for at in range(3))
    links = (
        Link("one", "spring", "hand", "m0", stiffness=2000.0, damping=0.1),
        Link("two", "spring", "m0", "m1", stiffness=1000.0, rest=1e-3),
        Link("three", "spring", "m1", "m2", stiffness=3000.0, damping=0.2),
    )
    network = Network(masses, links, ("hand",), gravity=9.81)
    model = SceneModel(network, scheme, period)
    fine = SceneModel(network, "exact", time_s)
    fine.advance([0.0])
    for _ in range(round(time_s / period)):
        model.advance([0.0])
    return max(abs(a - b) for a, b in zip(model.arrays.x, fine.arrays.x, strict=True))


def test_rk4_is_of_fourth_order():
    errors = [ringing_error("rk4", 0.064 / steps, 0.064) for steps in (128, 256, 512)]
    assert errors[-1] < 1e-9
    for coarse, fine in pairwise(errors):
        assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.2)


def test_rk4_follows_a_port_between_its_samples():
    """A straight motion of the port is no error: the closed form of a mass that is dragged."""
    network = Network(
        (Mass("m", 1.0),), (Link("k", "spring", "hand", "m", stiffness=100.0),), ("hand",)
    )
    model = SceneModel(network, "rk4", 1e-2)
    for k in range(1, 101):
        effort = model.advance([0.02 * k * 1e-2])[0]
        t = k * 1e-2
        want = 0.02 * (t - math.sin(10.0 * t) / 10.0)
        assert model.arrays.x[0] == pytest.approx(want, abs=1e-7)
        assert effort == pytest.approx(100.0 * (0.02 * t - model.arrays.x[0]), rel=1e-9, abs=1e-15)
    assert model.ledger().port_work == pytest.approx(model.ledger().energy, rel=1e-4)


@pytest.mark.parametrize("share", [0.1, 0.5, 1.5, 2.7])
def test_rk4_takes_energy_of_a_spring_and_makes_none(share):
    network = Network(
        (Mass("m", 1.0, 1e-3),), (Link("w", "spring", "m", "ground", stiffness=share**2),)
    )
    model = SceneModel(network, "rk4", 1.0)
    before = model.ledger().energy
    for _ in range(200):
        model.advance([])
        reported = model.ledger()
        assert reported.energy < before
        assert abs(model.residual()) < 1e-18
        before = reported.energy
    model.reset([])
    model.advance([])
    taken = 1.0 - model.ledger().energy / model.start.energy
    # |R(i y)|**2 = 1 - y**6 / 72 + y**8 / 576, exactly.
    assert taken == pytest.approx(share**6 / 72.0 - share**8 / 576.0, rel=1e-6)


def test_rk4_runs_away_beyond_its_bound():
    for share, stays in ((2.8, True), (2.86, False)):
        network = Network(
            (Mass("m", 1.0, 1e-3),), (Link("w", "spring", "m", "ground", stiffness=share**2),)
        )
        model = SceneModel(network, "rk4", 1.0)
        for _ in range(2000):
            model.advance([])
        assert (abs(model.arrays.x[0]) <= 1e-3) == stays


@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_rk4_gives_a_bounce_back_at_the_order_of_its_edges(exponent):
    """Closed form: the speed of a lossless bounce, at steps that divide its time by no luck."""
    worst = []
    for period in (2e-4, 5e-5):
        errors = []
        for phase in range(7):
            network = Network(
                (Mass("m", 0.1, (phase + 0.5) / 7.0 * period, -1.0),),
                (Link("w", "contact", "m", "ground", stiffness=1e4, exponent=exponent),),
            )
            model = SceneModel(network, "rk4", period)
            while model.arrays.v[0] < 0.0 or model.arrays.x[0] < 0.0:
                model.advance([])
            errors.append(abs(model.arrays.v[0] - 1.0))
            assert abs(model.residual()) < 1e-15
        worst.append(max(errors))
    assert worst[0] < 2e-3
    assert math.log2(worst[0] / worst[1]) / 2.0 > exponent + 0.7


def test_rk4_does_no_plastic_links():
    with pytest.raises(ConfigError, match="rk4 does not support plastic links"):
        SceneModel(everything(), "rk4", 1e-3)
