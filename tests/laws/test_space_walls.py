"""Walls in space: what comes back is never faster, edges and plates hold, friction sticks."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

import pytest

from tautwave.laws.space.proxy import (
    MESH,
    Surface,
    convex,
    cylinder,
    mesh,
    path,
    plane,
    proxy_of,
    sphere,
)
from tautwave.laws.space.wall import SpaceWallParams, allowed_share, wall_force, wall_proxy

MASS, STIFFNESS, PERIOD = 0.1, 1000.0, 1e-3


def box(size: float, thick: float) -> list[tuple[float, ...]]:
    faces: list[tuple[float, ...]] = []
    for axis, half in ((0, size), (1, size), (2, thick)):
        faces += [
            (*(sign if i == axis else 0.0 for i in range(3)), 0.5 * half) for sign in (1.0, -1.0)
        ]
    return faces


CORNERS = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)]
TRIANGLES = [
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
]  # fmt: skip
WEDGE = [(0.0, 0.6, 0.8, 0.03), (0.0, -0.6, 0.8, 0.03), (0.0, 0.0, -1.0, 0.1)]
SHAPES: dict[str, Surface] = {
    "plane": plane((0.0, 0.0, 0.0), (0.1, 0.2, 1.0)),
    "sphere": sphere((0.0, 0.0, 0.0), 0.1),
    "hollow": sphere((0.0, 0.0, 0.0), 0.35, hollow=True),
    "cylinder": cylinder((0.0, 0.0, 0.0), (0.3, 0.1, 1.0), 0.08, 0.2),
    "box": convex(box(0.2, 0.2)),
    "convex": convex(WEDGE),
    "mesh": mesh(CORNERS, TRIANGLES),
    "path": path([(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)], 0.02),
}


def fly(
    surface: Surface, x: list[float], v: list[float], controlled: bool, friction: float = 0.0
) -> tuple[float, bool, list[float]]:
    """Move a free mass until it has left the wall; greatest kinetic energy, touched, where."""
    p = SpaceWallParams(surface, STIFFNESS, 0.0, friction, math.inf)
    proxy = list(x)
    account, touched, most = 0.0, False, 0.0
    left = 4000
    while left > 0:
        left -= 1
        *proxy, depth = wall_proxy(p, *proxy, *x)
        if depth == 0.0:
            if touched:
                break
            account = 0.0
        if depth > 0.0 and not touched:
            touched, left = True, min(left, 200)  # a path keeps what it has
        force = list(wall_force(p, *(a - b for a, b in zip(proxy, x, strict=True)), *v))
        given = PERIOD * sum(f * w for f, w in zip(force, v, strict=True))
        fast = 0.5 * PERIOD**2 / MASS * sum(f * f for f in force)
        share = allowed_share(account, given, fast) if controlled else 1.0
        account -= share * given + share * share * fast
        for i in range(3):
            push = share * force[i] / MASS
            x[i] += v[i] * PERIOD + 0.5 * push * PERIOD**2
            v[i] += push * PERIOD
        most = max(most, sum(w * w for w in v))
        if math.dist(x, (0.0, 0.0, 0.0)) > 5.0:
            break
    return most, touched, x


def bounces(surface: Surface, count: int, controlled: bool, friction: float = 0.0) -> float:
    """Return the greatest ratio of speeds after and before, of a mass thrown at a surface."""
    rng = random.Random(3)
    worst = 0.0
    done = 0
    while done < count:
        way = [rng.gauss(0.0, 1.0) for _ in range(3)]
        size = math.sqrt(sum(part * part for part in way))
        x = [0.25 * part / size for part in way]
        aim = [rng.uniform(-0.1, 0.1) for _ in range(3)]
        speed = rng.uniform(1.0, 4.0)
        far = math.dist(aim, x)
        v = [speed * (a - b) / far for a, b in zip(aim, x, strict=True)]
        most, touched, _ = fly(surface, x, v, controlled, friction)
        done += 1
        if touched:
            worst = max(worst, math.sqrt(most) / speed)
    return worst


@pytest.mark.parametrize("shape", SHAPES)
def test_nothing_comes_back_faster(shape: str) -> None:
    assert bounces(SHAPES[shape], 12, controlled=True, friction=0.3) <= 1.0 + 1e-9


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.timeout(600)
@pytest.mark.parametrize("shape", SHAPES)
def test_2000_bounces_come_back_no_faster(shape: str) -> None:
    assert 0.5 < bounces(SHAPES[shape], 2000, controlled=True) <= 1.0 + 1e-9


def test_without_the_account_they_do() -> None:
    assert bounces(SHAPES["sphere"], 12, controlled=False) > 1.01


def test_a_thin_plate_is_not_passed_at_5_m_per_s() -> None:
    corners = [(-1.0, -1.0, 0.0), (1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (-1.0, 1.0, 0.0)]
    sheet = mesh(corners, [(0, 1, 2), (0, 2, 3)])
    for surface in (convex(box(0.4, 1e-3)), sheet):
        for tilt in (0.0, 0.02, 0.3):
            for start in (0.1, 0.1013, 0.1041):
                x, v = [-tilt * start, 0.003, start], [5.0 * tilt, 0.0, -5.0]
                _, touched, x = fly(surface, x, v, controlled=True)
                assert touched
                assert x[2] > -1e-6


def slide(
    surface: Surface, start: Sequence[float], end: Sequence[float], friction: float
) -> list[tuple[float, float, float]]:
    """Lead a tip slowly from start to end; return where its proxy was."""
    p = SpaceWallParams(surface, STIFFNESS, 0.0, friction, math.inf)
    proxy: tuple[float, ...] = tuple(start)
    places = []
    for k in range(1001):
        x = [a + k / 1000 * (b - a) for a, b in zip(start, end, strict=True)]
        proxy = wall_proxy(p, *proxy, *x)[:3]  # type: ignore[misc]
        places.append(proxy)
    return places  # type: ignore[return-value]


@pytest.mark.parametrize("shape", ["box", "mesh"])
def test_a_peg_led_along_an_edge_stays_outside_and_goes_over_it(shape: str) -> None:
    places = slide(SHAPES[shape], (-0.2, 0.0, 0.105), (0.25, 0.02, 0.09), 0.0)
    inside = [max(abs(c) for c in place) < 0.1 - 1e-6 for place in places]
    assert not any(inside)
    steps = [math.dist(a, b) for a, b in zip(places[1:], places[:-1], strict=True)]
    over = [at for at, place in enumerate(places) if abs(place[2] - 0.1) < 1e-5]
    assert len(over) > 200  # along the top
    assert places[-1] == pytest.approx((0.25, 0.02, 0.09))
    # Over the edge it falls by no more than it was pushed in.
    assert max(steps) < 0.02


def test_in_a_corner_of_a_mesh_it_stops_and_leaves_it_again() -> None:
    corners = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    corner = mesh(corners, [(0, 1, 2), (0, 2, 3), (0, 1, 3)])
    assert corner.kind == MESH
    places = slide(corner, (0.2, 0.2, 0.2), (-0.1, -0.2, -0.05), 0.0)
    assert places[-1] == pytest.approx((0.0, 0.0, 0.0), abs=1e-5)
    assert min(min(place) for place in places) > 0.0
    back = slide(corner, places[-1], (0.3, 0.1, 0.2), 0.0)
    assert back[-1] == pytest.approx((0.3, 0.1, 0.2))


def test_friction_sticks_then_slides() -> None:
    floor = SHAPES["plane"]
    p = SpaceWallParams(plane((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), STIFFNESS, 0.0, 0.5, math.inf)
    assert wall_proxy(p, 0.0, 0.0, 0.0, 4e-3, 0.0, -0.01)[0] == pytest.approx(0.0)
    slid = wall_proxy(p, 0.0, 0.0, 0.0, 8e-3, 0.0, -0.01)
    assert slid == pytest.approx((3e-3, 0.0, 0.0, 0.01))  # 0.5 times the depth behind
    assert floor.numbers[3] == pytest.approx(0.0)


def test_a_path_leads_and_lets_go_within_its_radius() -> None:
    line = SHAPES["path"]
    assert proxy_of(line, 0.0, 0.0, 0.0, -0.5, 0.01, 0.0) == (-0.5, 0.01, 0.0)
    assert proxy_of(line, 0.0, 0.0, 0.0, -0.5, 0.05, 0.0) == pytest.approx((-0.5, 0.02, 0.0))


def test_a_cylinder_pushes_out_of_its_ends_too() -> None:
    disc = cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.2, 0.01)
    assert proxy_of(disc, 0.0, 0.0, 0.006, 0.0, 0.0, -0.004) == pytest.approx((0.0, 0.0, 0.005))
    assert proxy_of(disc, 0.21, 0.0, 0.0, 0.198, 0.0, 0.0) == pytest.approx((0.2, 0.0, 0.0))


def test_the_share_of_a_force_is_what_its_account_pays() -> None:
    rng = random.Random(1)
    for _ in range(300):
        account, given = rng.uniform(0.0, 1.0), rng.uniform(-1.0, 1.0)
        fast = rng.uniform(0.0, 2.0)
        share = allowed_share(account, given, fast)
        assert 0.0 <= share <= 1.0
        assert share * given + share * share * fast <= account + 1e-12
        if share < 1.0:
            assert share * given + share * share * fast == pytest.approx(account, abs=1e-9)
    assert wall_force(SpaceWallParams(SHAPES["plane"], 1.0, 1.0, 0.0, 5.0), 0, 0, 0, 1, 1, 1) == (
        0.0, 0.0, 0.0,
    )  # fmt: skip


def test_between_two_triangles_the_proxy_is_the_nearest_place_above_both() -> None:
    """Sheets of any slant that meet in a line: the foot of the perpendicular onto that line."""
    rng = random.Random(11)
    met = flat = 0
    for turn in range(400):
        tilt = rng.choice([0.04, 0.3, 1.0])  # of the sheets to each other: some nearly in a plane
        one = [rng.gauss(0.0, 1.0) for _ in range(3)]
        two = [a + tilt * rng.gauss(0.0, 1.0) for a in one]
        normals = []
        sheets: list[tuple[float, ...]] = []
        for n in (one, two):
            size = math.dist(n, (0.0, 0.0, 0.0))
            n = [part / size for part in n]
            normals.append(n)
            u = [n[1], -n[0], 0.0] if abs(n[2]) < 0.9 else [0.0, n[2], -n[1]]
            length = math.dist(u, (0.0, 0.0, 0.0))
            u = [part / length for part in u]
            w = [n[1] * u[2] - n[2] * u[1], n[2] * u[0] - n[0] * u[2], n[0] * u[1] - n[1] * u[0]]
            sheets += [
                tuple(a * p + b * q for p, q in zip(u, w, strict=True))
                for a, b in ((30.0, 0.0), (-15.0, 26.0), (-15.0, -26.0))
            ]
        surface = mesh(sheets, [(0, 1, 2), (3, 4, 5)])
        (a, b) = normals
        above = [0.1 * (p + q) for p, q in zip(a, b, strict=True)]
        below = [
            x - 0.3 * (p + q) + 0.01 * rng.gauss(0.0, 1.0)
            for x, p, q in zip(above, a, b, strict=True)
        ]
        proxy = above
        for _ in range(3):  # as a wall asks for it, cycle after cycle
            proxy = list(proxy_of(surface, *proxy, *below))
        depths = [sum(n * x for n, x in zip(one, below, strict=True)) for one in (a, b)]
        c = sum(p * q for p, q in zip(a, b, strict=True))
        s, t = ((depths[k] - c * depths[1 - k]) / (1.0 - c * c) for k in (0, 1))
        if s < 0.0 and t < 0.0:  # both hold it back: it stands on the line where they meet
            met += 1
            flat += 1.0 - c * c < 0.01
            foot = [x - s * p - t * q for x, p, q in zip(below, a, b, strict=True)]
            assert math.dist(proxy, foot) < 1e-4, turn
        assert all(sum(n * x for n, x in zip(one, proxy, strict=True)) > 0.0 for one in (a, b))
    assert met > 100
    assert flat > 10
