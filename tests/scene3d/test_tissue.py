"""Tissue: laws of an element, energy and momenta of a body, closed forms, relaxation, books."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave_scenes.models.tissue import algebra, element
from tautwave_scenes.models.tissue.mesh import Mesh, block, on_faces, shape_of
from tautwave_scenes.networks.network import GROUND, Link
from tautwave_scenes.networks3d import straining
from tautwave_scenes.networks3d.arrays import compile_network3d
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.matrices import tangent
from tautwave_scenes.networks3d.network import ORIGIN, WAYS, Network3d, Port3d
from tautwave_scenes.networks3d.straining import element_matrix
from tautwave_scenes.networks3d.tissue import Material, tissue_of
from tests.examples import tried
from tests.scene3d.networks import momenta
from tests.scene3d.tissues import SIZE, SOFT, bent, tissue

MU, LAM = 1.0, 1.5


def nine(a):
    return tuple(float(part) for part in np.asarray(a).ravel())


def some_matrix(rng, size=0.4):
    return np.eye(3) + size * rng.normal(size=(3, 3))


def strained(f, start=None):
    """Return rotation and strain of a deformation gradient."""
    r = algebra.rotation_of(nine(f), nine(np.eye(3)) if start is None else start)
    u = algebra.stretch_of(r, nine(f))
    return r, (u[0] - 1.0, u[1] - 1.0, u[2] - 1.0, *u[3:])


def as_matrix(e):
    return np.array(algebra.full(e)).reshape(3, 3)


@settings(max_examples=tried(60), deadline=None)
@given(seed=st.integers(0, 10**6), step=st.sampled_from([1e-6, 1e-2, 0.5, 2.0]))
def test_the_mean_pull_does_the_work_of_its_stress_whatever_the_step(seed, step):
    """Also through flat and inverted states; of the elastic stress that is the energy's change."""
    rng = np.random.default_rng(seed)
    before = some_matrix(rng)
    after = before + step * rng.normal(size=(3, 3))
    (r, e), (r_new, e_new) = strained(before), strained(after)
    mean = tuple(0.5 * (one + two) for one, two in zip(e, e_new, strict=True))
    elastic = element.stress(MU, LAM, mean)
    free = tuple(one + two for one, two in zip(elastic, rng.normal(size=6), strict=True))
    gained = element.strain_energy(MU, LAM, e_new) - element.strain_energy(MU, LAM, e)
    change = tuple(two - one for one, two in zip(e, e_new, strict=True))
    for stress, due in ((elastic, gained), (free, algebra.inner(free, change))):
        p = element.mean_pull(nine(before), nine(after), r, r_new, e, e_new, stress)
        p = np.array(p).reshape(3, 3)
        scale = 1.0 + np.abs(p).max() * np.abs(after - before).max()
        assert np.sum(p * (after - before)) == pytest.approx(due, abs=1e-13 * scale)
        if np.linalg.det(as_matrix(mean) + np.eye(3)) > element.FLAT:  # no torque
            torque = p @ (before + after).T
            assert np.allclose(torque, torque.T, atol=1e-12 * (1.0 + np.abs(torque).max()))


@settings(max_examples=tried(60), deadline=None)
@given(seed=st.integers(0, 10**6), inverted=st.booleans())
def test_the_rotation_is_the_polar_one_and_a_rotation_where_the_element_is_inverted(seed, inverted):
    rng = np.random.default_rng(seed)
    sizes = np.sort(rng.uniform(0.2, 2.0, 3))[::-1] * [1.0, 1.0, -0.5 if inverted else 1.0]
    one, two = (np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2))
    one, two = one * np.sign(np.linalg.det(one)), two * np.sign(np.linalg.det(two))
    found = np.array(algebra.rotation_of(nine(one * sizes @ two.T), nine(np.eye(3)))).reshape(3, 3)
    assert np.allclose(found, one @ two.T, atol=1e-9)
    assert np.allclose(found @ found.T, np.eye(3), atol=1e-13)


@settings(max_examples=tried(20), deadline=None)
@given(seed=st.integers(0, 10**6))
def test_a_body_that_is_turned_and_moved_has_no_stress(seed):
    rng = np.random.default_rng(seed)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    mesh = block(SIZE, (1, 1, 1))
    made = tissue_of("b", mesh, SOFT)
    away = rng.normal(size=3)
    masses = tuple(
        one._replace(position=tuple(turn @ np.array(one.position) + away)) for one in made.masses
    )
    network = Network3d(masses, (), (), elements=made.elements)
    model = Model3d(network, "discrete_gradient", 1e-3)
    s = model.arrays
    straining.pull_elements(s, 0, s.count[0], 1e-3)
    straining.commit_elements(s, 0, s.count[0], 1e-3)  # strained from rest to where it stands
    assert straining.strain_energies(s)[0] < 1e-28
    straining.pull_elements(s, 0, s.count[0], 1e-3)
    pulls = np.array(s.work[3 * s.count[0] : 6 * s.count[0]])
    assert np.abs(pulls - 0.0).max() < 1e-13 * SOFT.young * 0.02**2 * 20


@pytest.mark.sparse(2)
@pytest.mark.parametrize("seed", range(4))
def test_a_free_body_keeps_energy_momentum_and_angular_momentum(seed):
    rng = np.random.default_rng(seed)
    period = float(rng.choice([1e-3, 5e-3]))

    def speed(_):
        return tuple(rng.normal(size=3))

    network = tissue((1, 1, 1), clamped=(), speed=speed)
    model = Model3d(network, "discrete_gradient", period)
    before, scale = momenta(model.arrays), 0.008
    peak = 0.0
    for _ in range(8):
        model.advance([])
        peak = max(peak, model.ledger().stored)
    assert peak > 0.1 * model.start.energy
    assert model.ledger().energy == pytest.approx(model.start.energy, rel=1e-12)
    assert momenta(model.arrays) == pytest.approx(before, abs=1e-13 * scale * 100)


def test_a_force_that_is_not_the_discrete_gradient_is_found_out(monkeypatch):
    """The stress of the mean strain turned by the mean rotation: the co-rotational force."""

    def plain(f, f_new, r, r_new, e, e_new, s):
        return algebra.product(algebra.halfway(r, r_new), algebra.full(s))

    def drift():
        model = Model3d(tissue((1, 1, 1), speed=bent), "discrete_gradient", 5e-3)
        for _ in range(5):
            model.advance([])
        return abs(model.residual()) / model.start.energy

    exact = drift()
    monkeypatch.setattr(straining, "mean_pull", plain)
    assert exact < 1e-12 < 1e-6 < drift()


def stiffness_of(network):
    s = compile_network3d(network).arrays
    n = 3 * s.count[0]
    return tangent(s).stiffness[:n, :n]


def static(network, forces):
    """Return displacements (n, 3) under small forces (n, 3)."""
    return np.linalg.solve(stiffness_of(network), forces.ravel()).reshape(-1, 3)


def at_end(network, force, length=SIZE[0]):
    """Return a force spread over the nodes at the free end by the area around each."""
    places = np.array([mass.position for mass in network.masses])
    end = np.isclose(places[:, 0], length)
    share = np.ones(len(places))
    for c in (1, 2):
        share *= np.where(np.isclose(places[:, c], 0.0) | np.isclose(places[:, c], SIZE[c]), 0.5, 1)
    share = np.where(end, share, 0.0)
    return np.outer(share / share.sum(), force)


def test_a_rod_is_stretched_by_force_times_length_over_modulus_and_area():
    material = Material(2e4, 0.0, 1000.0)
    network = tissue((3, 2, 1), material=material)
    one = static(network, at_end(network, [1.0, 0.0, 0.0]))
    # The areas of corners of triangles differ; uniform strain needs the mesh's own: their work is.
    mean = float(np.sum(one * at_end(network, [1.0, 0.0, 0.0])))
    want = SIZE[0] / (material.young * SIZE[1] * SIZE[2])
    assert mean == pytest.approx(want, rel=0.02)
    stretched = np.array([[m.position[0], 0.0, 0.0] for m in network.masses])
    pull = stiffness_of(network) @ (1e-6 * stretched).ravel()
    inside = np.array([m.position[0] < 0.99 * SIZE[0] for m in network.masses])
    assert np.abs(pull.reshape(-1, 3)[inside]).max() < 1e-14
    whole = pull.reshape(-1, 3)[~inside].sum(axis=0)
    assert whole[0] == pytest.approx(1e-6 * material.young * SIZE[1] * SIZE[2], rel=1e-12)


def test_a_cantilever_tends_to_the_deflection_of_beam_theory():
    """Linear tetrahedra are too stiff in bending; the error falls with the square of the cell."""
    material = Material(2e4, 0.0, 1000.0)
    size = (0.12, 0.02, 0.02)
    inertia = size[1] * size[2] ** 3 / 12.0
    shear = 1.2 * size[0] / (0.5 * material.young * size[1] * size[2])
    want = size[0] ** 3 / (3.0 * material.young * inertia) + shear
    found = []
    for fine in (1, 2):
        network = tissue((6 * fine, fine, fine), size, material)
        force = at_end(network, [0.0, 0.0, 1.0], size[0])
        found.append(float(np.sum(static(network, force) * force)))
    assert found[0] < found[1] < want
    compliance = [1.0 / one for one in found]  # what locks adds to the stiffness, as h^2
    extrapolated = compliance[1] + (compliance[1] - compliance[0]) / 3.0
    assert 1.0 / extrapolated == pytest.approx(want, rel=0.06)


def test_the_matrix_is_the_derivative_of_the_force():
    rng = np.random.default_rng(3)
    made = tissue_of("b", Mesh(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 1, 2, 3),)),
                     Material(2.0, 0.3, 1.0))  # fmt: skip
    masses = tuple(
        one._replace(position=tuple(np.array(one.position) + 0.3 * rng.normal(size=3)))
        for one in made.masses
    )
    s = compile_network3d(Network3d(masses, (), (), elements=made.elements)).arrays
    grad, _ = shape_of(made.elements[0].rest, "it")
    grad = np.array(grad).reshape(3, 3)
    grad = np.vstack([-grad.sum(axis=0), grad])

    def force(x):
        f = x.reshape(4, 3).T @ grad
        r, e = strained(f)
        stress = element.stress(made.elements[0].mu, made.elements[0].lam, e)
        p = np.array(r).reshape(3, 3) @ as_matrix(stress)
        return (p @ grad.T).T.ravel() / 6.0

    x = np.array(s.x[:12])
    straining.pull_elements(s, 0, 4, 1.0)
    element_matrix(s, 0, 1.0, 1.0)
    found = np.zeros((12, 12))
    for m in range(4):
        for j in range(s.elements.row[m], s.elements.row[m + 1]):
            other = s.elements.column[j]
            found[3 * m : 3 * m + 3, 3 * other : 3 * other + 3] = np.array(
                s.elements.tangent[9 * j : 9 * j + 9]
            ).reshape(3, 3)
    want = np.stack(
        [(force(x + 1e-6 * way) - force(x - 1e-6 * way)) / 2e-6 for way in np.eye(12)], axis=1
    )
    assert np.allclose(found, want, atol=1e-8)


@pytest.mark.parametrize("scheme", ["discrete_gradient", "linearly_implicit"])
def test_the_error_falls_with_the_square_of_the_step(scheme):
    def end(steps):
        model = Model3d(tissue((1, 1, 1), speed=bent), scheme, 0.02 / steps)
        for _ in range(steps):
            model.advance([])
        return np.array(model.arrays.x[: 3 * model.arrays.count[0]])

    fine = end(80)
    coarse, finer = (np.abs(end(steps) - fine).max() for steps in (10, 20))
    assert 3.0 < coarse / finer < 5.0


def test_one_solve_a_step_books_the_energy_that_it_creates():
    model = Model3d(tissue((1, 1, 1), speed=bent), "linearly_implicit", 5e-3)
    for _ in range(40):
        model.advance([])
    created = model.ledger().numeric
    assert abs(created) > 1e-4 * model.start.energy
    assert model.ledger().energy - model.start.energy == pytest.approx(created, rel=1e-9)


def test_a_held_strain_relaxes_in_the_time_of_its_branch():
    """A corner of one tetrahedron too heavy to move, put aside at once."""
    share, time = 0.7, 0.2
    material = Material(100.0, 0.3, 1e12, branches=((share, time),))
    made = tissue_of("b", Mesh(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 1, 2, 3),)),
                     material, (0, 1, 2))  # fmt: skip
    masses = tuple(one._replace(position=(0.0, 0.1, 1.2)) for one in made.masses)
    grounds = ((GROUND, ORIGIN), *made.grounds)
    model = Model3d(Network3d(masses, (), (), grounds, elements=made.elements),
                    "discrete_gradient", 1e-3)  # fmt: skip
    stored = []
    for _ in range(201):
        model.advance([])
        stored.append(model.ledger().stored)
    kept = straining.strain_energy(*material.lame, straining.symmetric_at(
        model.arrays.elements.strain, 0)) / 6.0  # fmt: skip
    over = [one - kept for one in stored]
    assert over[200] / over[0] == pytest.approx(math.exp(-2.0 * 0.2 / time), rel=1e-4)
    assert over[0] == pytest.approx(share * kept, rel=0.02)


def scene(material, scheme="discrete_gradient", loss=0.2):
    """Return a beam under gravity, a ball on its top and a clip at its end, on one port each."""
    network = tissue((2, 1, 1), material=material, gravity=(0.0, 0.0, -9.81))
    names = [mass.name for mass in network.masses]
    links = [Link(f"ball{at}", "contact", "p", name, 2000.0, rest=0.025, exponent=1.5, loss=loss)
             for at, name in enumerate(names)]  # fmt: skip
    links.append(Link("clip", "spring", "q", names[-1], 100.0, damping=0.1))
    ports = (
        Port3d("p", ("x", "y", "z"), WAYS, (0.03, 0.01, 0.045)),
        Port3d("q", ("pull",), WAYS[:1], SIZE),
    )
    return Model3d(network._replace(links=tuple(links), ports=ports), scheme, 2e-3)


@pytest.mark.sparse(2)
@pytest.mark.parametrize("scheme", ["discrete_gradient", "linearly_implicit"])
def test_poked_and_pulled_its_books_close_and_the_tool_feels_what_the_nodes_do(scheme):
    model = scene(Material(2e4, 0.4, 1000.0, 1e-3, ((0.5, 0.05), (0.5, 0.01)), 0.5), scheme)
    s = model.arrays
    touched = 0.0
    for k in range(40):
        down = -0.02 * math.sin(math.pi * k / 40)
        efforts = model.advance([0.002 * k / 40, 0.0, down, 0.01 * math.sin(0.1 * k)])
        touched = min(touched, efforts[2])
        # The wrench about the ball's centre: minus the sum of the forces, and no moment.
        ball = [i for i in range(s.count[2]) if s.a[i] == s.count[0]]
        pulls = np.array([[s.tension[i] * s.way[3 * i + c] for c in range(3)] for i in ball])
        assert pulls.sum(axis=0) == pytest.approx(efforts[:3], abs=1e-12)
    assert touched < -0.05  # pressed, it pushes up
    ledger = model.ledger()
    assert ledger.lost > 1e-5
    flow = abs(ledger.port_work) + ledger.lost + ledger.energy
    assert abs(model.residual()) < 1e-11 * flow
    parts = model.elements()
    assert sum(one.get("stored", 0.0) for one in parts.values()) == pytest.approx(ledger.stored)
    assert sum(one.get("lost", 0.0) for one in parts.values()) == pytest.approx(ledger.lost)


def test_an_inverted_element_pushes_back_and_keeps_the_energy():
    mesh = Mesh(((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)), ((0, 1, 2, 3),))
    made = tissue_of("b", mesh, Material(100.0, 0.3, 6.0), (0, 1, 2))
    masses = tuple(one._replace(velocity=(0.0, 0.0, -30.0)) for one in made.masses)
    grounds = ((GROUND, ORIGIN), *made.grounds)
    network = Network3d(masses, (), (), grounds, elements=made.elements)
    model = Model3d(network, "discrete_gradient", 0.01)
    lowest = 1.0
    for _ in range(60):
        model.advance([])
        lowest = min(lowest, model.arrays.x[2])
    assert lowest < -0.3  # well through the base
    assert model.arrays.x[2] > 0.0 or model.arrays.v[2] > 0.0  # and on its way back
    assert abs(model.residual()) < 1e-11 * model.start.energy


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("compiled3d")
def test_undamped_its_energy_drifts_by_less_than_1e_12_in_100_000_steps():
    from tautwave_scenes.simulation.ticking3d import CompiledModel3d

    model = CompiledModel3d(tissue((1, 1, 1), speed=bent), "discrete_gradient", 1e-3)
    peak = worst = 0.0
    for _ in range(100_000):
        model.advance([])
        energy = model.booked.energy
        peak = max(peak, energy)
        worst = max(worst, abs(energy - model.start.energy))
    assert worst <= 1e-12 * peak


def test_faces_of_a_mesh():
    mesh = block((1.0, 2.0, 3.0), (2, 1, 1), (5.0, 0.0, 0.0))
    assert on_faces(mesh, ["-x"]) == {0, 3, 6, 9}
    assert on_faces(mesh, ["+z", "-y"]) == {0, 1, 2, 6, 7, 8, 9, 10, 11}
    assert sum(shape_of([mesh.nodes[i] for i in t], "")[1] for t in mesh.tetrahedra) == (
        pytest.approx(6.0, rel=1e-14)
    )
