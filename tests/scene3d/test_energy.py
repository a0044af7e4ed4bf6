"""What networks of points keep: energy, momenta, their account; and what cannot go wrong."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks3d import live, solving
from tautwave_scenes.networks3d.arrays import compile_network3d
from tautwave_scenes.networks3d.live import SPACE_SCHEMES, Model3d
from tautwave_scenes.networks3d.network import (
    Mass3d,
    Network3d,
    Port3d,
    prune_network3d,
)
from tautwave_scenes.networks3d.tension import pull_link
from tests.examples import tried
from tests.scene3d.networks import everything, flat, free_ring, momenta, vector


@pytest.mark.slow
@settings(max_examples=20, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(3, 6),
    stiffness=st.floats(1.0, 1e5),
    period=st.floats(1e-4, 5e-3),
)
def test_free_networks_keep_energy_and_both_momenta(seed, count, stiffness, period):
    network = free_ring(seed, count, stiffness)
    model = Model3d(network, "discrete_gradient", period)
    before = momenta(model.arrays)
    for _ in range(20):
        model.advance([])
    assert model.ledger().energy == pytest.approx(model.start.energy, rel=1e-11)
    pulls = stiffness * period  # what a pull moves in a step: the scale of its rounding
    assert momenta(model.arrays) == pytest.approx(before, abs=1e-12 * (1.0 + pulls))
    assert abs(model.residual()) <= 1e-12 * model.start.energy


@settings(max_examples=tried(20), deadline=None)
@given(seed=st.integers(0, 10**6), stiffness=st.floats(1.0, 1e3))
def test_the_standard_scheme_keeps_both_momenta_and_books_what_it_makes(seed, stiffness):
    model = Model3d(free_ring(seed, 5, stiffness), "symplectic", 2e-4)
    before = momenta(model.arrays)
    for _ in range(100):
        model.advance([])
    assert momenta(model.arrays) == pytest.approx(before, abs=1e-13)
    assert abs(model.residual()) <= 1e-12 * model.start.energy
    assert model.ledger().numeric != 0.0


@pytest.mark.sparse(10)
@pytest.mark.parametrize("scheme", SPACE_SCHEMES)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_every_kind_of_link_keeps_its_books(scheme, seed):
    period = 1e-4
    model = Model3d(everything(seed), scheme, period)
    given_ = 0.0
    places, efforts = np.zeros(3), np.zeros(3)
    for k in range(1000):
        t = k * period
        now = np.array([0.01 * math.sin(30 * t), 0.01 * math.sin(20 * t), 0.005 * math.sin(50 * t)])
        given_ += float(efforts @ (now - places))
        places, efforts = now, np.array(model.advance(now.tolist(), [math.sin(200 * t)]))
        if scheme == "symplectic":  # what the axes gave is what the network got, to rounding
            assert given_ == pytest.approx(model.ledger().port_work, abs=1e-12)
        elif k % 100 == 0:
            assert abs(model.residual()) < 1e-12
    assert abs(model.residual()) < 1e-12
    reported = model.ledger()
    assert reported.made > 0.01
    assert reported.lost > 0.05
    if scheme == "discrete_gradient":
        assert reported.numeric == 0.0
        assert min(element.get("lost", 0.0) for element in model.elements().values()) > -1e-15


@pytest.mark.slow
@pytest.mark.nightly
def test_ends_on_top_of_each_other_and_straight_through():
    """No direction, no pull; a point that is shot through another goes on, its energy kept."""
    links = tuple(
        Link(f"{kind}{i}", kind, a, b, stiffness=1e4, damping=0.1, rest=0.01, limit=0.1,
             exponent=2.0)
        for i, (a, b) in enumerate((("m0", "ground"), ("m1", "m0"), ("m2", "m1")))
        for kind in ("spring", "contact", "nonlinear", "plastic", "friction", "bow")
    )  # fmt: skip
    masses = (
        Mass3d("m0", 0.01),
        Mass3d("m1", 0.01),
        Mass3d("m2", 0.01, (0.0, 0.0, 1e-3), (0.0, 0.0, -2.0)),
    )
    for scheme in SPACE_SCHEMES:
        model = Model3d(Network3d(masses, links), scheme, 1e-3)
        for _ in range(50):
            model.advance([])
        assert all(math.isfinite(value) for value in flat(model.arrays))
        assert abs(model.residual()) < 1e-11 * max(1.0, abs(model.ledger().numeric))
    through = Network3d(
        (Mass3d("m", 0.01, (1e-3, 0.0, 0.0), (-2.0, 0.0, 0.0)),),
        (Link("k", "spring", "m", "ground", 100.0, rest=0.5e-3),),
    )
    model = Model3d(through, "discrete_gradient", 1e-3)  # from 1 mm to -1 mm in one step
    model.advance([])
    assert model.arrays.x[:3] == pytest.approx([-1e-3, 0.0, 0.0], abs=1e-15)
    assert model.ledger().energy == pytest.approx(model.start.energy, rel=1e-14)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("newton", [0, 2])
def test_what_is_not_solved_turns_round_and_keeps_its_energy(monkeypatch, newton):
    """Without Newton nothing is solved, with two steps of it only pieces."""
    monkeypatch.setitem(live.ITERATIONS, "discrete_gradient", newton)
    network = free_ring(4, 5, 3e3)
    model = Model3d(network, "discrete_gradient", 2e-3)
    for _ in range(30):
        model.advance([])
        assert all(math.isfinite(x) for x in model.arrays.x)
    assert model.ledger().energy == pytest.approx(model.start.energy, rel=1e-10)
    assert model.ledger().numeric == 0.0
    stood = model.arrays.x == compile_network3d(network).arrays.x
    assert stood == (newton == 0)


@pytest.mark.slow
def test_a_step_that_does_not_arrive_is_cut_in_pieces(monkeypatch):
    counted: list[bool] = []
    whole = solving.solve_step3d

    def counting(*given):
        found = whole(*given)
        counted.append(found[1])
        return found

    monkeypatch.setattr(solving, "solve_step3d", counting)
    model = Model3d(free_ring(3, 6, 3e4), "discrete_gradient", 1e-2)
    for _ in range(40):
        model.advance([])
    assert counted.count(False) > 0
    assert model.ledger().numeric == 0.0
    assert model.ledger().energy == pytest.approx(model.start.energy, rel=1e-11)


@pytest.mark.slow
def test_a_port_feels_the_mean_over_the_pieces_of_a_step(monkeypatch):
    """What the axes gave in a step is what the points' momentum changed by, however it was cut."""
    ring = free_ring(3, 6, 3e4)
    held = Link("held", "spring", "p", "m0", 3e4, rest=0.02)
    port = Port3d("p", ("x", "y", "z"), offset=(0.0, 0.15, 0.0))
    model = Model3d(
        ring._replace(links=(*ring.links, held), ports=(port,)), "discrete_gradient", 1e-2
    )
    whole, cut = solving.solve_step3d, []
    monkeypatch.setattr(
        solving, "solve_step3d", lambda *given: (cut.append(given[3]), whole(*given))[1]
    )
    for _ in range(40):
        before = momenta(model.arrays)[:3]
        efforts = model.advance([0.0, 0.0, 0.0])
        gained = momenta(model.arrays)[:3] - before
        assert gained == pytest.approx(1e-2 * np.array(efforts), abs=1e-9)
    assert min(cut) < 1e-2


@pytest.mark.sparse(3)
@pytest.mark.parametrize("wrong", [math.nan, math.inf, 1e200])
@pytest.mark.parametrize("scheme", SPACE_SCHEMES)
def test_a_state_that_is_no_number_ends_in_no_exception_but_overflow(scheme, wrong):
    model = Model3d(everything(), scheme, 1e-4)
    model.arrays.x[1] = wrong
    for _ in range(3):
        try:
            model.advance([0.0, 0.0, 0.0])
        except ArithmeticError:  # a power that overflows: `runtime.scene` stops the run
            break


def test_derivatives_are_those_of_the_pulls():
    """Newton's matrix against differences, for every kind of link, moving ports and all."""
    rng = random.Random(5)
    s = compile_network3d(everything()).arrays
    period, n = 1e-3, 3 * s.count[0]
    for axis in range(3):
        s.v[n + axis] = rng.uniform(-1.0, 1.0)
    for mass in range(s.count[0]):
        s.work[3 * mass : 3 * mass + 3] = vector(rng, 5e-3)
    step, seen = 1e-8, 0
    for i in range(s.count[2]):
        for end, sign in ((s.a[i], 1.0), (s.b[i], -1.0)):
            if end >= s.count[0]:
                continue
            pull_link(s, i, 0, period)
            way = np.array(s.way[3 * i : 3 * i + 3])
            want = sign * (np.outer(way, s.bend[3 * i : 3 * i + 3]) + s.side[i] * np.eye(3))
            found = np.zeros((3, 3))
            for c in range(3):
                pulls = []
                for move in (step, -step):
                    before = s.work[3 * end + c]
                    s.work[3 * end + c] = before + move
                    pull_link(s, i, 0, period)
                    pulls.append(s.tension[i] * np.array(s.way[3 * i : 3 * i + 3]))
                    s.work[3 * end + c] = before
                found[:, c] = (pulls[0] - pulls[1]) / (2.0 * step)
            seen += bool(np.abs(want).max() > 0.0)
            assert found == pytest.approx(want, abs=2e-5 * np.abs(want).max() + 1e-6)
    assert seen > 15


@pytest.mark.sparse(3)
@pytest.mark.parametrize("scheme", SPACE_SCHEMES)
def test_pruning_changes_no_bit(scheme):
    base = everything()
    more = base._replace(
        masses=(Mass3d("far1", 0.1), *base.masses, Mass3d("far2", 0.1, (1.0, 0.0, 0.0))),
        links=(
            Link("far", "spring", "far1", "far2", 10.0, rest=0.5),
            *base.links,
            base.links[0]._replace(name="twin"),
        ),
        grounds=(*base.grounds, ("unused", (1.0, 1.0, 1.0))),
    )
    small, reported = prune_network3d(more)
    assert [word.partition(":")[0] for word in reported] == [
        "far1", "far2", "link far", "ground unused", "link twin",
    ]  # fmt: skip
    assert len(small.masses) == 6
    assert len(small.links) == len(base.links)
    whole, kept = Model3d(more, scheme, 1e-4), Model3d(small, scheme, 1e-4)
    for k in range(300):
        at = [0.01 * math.sin(0.01 * k), 0.0, 0.002 * math.cos(0.02 * k)]
        assert whole.advance(at, [0.1]) == kept.advance(at, [0.1])
