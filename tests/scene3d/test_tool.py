"""Rigid tools that turn: their wrench, its power, the books of what they hold, and their keys."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave_scenes.certificate3d.maps import levers
from tautwave_scenes.networks.network import GROUND, Link
from tautwave_scenes.networks3d.live import Model3d
from tautwave_scenes.networks3d.network import ORIGIN, WAYS, Mass3d, Network3d, Port3d
from tautwave_scenes.networks3d.tool import Tool3d, place_tool, tool_efforts, turn_of, wrench_of
from tautwave_scenes.rig.network3d import axis_scales, whole_network3d
from tests.examples import tried
from tests.scene3d.tissues import SIZE, tissue

RIG = Path(__file__).parents[2] / "configs" / "arms" / "tissue.yaml"
POINTS = ((0.0, -0.01, -0.01), (0.0, 0.01, -0.01), (0.0, 0.01, 0.01), (0.0, -0.01, 0.01))
AXES = ("x", "y", "z")
TURNS = ("rx", "ry", "rz")


def tool(points=POINTS, ways=WAYS, about=WAYS):
    named = tuple((f"clip{at + 1}", point) for at, point in enumerate(points))
    return Tool3d("clip", AXES[: len(ways)], ways, TURNS[: len(about)], about, named)


def held(network, offset, points=POINTS):
    """Return a network with a tool and its points as ports."""
    made = tool(points)
    ports = tuple(
        Port3d(
            name,
            tuple(f"{name}.{c}" for c in "xyz"),
            offset=tuple(a + b for a, b in zip(offset, point, strict=True)),
        )
        for name, point in made.points
    )
    return network._replace(ports=ports, tools=(made,))


def clipped():
    """Return a beam of tissue whose free end a turning clip grips at four corners."""
    network = tissue((1, 1, 1))
    corners = [
        min(
            network.masses,
            key=lambda one, y=0.01 + y, z=0.01 + z: float(
                np.linalg.norm(np.subtract(one.position, (SIZE[0], y, z)))
            ),
        ).name
        for _, y, z in POINTS
    ]
    links = tuple(
        Link(f"grip{at + 1}", "spring", f"clip{at + 1}", name, 300.0, 0.05)
        for at, name in enumerate(corners)
    )
    return held(network._replace(links=links), (SIZE[0], 0.01, 0.01))


@settings(max_examples=tried(40), deadline=None)
@given(seed=st.integers(0, 10**6), size=st.sampled_from([0.0, 1e-9, 9e-5, 1.1e-4, 0.3, 2.5]))
def test_rotation_and_rate_are_those_of_the_rotation_vector(seed, size):
    """D is the derivative: R(v + dv) = (1 + [D dv]) R(v), to the step's second order."""
    rng = np.random.default_rng(seed)
    v = rng.normal(size=3)
    v *= size / np.linalg.norm(v)
    rotation, rate = (np.array(one).reshape(3, 3) for one in turn_of(tuple(v)))
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-15)
    assert np.allclose(rotation @ v, v, atol=1e-15)
    step = 1e-6 * rng.normal(size=3)
    ahead, back = (np.array(turn_of(tuple(v + s * step))[0]).reshape(3, 3) for s in (0.5, -0.5))
    spin = (ahead - back) @ rotation.T
    found = 0.5 * np.array(
        [spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]
    )
    assert np.allclose(found, rate @ step, atol=1e-15)


@settings(max_examples=tried(40), deadline=None)
@given(seed=st.integers(0, 10**6), some=st.booleans())
def test_what_the_axes_bear_is_the_power_of_the_wrench_and_of_all_forces(seed, some):
    """Effort times speed = wrench . twist = sum f . v, at any pose, for any choice of axes."""
    rng = np.random.default_rng(seed)
    ways, about = (WAYS[:1], (WAYS[2],)) if some else (WAYS, WAYS)
    made = tool(tuple(map(tuple, rng.normal(size=(5, 3)))), ways, about)
    at, speed = rng.normal(size=(2, len(ways) + len(about)))
    pose, away = place_tool(made, at.tolist())
    forces = rng.normal(size=(5, 3))
    efforts = tool_efforts(made, pose, forces.ravel().tolist())
    v = speed[: len(ways)] @ np.array(ways)
    w = np.array(pose.rate).reshape(3, 3) @ (speed[len(ways) :] @ np.array(about))
    force, moment = wrench_of(pose, forces.ravel().tolist())
    assert np.allclose(moment, np.cross(pose.arms, forces).sum(axis=0), atol=1e-14)
    speeds = v + np.cross(w, pose.arms)
    power = float(np.sum(forces * speeds))
    size = float(np.abs(forces * speeds).sum())
    assert np.dot(force, v) + np.dot(moment, w) == pytest.approx(power, abs=1e-15 * size)
    assert np.dot(efforts, speed) == pytest.approx(power, abs=1e-15 * 10 * size)
    # The speeds are those at which the points move.
    ahead, behind = (
        np.array(place_tool(made, (at + s * speed).tolist())[1]) for s in (1e-6, -1e-6)
    )
    assert np.allclose((ahead - behind) / 2e-6, speeds.ravel(), atol=1e-8)
    assert len(away) == 15


def test_a_tool_that_turns_without_moving_is_held_by_a_moment():
    """Four springs to points on a circle, turned by t: 4 k r^2 sin t against it, and no force."""
    points = ((0.02, 0.0, 0.0), (0.0, 0.02, 0.0), (-0.02, 0.0, 0.0), (0.0, -0.02, 0.0))
    grounds = tuple((f"pin{at + 1}", point) for at, point in enumerate(points))
    links = tuple(
        Link(f"hair{at + 1}", "spring", f"clip{at + 1}", f"pin{at + 1}", 100.0) for at in range(4)
    )
    network = Network3d((Mass3d("m", 1.0),), links, grounds=((GROUND, ORIGIN), *grounds))
    model = Model3d(held(network, ORIGIN, points), "discrete_gradient", 1e-3)
    efforts = model.advance([0.0] * 5 + [0.7])
    due = 4 * 100.0 * 0.02**2 * np.sin(0.7)
    assert efforts[5] == pytest.approx(due, rel=1e-14)
    assert np.allclose(efforts[:5], 0.0, atol=1e-15)
    assert model.resting_efforts() == pytest.approx(efforts, abs=1e-15)


def test_tissue_that_is_twisted_keeps_its_books_and_gives_back_what_it_took():
    """The step stays exact; effort times motion is the port's work but for what holding makes."""
    model = Model3d(clipped(), "discrete_gradient", 1e-3)
    model.reset([0.0] * 6)
    given = 0.0
    before, efforts = np.zeros(6), np.zeros(6)
    most = 0.0
    for k in range(24):
        at = 0.5 * (1.0 - np.cos(np.pi * min(k, 20) / 10))
        where = np.array([0.004, 0.0, -0.003, 1.0, 0.3, 0.2]) * at
        given += float(efforts @ (where - before))
        before, efforts = where, np.array(model.advance(where.tolist()))
        most = max(most, model.ledger().port_work - model.start.port_work)
        assert abs(model.residual()) < 1e-13 * max(most, 1e-3)
    assert most > 2e-3
    work = model.ledger().port_work - model.start.port_work
    assert given == pytest.approx(work, abs=0.1 * most)  # the difference is `scene.hold`
    assert np.abs(efforts[3:]).max() > 0.0


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("compiled3d")
def test_compiled_steps_are_those_of_plain_python():
    from tautwave_scenes.simulation.ticking3d import CompiledModel3d

    network = clipped()
    slow = Model3d(network, "discrete_gradient", 1e-3)
    fast = CompiledModel3d(network, "discrete_gradient", 1e-3)
    for k in range(4):
        where = [0.001 * k, 0.0, 0.0, 0.1 * k, 0.05 * k, 0.0]
        assert fast.advance(where) == slow.advance(where)


def test_the_certificate_sees_force_and_moment_at_the_start():
    rig = load_rig(RIG)
    network = whole_network3d(rig)
    found = levers(network, axis_scales(rig)).reshape(4, 3, 6)
    for ways, (_, point) in zip(found, network.tools[0].points, strict=True):
        assert np.array_equal(ways[:, :3], np.eye(3))
        assert np.allclose(ways[:, 3:], np.cross(np.eye(3), point).T)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ("scene.ports.clip.points=null", "a rotating tool needs points"),
        ("scene.ports.clip.turns={x: [1, 0, 0]}", "a linear axis cannot rotate a tool"),
        ("scene.ports.clip.turns={rx: [1, 0, 0], ry: [2, 0, 0]}", "linearly independent"),
        ("scene.links.low.between=[clip5, beam5]", "unknown node 'clip5'"),
    ],
)
def test_a_tool_that_cannot_be_is_refused_in_a_sentence(change, sentence):
    with pytest.raises(ConfigError, match=sentence):
        load_rig(RIG, [change])
