"""Points in space against closed forms, and against the same network in one dimension."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from tautwave.errors import ConfigError
from tautwave_scenes.networks.live import SceneModel
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.network import Mass3d, Network3d, Port3d
from tests.scene3d.networks import momenta


def place(model: Model3d, mass: int = 0) -> np.ndarray:
    return np.array(model.arrays.x[3 * mass : 3 * mass + 3])


def speed(model: Model3d, mass: int = 0) -> np.ndarray:
    return np.array(model.arrays.v[3 * mass : 3 * mass + 3])


@pytest.mark.parametrize(
    ("scheme", "angle"),
    [
        ("symplectic", lambda w: 2.0 * math.asin(0.5 * w)),
        ("discrete_gradient", lambda w: 2.0 * math.atan(0.5 * w)),
    ],
)
@pytest.mark.parametrize("period", [1e-3, 1e-2])
def test_an_isotropic_oscillator_goes_round_an_ellipse_by_the_angle_of_its_scheme(
    scheme, angle, period
):
    """A spring without rest length is linear in space as well."""
    m, k = 0.02, 500.0
    network = Network3d(
        (Mass3d("m", m, (0.01, 0.0, -0.02), (0.5, 1.0, 0.3)),),
        (Link("k", "spring", "m", "ground", k),),
    )
    model = Model3d(network, scheme, period)
    turn = angle(math.sqrt(k / m) * period)
    start = place(model)
    model.advance([])
    first = place(model)
    for step in range(2, 500):
        model.advance([])
        want = first * math.sin(turn * step) - start * math.sin(turn * (step - 1))
        assert place(model) == pytest.approx(want / math.sin(turn), abs=1e-13)


@pytest.mark.slow
def test_two_bodies_turn_round_each_other_at_the_same_distance_at_any_step():
    """w T = 1.6: distance, energy and angular momentum stay; the angle is 2 atan(w T / 2)."""
    one, two, k, rest, r = 0.01, 0.03, 400.0, 0.05, 0.08
    mean = one * two / (one + two)
    w = math.sqrt(k * (r - rest) / (mean * r))
    period = 1.6 / w
    across = np.array([1.0, 2.0, 2.0]) / 3.0
    along = np.array([2.0, 1.0, -2.0]) / 3.0
    masses = [
        Mass3d(name, mass, tuple(share * r * across), tuple(share * w * r * along))
        for name, mass, share in (("a", one, two / (one + two)), ("b", two, -one / (one + two)))
    ]
    network = Network3d(tuple(masses), (Link("k", "spring", "a", "b", k, rest=rest),))
    model = Model3d(network, "discrete_gradient", period)
    before = momenta(model.arrays)
    for step in range(1, 2000):
        model.advance([])
        gap = place(model, 0) - place(model, 1)
        assert abs(np.linalg.norm(gap) - r) < 1e-13
        if step < 50:
            turned = 2.0 * math.atan(0.5 * w * period) * step
            want = r * (across * math.cos(turned) + along * math.sin(turned))
            assert gap == pytest.approx(want, abs=1e-13)
    assert momenta(model.arrays) == pytest.approx(before, abs=1e-14)
    assert abs(model.ledger().energy / model.start.energy - 1.0) < 3e-13


@pytest.mark.slow
def test_a_pendulum_on_a_stiff_spring_has_its_period():
    """1e7 N/m holds the bob: w T = 10 along the spring, 6e-3 across. Period by Gauss' mean."""
    length, g, period, swing = 0.25, 9.81, 1e-3, 0.6
    start = (length * math.sin(swing), 0.0, -length * math.cos(swing))
    network = Network3d(
        (Mass3d("bob", 0.1, start),),
        (Link("rod", "spring", "bob", "ground", 1e7, rest=length),),
        gravity=(0.0, 0.0, -g),
    )
    model = Model3d(network, "discrete_gradient", period)
    one, two = 1.0, math.cos(0.5 * swing)
    for _ in range(6):
        one, two = 0.5 * (one + two), math.sqrt(one * two)
    want = 2.0 * math.pi * math.sqrt(length / g) / one
    path = [start[0]]
    for _ in range(5500):
        model.advance([])
        path.append(model.arrays.x[0])
    x = np.array(path)
    at = np.flatnonzero(x[:-1] * x[1:] < 0.0)
    times = period * (at + x[at] / (x[at] - x[at + 1]))
    assert len(times) > 10
    assert 2.0 * np.mean(np.diff(times)) == pytest.approx(want, rel=2e-5)
    assert abs(model.residual()) < 1e-13


@pytest.mark.sparse(2)
@pytest.mark.parametrize("scheme", ["symplectic", "discrete_gradient"])
@pytest.mark.parametrize("way", [(0.0, 0.0, 1.0), (1 / 3, 2 / 3, 2 / 3), (-0.6, 0.0, 0.8)])
def test_a_network_on_a_line_is_the_one_dimensional_network(scheme, way):
    """Every kind of link, first node above second, under a port along the line."""
    heights = [0.0, 0.05, 0.1, 0.15]
    links = (
        Link("low", "spring", "m0", "ground", 400.0, damping=0.1, rest=0.05),
        Link("s1", "spring", "m1", "m0", 500.0, damping=0.05, rest=0.045),
        Link("s2", "nonlinear", "m2", "m1", 4e4, exponent=3.0, rest=0.05),
        Link("s3", "plastic", "m3", "m2", 200.0, limit=0.3),
        Link("oil", "damper", "m3", "m1", damping=0.1),
        Link("dry", "friction", "m2", "ground", limit=0.05),
        Link("hit", "contact", "p", "m3", 2e4, exponent=1.5, loss=0.2, rest=0.05),
        Link("kc", "spring", "p", "m3", 50.0, damping=0.05),
    )
    flat = Network(
        tuple(Mass(f"m{i}", 0.01, h + 0.05, 0.05 * i, 0.01) for i, h in enumerate(heights)),
        links,
        ("p",),
        forced=("m1",),
        gravity=2.0,
    )
    wide = Network3d(
        tuple(
            Mass3d(
                mass.name,
                mass.mass,
                tuple(mass.position * part for part in way),
                tuple(mass.velocity * part for part in way),
                mass.damping,
            )
            for mass in flat.masses
        ),
        links,
        (Port3d("p", ("axis",), (way,)),),
        forced=(("m1", way),),
        gravity=tuple(-2.0 * part for part in way),
    )
    period = 1e-4
    line, space = SceneModel(flat, scheme, period), Model3d(wide, scheme, period)
    line.reset([0.26])
    space.reset([0.26])
    greatest = 0.0
    for step in range(1000):
        at = 0.26 + 0.02 * math.sin(0.01 * step)
        push = 0.2 * math.sin(0.01 * step)
        (one,), (two,) = line.advance([at], [push]), space.advance([at], [push])
        greatest = max(greatest, abs(one))
        assert two == pytest.approx(one, abs=1e-9)
    assert greatest > 1.0
    for mass in range(4):
        assert place(space, mass) == pytest.approx(line.arrays.x[mass] * np.array(way), abs=1e-11)
    for one, two in zip(line.ledger(), space.ledger(), strict=True):
        assert two == pytest.approx(one, abs=1e-10)
    assert {k: v for k, v in space.elements().items() if k in ("s3", "dry", "hit")} == {
        k: pytest.approx(v, abs=1e-10)
        for k, v in line.elements().items()
        if k in ("s3", "dry", "hit")
    }


@pytest.mark.parametrize("k", [1e3, 1e6, 1e9])
@pytest.mark.parametrize("exponent", [1.0, 1.5, 2.0])
def test_a_ball_leaves_a_slanted_plane_as_fast_as_it_came(k, exponent):
    normal = np.array([1.0, -2.0, 2.0]) / 3.0
    side = np.array([2.0, 2.0, 1.0]) / 3.0
    start = 2.3e-3 * normal
    network = Network3d(
        (Mass3d("m", 0.1, tuple(start), tuple(3.0 * side - normal)),),
        (Link("wall", "contact", "m", "ground", k, exponent=exponent, normal=tuple(5 * normal)),),
    )
    model = Model3d(network, "discrete_gradient", 1e-3)
    for _ in range(200):
        model.advance([])
    assert speed(model) == pytest.approx(3.0 * side + normal, abs=3e-13)


def test_two_balls_meet_aslant_and_keep_energy_and_both_momenta():
    network = Network3d(
        (Mass3d("a", 0.1, (0.1, 0.012, 0.0), (-1.0, 0.0, 0.0)), Mass3d("b", 0.1)),
        (Link("balls", "contact", "a", "b", 1e8, exponent=1.5, rest=0.02),),
    )
    model = Model3d(network, "discrete_gradient", 1e-3)
    before = momenta(model.arrays)
    for _ in range(200):
        model.advance([])
    assert speed(model, 1)[0] < -0.2
    assert momenta(model.arrays) == pytest.approx(before, abs=1e-14)
    assert model.ledger().kinetic == pytest.approx(0.05, rel=1e-13)
    # Equal balls part at right angles.
    assert abs(speed(model, 0) @ speed(model, 1)) < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "order"), [("symplectic", 1), ("discrete_gradient", 2)])
def test_the_order_of_convergence(scheme, order):
    """A point that swings on a stretched spring, and round it, and a little pendulum beside."""

    def end(scheme: str, steps: int) -> np.ndarray:
        network = Network3d(
            (
                Mass3d("a", 0.05, (0.1, 0.0, 0.02), (0.0, 0.8, 0.1), 0.01),
                Mass3d("b", 0.02, (0.1, 0.1, 0.0), (0.3, 0.0, -0.2)),
            ),
            (
                Link("one", "spring", "a", "ground", 40.0, damping=0.02, rest=0.07),
                Link("two", "nonlinear", "b", "a", 800.0, exponent=2.0, rest=0.08),
            ),
            gravity=(0.0, 0.0, -9.81),
        )
        model = Model3d(network, scheme, 0.4 / steps)
        for _ in range(steps):
            model.advance([])
        return np.concatenate([place(model, 0), place(model, 1)])

    fine = end("discrete_gradient", 4000)
    errors = [float(np.abs(end(scheme, steps) - fine).max()) for steps in (125, 250, 500)]
    for one, two in pairwise(errors):
        assert math.log2(one / two) == pytest.approx(order, abs=0.12)


def test_the_exact_scheme_is_refused_with_a_sentence():
    with pytest.raises(ConfigError, match="is not linear, as its links turn; use symplectic or"):
        Model3d(Network3d((), ()), "exact", 1e-3)
