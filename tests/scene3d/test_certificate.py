"""The certificate of points in space: it is that of the steps that run, and claims no more."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tautwave.certificate import certify
from tautwave.certificate.belief import declared_delays
from tautwave.certificate.picture import draw_certificate
from tautwave.config import load_rig
from tautwave_scenes.certificate.contacts import curved_links
from tautwave_scenes.certificate.joint import joint_poles, needed_together, radius_of
from tautwave_scenes.certificate.maps import needed
from tautwave_scenes.certificate3d.contacts import together3d
from tautwave_scenes.certificate3d.maps import network3d_map
from tautwave_scenes.certificate3d.verdict import _ports, _Scene
from tautwave_scenes.networks.network import Link, Mass, Network
from tautwave_scenes.networks.sampled import linear_scene, loop_poles
from tautwave_scenes.networks3d.arrays import compile_network3d
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.matrices import steepest, symplectic_share, tangent
from tautwave_scenes.networks3d.network import Mass3d, Network3d, Port3d
from tautwave_scenes.networks3d.stepping import set_forces3d
from tautwave_scenes.rig.network3d import pruned_network3d
from tests.scene.networks import RESONATOR

CONFIGS = Path(__file__).parents[2] / "configs"
PERIOD = 1e-3
SLANTED = ((1.0, 0.0, 0.0), (0.6, 0.8, 0.0), (0.0, -0.6, 0.8))

STRETCHED = Network3d(
    (
        Mass3d("a", 0.02, (0.05, 0.0, 0.0), damping=0.1),
        Mass3d("b", 0.01, (0.1, 0.04, 0.01), damping=0.2),
    ),
    (
        Link("one", "spring", "a", "ground", 300.0, damping=0.3, rest=0.03),
        Link("two", "spring", "b", "a", 200.0, damping=0.2, rest=0.05),
        Link("kc", "spring", "p", "b", 150.0, damping=0.1),
        Link("side", "spring", "p", "a", 80.0, damping=0.05, rest=0.04),
        Link("oil", "damper", "p", "b", damping=0.2),
        Link("ball", "contact", "p", "a", 1e4, rest=1e-3),
    ),
    (Port3d("p", ("u", "v", "w"), SLANTED, (0.02, 0.06, 0.05)),),
)


@pytest.mark.parametrize("scheme", ["symplectic", "discrete_gradient"])
def test_the_map_is_the_derivative_of_the_live_steps(scheme):
    """Central differences of one step, from every state and by every axis, ports that slant."""
    scales = np.array([1.0, 2.0, 0.5])
    law = network3d_map(compile_network3d(STRETCHED).arrays, scheme, PERIOD, scales)
    still = law.a.shape[0]
    step = 1e-6

    def after(state: np.ndarray, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        model = Model3d(STRETCHED, scheme, PERIOD)
        model.reset([0.0] * 3)
        set_forces3d(model.arrays)
        balance = [-force for force in model.arrays.force[:6]]  # it stays where it stands
        model.reset((scales * state[12:]).tolist())
        model.arrays.pushed[:] = balance
        for at in range(6):
            model.arrays.x[at] += float(state[at])
            model.arrays.v[at] += float(state[6 + at])
        effort = model.advance((scales * axes).tolist())
        moved = np.array(model.arrays.x[:6]) - np.array(compile_network3d(STRETCHED).arrays.x[:6])
        return np.concatenate([moved, model.arrays.v[:6], axes]), scales * np.array(effort)

    for at in range(still + 3):
        both = []
        for sign in (1.0, -1.0):
            given = np.zeros(still + 3)
            given[at] = sign * step
            both.append(after(given[:still], given[still:]))
        found = [(one - two) / (2.0 * step) for one, two in zip(*both, strict=True)]
        wanted = (law.a[:, at], law.c[:, at]) if at < still else (
            law.b[:, at - still], law.d[:, at - still])  # fmt: skip
        for one, two in zip(found, wanted, strict=True):
            assert one == pytest.approx(two, rel=1e-6, abs=1e-5)


def lifted(direction: tuple[float, float, float]) -> Network3d:
    """The second seed's resonator between points, touched along a direction."""
    return Network3d(
        (Mass3d("object", 0.004, damping=0.01),),
        RESONATOR.links,
        (Port3d("hand", ("axis",), (direction,)),),
    )


@pytest.mark.parametrize("scheme", ["symplectic", "discrete_gradient"])
@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (2 / 3, -1 / 3, 2 / 3)])
def test_one_axis_needs_what_one_dimension_proves(scheme, direction):
    line = linear_scene(RESONATOR, scheme, 1e-4, "hand")
    law = network3d_map(compile_network3d(lifted(direction)).arrays, scheme, 1e-4, np.ones(1))
    proved = needed(line, 1.0)
    found = needed_together(law, np.array([0.5]), np.array([1.0]))
    assert found.alone[0] == pytest.approx(proved.damping, rel=1e-3)
    assert found.share == pytest.approx(proved.damping / 0.5, rel=1e-3)
    ends = [
        np.abs(loop_poles(line, 0.2, 1.0, 500.0, 2)).max(),
        np.abs(joint_poles(law, *np.array([[0.2], [1.0], [500.0]]), [2])).max(),
    ]
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)


def test_axes_along_one_line_need_more_together_than_each_alone():
    """Two axes that nearly agree move the point twice as far: a spring of K T/2 counts for both."""
    near = (1.0, 0.05, 0.0)
    network = Network3d(
        (Mass3d("m", 1.0, damping=0.1),),
        (Link("wall", "spring", "p", "ground", 1000.0), Link("k", "spring", "m", "ground", 1.0)),
        (Port3d("p", ("one", "two"), ((1.0, 0.0, 0.0), near)),),
    )
    law = network3d_map(compile_network3d(network).arrays, "symplectic", PERIOD, np.ones(2))
    found = needed_together(law, np.array([0.6, 0.6]), np.zeros(2))
    size = math.hypot(*near)
    assert found.alone == pytest.approx((0.5, 0.5), rel=2e-3)  # K T / 2
    assert found.share == pytest.approx(0.5 * (1.0 + 1.0 / size) / 0.6, rel=3e-3)


def test_the_bound_of_the_standard_scheme_holds_in_any_posture():
    """Of random postures of links that are not pressed none is stiffer than `symplectic_share`."""
    rng = np.random.default_rng(2)
    for _ in range(30):
        places = rng.uniform(-1.0, 1.0, (4, 3))
        masses = tuple(
            Mass3d(f"m{i}", float(rng.uniform(0.01, 0.1)), tuple(where.tolist()))
            for i, where in enumerate(places)
        )
        links = [Link("g", "spring", "m0", "ground", 50.0, damping=0.01)]
        for i in range(4):
            for j in range(i):
                gap = float(np.linalg.norm(places[i] - places[j]))
                links.append(Link(f"s{i}{j}", "spring", f"m{i}", f"m{j}", 100.0, damping=0.02,
                                  rest=gap * float(rng.uniform(0.0, 1.0))))  # fmt: skip
        s = compile_network3d(Network3d(masses, tuple(links))).arrays
        near = tangent(s)
        whole = PERIOD**2 * near.stiffness + 2.0 * PERIOD * near.damping
        root = np.sqrt(near.mass)
        values = np.linalg.eigvalsh(whole / np.outer(root, root))
        assert values.max() / 4.0 <= symplectic_share(s, PERIOD) * (1.0 + 1e-12)
        assert np.linalg.eigvalsh(near.stiffness).min() > -1e-9


@pytest.mark.parametrize("share", [0.97, 1.03])
def test_the_standard_scheme_goes_up_to_its_bound(share):
    """A thread along x: its limit is that of k T**2 / m < 4."""
    k, m = 400.0, 0.01
    period = 2.0 * math.sqrt(m / k) * math.sqrt(share)
    network = Network3d(
        (Mass3d("m", m, (0.1, 0.0, 0.0), (1e-3, 0.0, 0.0)),),
        (Link("k", "spring", "m", "ground", k, rest=0.1),),
    )
    arrays = compile_network3d(network).arrays
    assert symplectic_share(arrays, period) == pytest.approx(share)
    assert (radius_of(network3d_map(arrays, "symplectic", period, np.ones(0))) > 1.0 + 1e-6) == (
        share > 1.0
    )
    model = Model3d(network, "symplectic", period)
    greatest = 0.0
    for _ in range(60):
        model.advance([])
        greatest = max(greatest, abs(model.arrays.x[0] - 0.1))
    assert (greatest > 0.01) == (share > 1.0)


def net(*overrides: str):
    return certify(load_rig(CONFIGS / "scene-net.yaml", overrides))


@pytest.mark.slow
def test_the_net_is_conditional_and_says_on_what():
    reported = net()
    for name in ("passive", "coupled_stable"):
        verdict = reported.verdicts[name]
        assert verdict.state == ("failed" if name == "passive" else "conditional")
    assert "ball1, ball2" in verdict.conditions[0]
    assert "no theorem bounds it" in verdict.conditions[0]
    assert "as they turn away from the start position" in verdict.conditions[1]
    assert "only dissipates, along its line" in reported.elements[0].passive.reason
    assert "no spring or damper acts on it" in reported.elements[1].passive.reason


@pytest.mark.slow
def test_linear_springs_at_axes_are_certified_together():
    held = [
        "scene.masses.core={mass: 0.01, damping: 0.1}",
        "scene.links.hold={type: spring, between: [core, ground], stiffness: 1000}",
        "scene.ports.finger={axes: [right, away, up], to: core, stiffness: 300}",
    ]
    reported = net(*held)
    joint = reported.elements[-2]
    assert joint.name == "all axes"
    assert 0.0 < joint.numbers["share"] < 1.0
    assert joint.numbers["share"] == pytest.approx(
        max(e.numbers["needed_damping"] for e in reported.elements[1:4]) / 0.3, rel=1e-6
    )
    hard = [held[0], held[1], held[2].replace("300", "20000")]
    reported = net(*hard)
    assert not reported.verdicts["passive"].passed
    assert not reported.verdicts["coupled_stable"].passed
    assert "unstable with" in reported.verdicts["coupled_stable"].reason


@pytest.mark.slow
def test_what_is_too_stiff_for_the_standard_scheme_is_refused_with_a_rate():
    reported = net("scene.links.thread.stiffness=40000")
    assert not reported.passed
    reason = reported.verdicts["coupled_stable"].reason
    assert "symplectic cannot run the scene at 2000 Hz: it is unstable by itself" in reason
    assert net("scene.links.thread.stiffness=40000", "scene.scheme=discrete_gradient").passed
    rate = float(reason.partition("Raise the rate to ")[2].split()[0])
    assert net("scene.links.thread.stiffness=40000", f"rate_hz={math.ceil(rate + 1)}").passed


def test_a_start_that_gives_way_is_not_certified_as_stable():
    reported = net("scene.links.thread.rest=0.027", "scene.gravity=0")
    assert not reported.passed
    assert "links are compressed so that the network buckles" in reported.verdicts[
        "coupled_stable"
    ].reason  # fmt: skip


@pytest.mark.parametrize(
    "link",
    ["{type: negative_damper, between: [finger, knot], damping: 0.1}",
     "{type: energy_source, between: [finger, knot], power: 0.1}"],
)  # fmt: skip
def test_what_feeds_is_not_certified(link):
    reported = net(f"scene.links.feeding={link}")
    assert not any(verdict.passed for verdict in reported.verdicts.values())


@pytest.mark.sparse(2)
@pytest.mark.parametrize("linear", [False, True])
def test_the_certificate_is_drawn(tmp_path, linear):
    more = [
        "scene.masses.core={mass: 0.01, damping: 0.1}",
        "scene.links.hold={type: spring, between: [core, ground], stiffness: 1000}",
        "scene.ports.finger={axes: [right, away, up], to: core, stiffness: 300}",
    ]
    rig = load_rig(CONFIGS / "scene-net.yaml", more if linear else [])
    draw_certificate(rig, tmp_path / "certificate.png")
    with Image.open(tmp_path / "certificate.png") as image:
        assert image.width > 800
        assert len(image.convert("RGB").getcolors(1 << 16) or ()) > 20


def test_the_bound_counts_pressed_balls_and_friction_at_rest():
    """At every depth and rate the derivative of a pull is at most what the bound takes."""
    links = (
        Link("balls", "contact", "m", "ground", 4e4, exponent=1.5, rest=0.02, loss=0.5),
        Link("dry", "friction", "m", "ground", limit=0.2, scale=2e-3),
        Link("hair", "bow", "m", "ground", limit=0.2, scale=0.05),
    )
    for link in links:
        s = compile_network3d(Network3d((Mass3d("m", 0.01, (0.01, 0.0, 0.0)),), (link,))).arrays
        k, z = steepest(s, 0)
        pulls = {}
        for step, what in ((1e-7, "x"), (1e-7, "v")):
            for depth in np.linspace(1e-4, 0.0199, 40):
                for rate in (0.0, -0.3):
                    ends = []
                    for sign in (0.5, -0.5):
                        s.x[0], s.v[0] = 0.02 - float(depth), rate
                        getattr(s, what)[0] += sign * step
                        set_forces3d(s)
                        ends.append(s.tension[0])
                    pulls.setdefault((what, rate), []).append((ends[0] - ends[1]) / step)
        assert max(pulls["x", 0.0]) <= k * (1.0 + 1e-6)
        assert max(pulls["v", 0.0]) <= z * (1.0 + 1e-6)
        assert max(*pulls["x", 0.0], *pulls["v", 0.0]) > 0.9 * max(k, z)


def test_what_has_no_greatest_stiffness_counts_nothing():
    for link in (
        Link("hard", "nonlinear", "m", "ground", 1e4, exponent=3.0, rest=0.02),
        Link("floor", "contact", "m", "ground", 1e5, exponent=1.5, normal=(0.0, 0.0, 1.0)),
        Link("engine", "energy_source", "m", "ground", limit=0.01, scale=0.1),
    ):
        s = compile_network3d(Network3d((Mass3d("m", 0.01, (0.01, 0.0, 0.0)),), (link,))).arrays
        assert steepest(s, 0) == (0.0, 0.0)


def walled(contact: str, *more: str):
    """Return the contacts' element of a point on three axes that meets a contact of 1000 N/m."""
    given = [
        f"scene.links={{wall: {contact}}}",
        "scene.masses={}",
        "scene.gravity=0",
        *more,
    ]
    return next(one for one in net(*given).elements if one.name == "contacts")


def test_a_plane_and_a_ball_need_what_a_wall_does():
    """2000 Hz, 1000 N/m: 0.25 N s/m of 0.3. A plane's share is along its normal, however it is."""
    plane = "{type: contact, between: [finger, ground], stiffness: 1000, normal: %s}"
    for normal in ("[0, 0, 1]", "[2, 1, 2]"):
        assert walled(plane % normal).numbers["share"] == pytest.approx(0.25 / 0.3)
    ball = "{type: contact, between: [finger, ground], stiffness: 1300, gap: 0.025}"
    found = walled(ball)
    assert found.numbers["share"] == pytest.approx(0.325 / 0.3)
    assert found.numbers["greatest_stiffness"] == pytest.approx(1200.0, rel=1e-3)


def test_a_ball_on_a_mass_is_the_contact_of_one_dimension():
    more = (
        "scene.masses={m: {mass: 0.05, damping: 2.0}}",
        "scene.links={wall: {type: contact, between: [finger, m], stiffness: 800, gap: 0.02}}",
    )
    found = walled("{}", *more)
    network = Network(
        (Mass("m", 0.05, damping=2.0),),
        (Link("wall", "spring", "p", "m", stiffness=800.0),),
        ("p",),
    )
    want = needed(linear_scene(network, "symplectic", 5e-4, "p"), 0.0).damping
    assert found.numbers["share"] == pytest.approx(want / 0.3, rel=1e-3)


@pytest.mark.slow
def test_at_once_a_ball_reaches_the_knots_around_one_place():
    """In the net of 25 mm that is four knots, the corners of a mesh; alike ones count once."""
    rig = load_rig(CONFIGS / "scene-net.yaml")
    network = pruned_network3d(rig).network
    links = curved_links(network.links)
    groups = together3d(network, links, tangent(compile_network3d(network).arrays))
    assert sorted(len(group) for group in groups) == [1, 1, 4]
    loops = certify(rig).loops
    assert len(loops[1].cases) == 3 * 3 * 3 * 2  # groups, ways, forces, bounds of the inertia


def test_tissue_at_the_axes_is_evaluated_with_what_relaxes_in_it():
    rig = load_rig(CONFIGS / "scene-tissue.yaml")
    found = {one.name: one for one in _ports(_Scene(rig, declared_delays(rig)))}
    pull = found["port axis pull"].numbers["needed_damping"]
    # The clip's spring held for a period, as at a wall, and its damper: k T/2 + z is 0.15.
    assert 0.05 < pull < 0.15
    assert found["all axes"].passive.passed
