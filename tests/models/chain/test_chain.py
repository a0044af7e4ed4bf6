"""Chains against closed forms and differences, without another library."""

from __future__ import annotations

import math
import random
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tautwave.bench import chains
from tautwave.bench.chunks import Cost
from tautwave.config.inputs.chains import chain_constants
from tautwave.config.keys.arm import Chain, DhRow, Payload
from tautwave.models.chain.build import (
    Body,
    Link,
    build_chain,
    is_inertia,
    joined,
    roll_pitch_yaw,
)
from tautwave.models.chain.gravity import chain_gravity, gravity_stiffness
from tautwave.models.chain.inertia import (
    BASE,
    chain_bodies,
    chain_coriolis,
    chain_screws,
    mass_matrix,
)
from tautwave.models.chain.kinematics import chain_frames, chain_jacobian, tip_pose
from tautwave.models.load import LoadParams, load_effort, load_energy, load_stiffness
from tests.models.chain.drawn import draw_body, draw_chain

G = 9.81
PLANAR = Chain(  # two links in a vertical plane, masses at their ends
    dh=(
        DhRow(alpha=0.0, a=0.3, mass=1.0),
        DhRow(alpha=0.0, a=0.2, mass=0.5),
    ),
    gravity=(0.0, -G, 0.0),
)


def test_two_links_in_a_plane_have_the_textbooks_gravity_and_inertia() -> None:
    chain = chain_constants(PLANAR)
    a, b = 0.4, -0.9
    frames = chain_frames(chain, (a, b))
    weight = [0.0, 0.0]
    energy = chain_gravity(chain, frames, weight)
    elbow = G * 0.5 * 0.2 * math.cos(a + b)
    assert weight == pytest.approx([G * 1.5 * 0.3 * math.cos(a) + elbow, elbow], rel=1e-14)
    height = 1.5 * 0.3 * math.sin(a) + 0.5 * 0.2 * math.sin(a + b)
    assert energy == pytest.approx(G * height, rel=1e-14)
    matrix = [0.0] * 4
    beside = [0.0, 0.0]
    found = mass_matrix(chain, (a, b), frames, chain_screws(frames), BASE, matrix, beside)
    assert found == pytest.approx(energy, rel=1e-14)
    assert beside == pytest.approx(weight, rel=1e-14)
    off = 0.5 * 0.2**2 + 0.5 * 0.3 * 0.2 * math.cos(b)
    first = 1.5 * 0.3**2 + 0.5 * 0.2**2 + 2 * 0.5 * 0.3 * 0.2 * math.cos(b)
    assert matrix == pytest.approx([first, off, off, 0.5 * 0.2**2], rel=1e-14)
    swung = [0.0, 0.0]
    u, w = 1.3, -0.7
    chain_coriolis(chain_bodies(chain, frames), chain_screws(frames), (u, w), swung)
    h = 0.5 * 0.3 * 0.2 * math.sin(b)
    assert swung == pytest.approx([-h * (2 * u * w + w * w), h * u * u], rel=1e-13)
    place = tip_pose(chain, frames)[:3]
    assert place == pytest.approx(
        (0.3 * math.cos(a) + 0.2 * math.cos(a + b), 0.3 * math.sin(a) + 0.2 * math.sin(a + b), 0),
        abs=1e-15,
    )


def test_a_payload_weighs_where_it_is_held() -> None:
    held = PLANAR.model_copy(update={"payload": Payload(mass=0.4, centre=(0.1, 0.0, 0.0))})
    weights = []
    for keys in (PLANAR, held):
        chain = chain_constants(keys)
        weight = [0.0, 0.0]
        chain_gravity(chain, chain_frames(chain, (0.0, 0.0)), weight)
        weights.append(weight)
    more = [b - a for a, b in zip(*weights, strict=True)]
    assert more == pytest.approx([G * 0.4 * 0.6, G * 0.4 * 0.3], rel=1e-14)


def test_a_tips_body_is_as_hard_to_turn_as_it_is_held() -> None:
    """Its own inertia counts, turned with the flange: the tip's y axis is the joint's z."""
    own = Body(1.0, (0.2, 0.0, 0.0), ((1e-3, 0, 0), (0, 1e-3, 0), (0, 0, 3e-3)))
    held = Body(0.5, (0.1, 0.0, 0.0), ((1e-3, 0, 0), (0, 2e-3, 0), (0, 0, 2.5e-3)))
    flange = Link("flange", "fixed", (0.3, 0.0, 0.0), roll_pitch_yaw(math.pi / 2, 0.0, 0.0))
    chain = build_chain((Link("a", "turns", body=own), flange), (0.0, 0.0, -G), held)
    frames = chain_frames(chain, (0.7,))
    matrix, weight = [0.0], [0.0]
    mass_matrix(chain, (0.7,), frames, chain_screws(frames), BASE, matrix, weight)
    assert matrix[0] == pytest.approx(3e-3 + 0.2**2 + 2e-3 + 0.5 * 0.4**2, rel=1e-14)


@pytest.mark.parametrize("ends", ["as drawn", "first slides", "last slides", "all slide"])
@pytest.mark.parametrize("seed", range(4))
def test_the_mass_matrix_is_the_sum_over_the_bodies(seed: int, ends: str) -> None:
    """About any point, of one joint too; every number is filled whatever it was before."""
    rng = random.Random(seed)
    count = (1, 3, 5, 7)[seed]
    links = list(draw_chain(rng, count))
    moving = [k for k, link in enumerate(links) if link.kind != "fixed"]
    slides = {"first slides": moving[:1], "last slides": moving[-1:], "all slide": moving}
    for k in slides.get(ends, []):
        links[k] = links[k]._replace(kind="slides")
    chain = build_chain(tuple(links), (1.0, -2.0, -9.0), draw_body(rng))
    q = [rng.uniform(-2.0, 2.0) for _ in range(count)]
    frames = chain_frames(chain, q)
    bodies, screws = chain_bodies(chain, frames), chain_screws(frames)
    wanted = [
        sum(shared(bodies[k], screws[i], screws[j]) for k in range(max(i, j), count))
        for i in range(count)
        for j in range(count)
    ]
    x, y, z = about = (0.4, -1.1, 0.7)
    there = [
        (a, b, c, u + b * z - c * y, v + c * x - a * z, w + a * y - b * x)
        for a, b, c, u, v, w in screws
    ]
    held = [0.0] * count
    potential = chain_gravity(chain, frames, held)
    least = 1e-12 * max(map(abs, wanted))
    for given, point in ((screws, BASE), (there, about)):
        matrix, weight = [math.nan] * (count * count), [math.nan] * count
        found = mass_matrix(chain, q, frames, given, point, matrix, weight)
        assert matrix == pytest.approx(wanted, rel=1e-12, abs=least)
        assert weight == pytest.approx(held, rel=1e-12, abs=1e-12 * G)
        assert found == pytest.approx(potential, rel=1e-12, abs=1e-12 * G)


@pytest.mark.parametrize("kind", ["rods", "scales"])
def test_the_mass_matrix_keeps_the_digits_of_its_small_entries(kind: str) -> None:
    """Per root of the diagonals, against 80 bits: thin rods, and sizes of many decades."""
    rng = random.Random(3)
    worst = 0.0
    for _ in range(20):
        chain = build_chain(tuple(hard_link(rng, kind, i) for i in range(6)), (0.0, 0.0, -G))
        q = [rng.uniform(-3.0, 3.0) for _ in range(6)]
        frames = chain_frames(chain, q)
        matrix = [0.0] * 36
        mass_matrix(chain, q, frames, chain_screws(frames), BASE, matrix, [0.0] * 6)
        wanted = exact_mass_matrix(chain, q)
        root = np.sqrt(np.diag(wanted))
        off = np.abs(np.reshape(matrix, (6, 6)) - wanted) / np.outer(root, root)
        worst = max(worst, float(off.max()))
    assert worst < (1e-12 if kind == "rods" else 1e-11)


def hard_link(rng: random.Random, kind: str, number: int) -> Link:
    turn = roll_pitch_yaw(rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), 0.0)
    if kind == "rods":
        rod = Body(1.0, (0.0, 0.0, 0.1), ((1e-2, 0, 0), (0, 1e-2, 0), (0, 0, 1e-8)))
        return Link(f"j{number}", "turns", (0.1, 0.0, 0.2), turn, body=rod)
    size = 10 ** rng.uniform(-3.0, 3.0)
    place, centre = ((*(s * rng.uniform(-1.0, 1.0) for _ in range(3)),) for s in (size, 0.1 * size))
    square = 1e-3 * size * size
    inertia = ((square, 0.0, 0.0), (0.0, 2.0 * square, 0.0), (0.0, 0.0, 2.5 * square))
    body = Body(10 ** rng.uniform(-5.0, 5.0), centre, inertia)
    return Link(f"j{number}", rng.choice(("turns", "slides")), place, turn, body=body)


def exact_mass_matrix(chain: Any, q: list[float]) -> Any:
    """Return the mass matrix as a sum over the bodies, in 80 bits where there are as many."""
    real = np.longdouble
    count = len(q)
    place, turn = np.zeros(3, real), np.eye(3, dtype=real)
    turn[:2, :2] = [[chain.cb, -chain.sb], [chain.sb, chain.cb]]
    axes, places = [], []
    total = np.zeros((count, count), real)
    for at, joint in zip(q, chain.joints, strict=True):
        place = place + turn @ np.array([joint.x, joint.y, joint.z], real)
        ca, sa = joint.ca, joint.sa
        turn = turn @ np.array([[1, 0, 0], [0, ca, -sa], [0, sa, ca]], real)
        angle = real(joint.offset) + (real(at) if joint.turns else real(0))
        if not joint.turns:
            place = place + real(at) * turn[:, 2]
        cq, sq = np.cos(angle), np.sin(angle)
        turn = turn @ np.array([[cq, -sq, 0], [sq, cq, 0], [0, 0, 1]], real)
        axes.append(turn[:, 2])
        places.append(place)
        spin, way = np.zeros((3, count), real), np.zeros((3, count), real)
        for k, axis in enumerate(axes):
            if chain.joints[k].turns:
                spin[:, k], way[:, k] = axis, np.cross(axis, place - places[k])
            else:
                way[:, k] = axis
        a, b, c, d, e, f = joint[11:]
        inertia = turn @ np.array([[a, d, e], [d, b, f], [e, f, c]], real) @ turn.T
        x, y, z = turn @ np.array([joint.mx, joint.my, joint.mz], real)
        moment = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]], real)
        total += spin.T @ (inertia @ spin + moment @ way)
        total += way.T @ (joint.mass * way - moment @ spin)
    return total


def shared(body: Any, one: Any, other: Any) -> float:
    """Return a body's momentum as the one screw moves it, along the other."""
    m, sx, sy, sz, xx, yy, zz, xy, xz, yz = body
    a, b, c, u, v, w = one
    moment = (
        xx * a + xy * b + xz * c + sy * w - sz * v,
        xy * a + yy * b + yz * c + sz * u - sx * w,
        xz * a + yz * b + zz * c + sx * v - sy * u,
    )
    push = (m * u + b * sz - c * sy, m * v + c * sx - a * sz, m * w + a * sy - b * sx)
    return float(sum(p * s for p, s in zip((*moment, *push), other, strict=True)))


@pytest.mark.parametrize("seed", range(6))
def test_gravity_is_the_slope_of_the_potential_and_its_bound_holds(seed: int) -> None:
    rng = random.Random(seed)
    count = rng.randint(2, 7)
    chain = build_chain(draw_chain(rng, count), (1.0, -2.0, -9.0))
    q = [rng.uniform(-2.0, 2.0) for _ in range(count)]
    bound = [0.0] * count
    gravity_stiffness(chain, [2.0] * count, bound)
    weight = [0.0] * count
    chain_gravity(chain, chain_frames(chain, q), weight)
    slopes = []
    for i in range(count):
        ends = []
        for step in (1e-5, -1e-5):
            moved = list(q)
            moved[i] += step
            there = [0.0] * count
            ends.append((chain_gravity(chain, chain_frames(chain, moved), there), there))
        assert (ends[0][0] - ends[1][0]) / 2e-5 == pytest.approx(weight[i], rel=1e-6, abs=1e-6)
        slopes.append(sum(abs(a - b) / 2e-5 for a, b in zip(ends[0][1], ends[1][1], strict=True)))
    assert all(s <= b * (1 + 1e-6) + 1e-6 for s, b in zip(slopes, bound, strict=True))


@pytest.mark.parametrize("seed", range(4))
def test_the_jacobian_is_the_slope_of_the_pose(seed: int) -> None:
    rng = random.Random(seed)
    count = rng.randint(2, 7)
    chain = build_chain(draw_chain(rng, count), (0.0, 0.0, -G))
    q = [rng.uniform(-2.0, 2.0) for _ in range(count)]
    jacobian = [0.0] * (6 * count)
    pose = chain_jacobian(chain, q, jacobian)
    assert pose == tip_pose(chain, chain_frames(chain, q))
    for i in range(count):
        ends = []
        for step in (1e-6, -1e-6):
            moved = list(q)
            moved[i] += step
            ends.append(tip_pose(chain, chain_frames(chain, moved)))
        slope = [(a - b) / 2e-6 for a, b in zip(*ends, strict=True)]
        assert slope[:3] == pytest.approx(jacobian[6 * i : 6 * i + 3], abs=1e-7)
        for at in (3, 6, 9):  # every axis of the tip turns with its angular velocity
            x, y, z = pose[at : at + 3]
            wx, wy, wz = jacobian[6 * i + 3 : 6 * i + 6]
            turned = (wy * z - wz * y, wz * x - wx * z, wx * y - wy * x)
            assert slope[at : at + 3] == pytest.approx(turned, abs=1e-7)


def test_bodies_join_as_one() -> None:
    empty = Body()
    body = Body(1.5, (0.1, -0.2, 0.3), ((1e-3, 0, 0), (0, 2e-3, 0), (0, 0, 2.5e-3)))
    assert joined(empty, body) == body
    twin = joined(body, body._replace(centre=(-0.1, 0.2, -0.3)))
    assert twin.mass == 3.0
    assert twin.centre == pytest.approx((0.0, 0.0, 0.0), abs=1e-17)
    assert twin.inertia[0][0] == pytest.approx(2e-3 + 3.0 * (0.2**2 + 0.3**2))
    assert twin.inertia[0][1] == pytest.approx(3.0 * 0.1 * 0.2)


def test_a_matrix_that_no_body_has_is_seen() -> None:
    assert is_inertia(1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    assert not is_inertia(1.0, 1.0, -1e-3, 0.0, 0.0, 0.0)
    assert not is_inertia(1.0, 1.0, 1.0, 1.1, 0.0, 0.0)
    assert not is_inertia(1.0, 1.0, 1.0, 0.9, 0.9, -0.9)


def test_a_load_is_the_slope_of_its_energy() -> None:
    p = LoadParams(0.3, -0.7, 0.2)
    for x in (-2.0, 0.1, 1.4):
        slope = (load_energy(p, x + 1e-6) - load_energy(p, x - 1e-6)) / 2e-6
        assert -slope == pytest.approx(load_effort(p, x), abs=1e-9)
        change = abs(load_effort(p, x + 1e-6) - load_effort(p, x - 1e-6)) / 2e-6
        assert change <= load_stiffness(p) + 1e-9
    assert load_stiffness(p) == pytest.approx(math.hypot(0.7, 0.2))


@pytest.mark.slow
@pytest.mark.nightly
def test_compiled_chains_give_the_bits_of_the_plain_ones() -> None:
    pytest.importorskip("numba")
    import numpy as np

    rng = random.Random(1)
    chain = build_chain(draw_chain(rng, 5), (0.0, 1.0, -G))
    compiled = chains.compile_part(chains.moved)
    for _ in range(20):
        q = [rng.uniform(-2, 2) for _ in range(5)]
        lists = [[0.0] * size for size in (30, 5, 25)]
        arrays = [np.zeros(size) for size in (30, 5, 25)]
        assert compiled(chain, np.array(q), *arrays) == chains.moved(chain, q, *lists)
        assert [array.tolist() for array in arrays] == lists


def test_postures_of_compiled_work_are_one_and_wait_for_each_other(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What a call returns goes into the next one's posture, too small to change a bit of it."""
    postures, returned = [], [1.5, -2.5e5, 0.0, 1e-3]

    def law(chain: Any, q: Any, jacobian: Any, weight: Any, matrix: Any) -> float:
        postures.append([*q, chain is chains.CHAIN, len(jacobian), len(weight), len(matrix)])
        return returned[len(postures) - 1]

    plain = SimpleNamespace(njit=lambda **_: lambda function: function)
    monkeypatch.setattr(chains, "importlib", SimpleNamespace(import_module=lambda _: plain))
    monkeypatch.setattr(chains, "compile_part", lambda part: law)
    assert chains.compiled_work(chains.moved, (42, 7, 49))(4) >= 0.0
    assert postures == [[*chains.PLACES, True, 42, 7, 49]] * 4


@pytest.mark.parametrize("with_numba", [False, True])
def test_a_table_of_chains_is_in_microseconds(
    with_numba: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[list[str]] = []

    def costs(works: Any, rounds: int) -> dict[str, Cost]:
        given.append(list(works))
        spent = 3000.0 if len(given) == 1 else 500.0
        return {name: Cost(spent * (k + 1), 2.0 * spent, rounds, 9) for k, name in enumerate(works)}

    monkeypatch.setattr(chains, "costs", costs)
    monkeypatch.setattr(chains, "compiled_work", lambda part, sizes: part)
    table = chains.chain_table(5, with_numba=with_numba)
    names = [
        "forward kinematics with Jacobian",
        "the same with gravity",
        "the same with the mass matrix",
    ]
    assert given == [names] * (1 + with_numba)
    assert table.title == "Serial chain of 7 joints"
    assert table.columns == ("part", "plain_us", "plain_median_us", "compiled_us")
    assert table.rows == [
        [name, 3.0 * k, 6.0, 0.5 * k if with_numba else None] for k, name in enumerate(names, 1)
    ]


def test_fixed_links_before_the_first_joint_only_place_it() -> None:
    arm = Link("a", "turns", (0.1, 0.0, 0.0), axis=(0.0, 1.0, 0.0), body=Body(1.0, (0.2, 0, 0)))
    heavy = Link("base", "fixed", (0.0, 0.0, 0.5), body=Body(9.0, (1.0, 0.0, 0.0)))
    weights = []
    for links in ((arm,), (heavy, arm)):
        chain = build_chain(links, (0.0, 0.0, -G))
        weight = [0.0]
        chain_gravity(chain, chain_frames(chain, (0.3,)), weight)
        weights.append(weight[0])
    assert weights[0] == pytest.approx(-G * 0.2 * math.cos(0.3), rel=1e-14)
    assert weights[1] == pytest.approx(weights[0], rel=1e-14)
