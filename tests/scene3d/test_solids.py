"""Walls from STL and OBJ files: what is read and refused, distances, and energy on any path."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from tautwave.config import load_rig
from tautwave.errors import ConfigError
from tautwave_scenes.config.solid_files import read_solid
from tautwave_scenes.models.solid import MAX_TRIANGLES, laid_out, solid_of, volume_of
from tautwave_scenes.models.surface import FACE, on_triangle, surface_of
from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks3d.live import SPACE_SCHEMES, Model3d
from tautwave_scenes.networks3d.network import ORIGIN, Mass3d, Network3d, Port3d
from tautwave_scenes.session.plan import solid_facts
from tautwave_scenes.simulation import tick3d
from tests.scene.test_ticking import bits
from tests.scene3d.networks import flat
from tests.scene3d.solids import Shape, angle, ascii_stl, ball, binary_stl, box, made, obj

SHAPES = {"box": box(0.02, 0.03, 0.01), "angle": angle(), "ball": ball(0.02, 5)}
Distance = Callable[[float, float, float], tuple[float, float, float, float]]


def distance_of(shape: Shape) -> Distance:
    """Return signed distance and gradient, each time guessing another triangle."""
    solid = made(shape)
    laid, draw = laid_out(solid), random.Random(0)
    end, most = len(laid.tree) // 2, len(solid.triangles)
    return lambda x, y, z: surface_of(*laid, 0, end, draw.randrange(most), x, y, z)[:4]


# -- files ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_the_same_in_every_format(name: str, tmp_path: Path) -> None:
    shape = SHAPES[name]
    files = {"a.stl": ascii_stl(shape), "b.stl": binary_stl(shape, b"solid of a CAD"),
             "c.OBJ": obj(shape)}  # fmt: skip
    for file, data in files.items():
        (tmp_path / file).write_bytes(data)
        solid = read_solid(tmp_path / file)
        assert len(solid.triangles) == len(shape[1])
        assert volume_of(solid) == pytest.approx(volume_of(made(shape)), rel=1e-6)


def test_polygons_and_corners_counted_backwards_are_read(tmp_path: Path) -> None:
    points, _ = box(0.02, 0.03, 0.01)
    quads = [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0), (4, 5, 6, 7)]
    lines = [f"v {x} {y} {z}" for x, y, z in points]
    lines += ["f " + " ".join(str(at - 8) for at in one) for one in quads]
    (tmp_path / "quads.obj").write_text("\n".join(lines))
    solid = read_solid(tmp_path / "quads.obj")
    assert len(solid.triangles) == 12
    assert volume_of(solid) == pytest.approx(8 * 0.02 * 0.03 * 0.01)


def wrong() -> dict[str, tuple[str, bytes, str]]:
    points, triangles = box(0.02, 0.03, 0.01)
    turned = [one[::-1] for one in triangles]
    whole = binary_stl((points, triangles))
    text = ascii_stl((points, triangles))
    return {
        "open": ("x.stl", binary_stl((points, triangles[1:])), "not closed: 3 edges"),
        "flipped": ("x.stl", binary_stl((points, [turned[0], *triangles[1:]])), "flipped"),
        "inside out": ("x.stl", binary_stl((points, turned)), "inside out"),
        "fin": ("x.stl", binary_stl((points, [*triangles, (0, 1, 6)])), "more than two"),
        "cut": ("x.stl", whole[:-30], "684 bytes, and it has 654"),
        "short": ("x.stl", whole[:60], "60 bytes are no STL"),
        "cut text": ("x.stl", text[: len(text) // 2], "cut short"),
        "not finite": (
            "x.stl", binary_stl(([(math.nan, 0.0, 0.0), *points[1:]], triangles)), "is not finite",
        ),
        "word": ("x.stl", text.replace(b"vertex 0.02", b"vertex far", 1), "x.stl:4: three numbers"),
        "empty": ("x.stl", binary_stl((points, [])), "no triangles"),
        "flat": ("x.stl", binary_stl((points, [(0, 0, 1)])), "no triangle with an area"),
        "corner": ("x.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "x.obj:4: there is no corner"),
        "edge": ("x.obj", b"v 0 0 0\nv 1 0 0\nf 1 2\n", "needs three corners"),
        "no faces": ("x.obj", b"v 0 0 0\n", "no triangles"),
        "other": ("x.ply", b"ply", ".stl or .obj"),
    }  # fmt: skip


@pytest.mark.parametrize("case", wrong())
def test_what_encloses_nothing_is_refused_by_name(case: str, tmp_path: Path) -> None:
    name, data, words = wrong()[case]
    (tmp_path / name).write_bytes(data)
    with pytest.raises(ValueError, match=words) as caught:
        read_solid(tmp_path / name)
    assert "\n" not in str(caught.value)


def test_too_many_triangles_are_refused_before_they_are_welded() -> None:
    with pytest.raises(ValueError, match="50000 are the limit"):
        solid_of([ORIGIN], [(0, 0, 0)] * (MAX_TRIANGLES + 1), "x.stl")


def test_triangles_without_an_area_and_doubled_ones_are_dropped_with_a_count() -> None:
    points, triangles = box(0.02, 0.03, 0.01)
    a, b, c = triangles[3]
    solid = solid_of(points, [*triangles, (b, c, a), (0, 0, 1), (2, 2, 2)], "x.stl")
    assert (len(solid.triangles), solid.doubled, solid.flat) == (12, 1, 2)


# -- distance -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_the_tree_finds_the_nearest_of_all_triangles(name: str) -> None:
    solid, distance, draw = made(SHAPES[name]), distance_of(SHAPES[name]), random.Random(1)
    faces = laid_out(solid).faces
    for _ in range(100):
        place = [draw.uniform(-0.04, 0.04) for _ in range(3)]
        nearest = min(
            on_triangle(faces, FACE * at, *place)[0] for at in range(len(solid.triangles))
        )
        assert abs(distance(*place)[0]) == pytest.approx(math.sqrt(nearest), abs=1e-15)


def test_a_box_has_the_distance_of_a_box_inside_and_outside() -> None:
    distance, draw = distance_of(SHAPES["box"]), random.Random(2)
    for _ in range(300):
        place = [draw.uniform(-0.05, 0.05) for _ in range(3)]
        over = [abs(part) - half for part, half in zip(place, (0.02, 0.03, 0.01), strict=True)]
        known = max(over) if max(over) < 0.0 else math.hypot(*(max(part, 0.0) for part in over))
        found = distance(*place)
        assert found[0] == pytest.approx(known, abs=1e-15)
        assert math.hypot(*found[1:]) == pytest.approx(1.0)


@pytest.mark.parametrize("name", SHAPES)
def test_the_sign_is_the_winding_number(name: str) -> None:
    """Nearest to an edge or a corner as well, where a face's own normal tells wrong."""
    solid, distance, draw = made(SHAPES[name]), distance_of(SHAPES[name]), random.Random(3)
    for _ in range(50):
        corner = solid.points[draw.randrange(len(solid.points))]
        x, y, z = (part + draw.uniform(-0.004, 0.004) for part in corner)
        total = 0.0
        for one in solid.triangles:
            a, b, c = ([p - q for p, q in zip(solid.points[at], (x, y, z), strict=True)]
                       for at in one)  # fmt: skip
            la, lb, lc = math.hypot(*a), math.hypot(*b), math.hypot(*c)
            cross = [
                b[1] * c[2] - b[2] * c[1],
                b[2] * c[0] - b[0] * c[2],
                b[0] * c[1] - b[1] * c[0],
            ]
            dots = [
                sum(p * q for p, q in zip(u, v, strict=True)) for u, v in ((a, b), (b, c), (c, a))
            ]
            top = sum(p * q for p, q in zip(a, cross, strict=True))
            total += 2.0 * math.atan2(
                top, la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
            )
        assert (distance(x, y, z)[0] < 0.0) == (total > 2.0 * math.pi)


# -- energy ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", SHAPES)
def test_no_step_of_a_held_force_creates_more_than_a_spring_of_its_stiffness(name: str) -> None:
    """k |step|^2 / 2 for any two places, over edges and where the nearest face changes.

    So what certifies a spring of that stiffness along a step certifies the wall.
    """
    distance, draw = distance_of(SHAPES[name]), random.Random(4)
    worst = 0.0
    for _ in range(600):
        place = [draw.uniform(-0.025, 0.025) for _ in range(3)]
        size = 10.0 ** draw.uniform(-4.0, -1.5)
        step = [size * draw.gauss(0.0, 1.0) for _ in range(3)]
        far, *way = distance(*place)
        after = distance(*(p + q for p, q in zip(place, step, strict=True)))[0]
        depth, deeper = min(far, 0.0), min(after, 0.0)
        work = depth * sum(p * q for p, q in zip(way, step, strict=True))
        created = 0.5 * deeper * deeper - 0.5 * depth * depth - work
        worst = max(worst, created / (0.5 * sum(part * part for part in step)))
    assert 0.5 < worst <= 1.0 + 1e-9


def hit(shape: Shape, mass: Mass3d, stiffness: float, exponent: float = 1.0) -> Network3d:
    """Return a mass that flies at a solid."""
    touch = Link("c", "contact", mass.name, "s", stiffness=stiffness, exponent=exponent, solid=True)
    return Network3d(
        (mass,), (touch,), grounds=(("s", ORIGIN),), solids=(("s", made(shape)),),
        recorded=(mass.name,),
    )  # fmt: skip


FLIGHTS = {
    "face": ("box", (0.001, 0.002, 0.02), (0.3, 0.1, -1.0), 2000.0),
    "edge": ("box", (0.03, 0.002, 0.02), (-0.8, 0.1, -0.9), 2000.0),
    "corner": ("box", (0.03, 0.04, 0.02), (-0.9, -0.9, -0.9), 2000.0),
    "inner edge": ("angle", (0.015, 0.019, 0.001), (-0.9, -1.0, 0.0), 2000.0),
    "along the inner edge": ("angle", (0.005, 0.005, 0.005), (-2.0, -2.1, -0.3), 300.0),
    "ball": ("ball", (0.003, 0.002, 0.03), (0.0, 0.1, -2.0), 2000.0),
    "through the plate": ("box", (0.0105, 0.002, 0.02), (-0.4, 0.1, -3.0), 200.0),
    "through the middle of the ball": ("ball", (0.001, 0.0, 0.03), (0.0, 0.05, -4.0), 100.0),
}


@pytest.mark.parametrize("exponent", [1.0, 1.5])
@pytest.mark.parametrize("name", FLIGHTS)
def test_a_mass_leaves_a_solid_with_the_energy_it_came_with(name: str, exponent: float) -> None:
    shape, place, speed, stiffness = FLIGHTS[name]
    if exponent == 1.5:
        stiffness *= 10.0
    mass = Mass3d("m", 0.01, place, speed)
    model = Model3d(hit(SHAPES[shape], mass, stiffness, exponent), "discrete_gradient", 1e-3)
    begun = 0.005 * sum(part * part for part in speed)
    touched = 0.0
    for _ in range(60):
        model.advance([])
        touched = max(touched, model.arrays.stored[0])
        assert abs(model.residual()) < 1e-12 * begun
    s = model.arrays
    assert touched > 0.01 * begun
    assert s.stored[0] == 0.0
    assert 0.005 * sum(part * part for part in s.v[:3]) == pytest.approx(begun, rel=1e-12)


def test_a_symplectic_step_books_what_it_creates() -> None:
    mass = Mass3d("m", 0.01, (0.03, 0.002, 0.02), (-0.8, 0.1, -0.9))
    model = Model3d(hit(SHAPES["box"], mass, 2000.0), "symplectic", 1e-4)
    for _ in range(600):
        model.advance([])
        assert abs(model.residual()) < 1e-15
    assert sum(part * part for part in model.arrays.v[:3]) == pytest.approx(1.46, rel=0.02)


def test_a_closed_path_of_a_port_gives_no_more_than_its_held_steps() -> None:
    """Around the inner edge, over the outer ones, and where the nearest face changes inside."""
    touch = Link("c", "contact", "tip", "s", stiffness=1000.0, solid=True)
    network = Network3d(
        (), (touch,), (Port3d("tip", ("x", "y", "z")),), (("s", ORIGIN),),
        solids=(("s", made(angle())),),
    )  # fmt: skip
    corners = [
        (0.01, 0.015, 0.0), (-0.005, -0.004, 0.004), (-0.019, -0.018, 0.0), (-0.025, 0.015, 0.0),
        (-0.004, 0.012, 0.008), (0.012, -0.003, -0.009), (0.015, -0.025, 0.0), (0.01, 0.015, 0.0),
    ]  # fmt: skip
    for steps in (100, 200, 300):
        model = Model3d(network, "discrete_gradient", 1e-3)
        model.reset(list(corners[0]))
        work, held, last, efforts = 0.0, 0.0, corners[0], [0.0, 0.0, 0.0]
        for begin, end in pairwise(corners):
            for k in range(1, steps + 1):
                place = tuple(p + (q - p) * k / steps for p, q in zip(begin, end, strict=True))
                held += 0.5 * 1000.0 * math.dist(last, place) ** 2
                work -= sum(e * (q - p) for e, p, q in zip(efforts, last, place, strict=True))
                last, efforts = place, model.advance(list(place))
        assert abs(model.residual()) < 1e-15
        assert work <= held, "no more than a spring of this stiffness"


# -- compiled, rigs -------------------------------------------------------------------------------


def bumped() -> Network3d:
    network = hit(
        SHAPES["ball"], Mass3d("m", 0.01, (0.003, 0.002, 0.021), (0.0, 0.1, -2.0)), 2000.0
    )
    box_of = ("t", made(box(0.004, 0.004, 0.004)))
    touch = Link("d", "contact", "tip", "t", stiffness=500.0, solid=True)
    return network._replace(
        links=(*network.links, touch),
        ports=(Port3d("tip", ("x", "y", "z")),),
        grounds=(*network.grounds, ("t", ORIGIN)),
        solids=(*network.solids, box_of),
    )


@pytest.mark.parametrize("scheme", SPACE_SCHEMES)
@pytest.mark.parametrize("by", ["source", pytest.param("numba", marks=pytest.mark.slow)])
def test_compiled_steps_are_the_live_ones_to_the_bit(
    scheme: str, by: str, monkeypatch: Any
) -> None:
    pytest.importorskip("numba")
    from tautwave_scenes.simulation import ticking3d

    if by == "source":
        monkeypatch.setattr(ticking3d, "compiled_tick3d", lambda: tick3d.tick_network3d)
    network = bumped()
    fast = ticking3d.CompiledModel3d(network, scheme, 1e-3)
    slow = Model3d(network, scheme, 1e-3, keep_books=True)
    for model in (fast, slow):
        model.reset([0.005, 0.0, 0.0])
    felt = False
    for k in range(12):
        place = [0.005 - 8e-4 * k, 1e-4 * k, 2e-4 * k]
        efforts = fast.advance(place)
        felt = felt or any(efforts)
        assert bits(efforts) == bits(slow.advance(place))
        assert bits(fast.booked) == bits(slow.booked)
    assert felt
    assert bits(flat(fast.arrays)) == bits(flat(slow.arrays))


RIG = """
name: solid
rate_hz: 1000
duration_s: 0.2
buses: {hand: {driver: loopback}}
master:
  axes:
    x:
      {bus: hand, id: 1, kind: linear, inertia: {value: 0.08, lower: 0.06, source: data sheet},
       damping: {value: 0.8, lower: 0.5, source: data sheet}, effort_limit: 10, velocity_limit: 5}
scene:
  dimension: 3
  solids:
    wall: {mesh: wall.stl, scale: 0.001, turn: [0, 0, 1.5707963267948966], position: [0, 0.01, 0]}
  links:
    touch: {type: contact, between: [tip, wall], stiffness: 800}
  ports:
    tip: {axes: [x], offset: [0.035, 0, 0]}
simulation: {}
"""


@pytest.fixture
def rig_file(tmp_path: Path) -> Path:
    points, triangles = box(20.0, 30.0, 10.0)
    (tmp_path / "wall.stl").write_bytes(binary_stl((points, [*triangles, triangles[0]])))
    (tmp_path / "rig.yaml").write_text(RIG)
    return tmp_path / "rig.yaml"


def test_a_solid_is_placed_and_what_it_is_is_printed(rig_file: Path) -> None:
    ((name, text),) = solid_facts(load_rig(rig_file))
    assert name == "wall"
    assert text == "12 triangles, 0.06 x 0.04 x 0.02 m, 48 cm^3; 1 doubled left out"


def test_the_certificate_has_the_stiffness_of_the_wall(rig_file: Path) -> None:
    from tautwave.certificate import certify

    passes = certify(load_rig(rig_file))
    (found,) = (one for one in passes.elements if one.name == "contacts")
    assert "touch closed (800 N/m" in found.sentences[0]
    assert found.passive.passed
    stiff = certify(load_rig(rig_file, ["scene.links.touch.stiffness=1.2e3"]))
    (found,) = (one for one in stiff.elements if one.name == "contacts")
    assert not found.passive.passed


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("scene.solids.wall.scale=1", "it is 60 m long, .* such as 0.001"),
        ("scene.solids.wall.scale=1e-6", "6e-05 m long, .* such as 1 "),
        ("scene.solids.wall.mesh=gone.stl", "gone.stl"),
        ("scene.links.touch.gap=0.01", "remove gap"),
        ("scene.links.touch.normal=[1, 0, 0]", "remove normal"),
        ("scene.links.touch.between=[wall, tip]", "name what touches first"),
        ("scene.links.touch={type: spring, between: [tip, wall], stiffness: 9}", "only a contact"),
        ("scene.links.touch.between=[ground, wall]", "neither end can move"),
        ("scene.solids.other={mesh: wall.stl, scale: 0.001}", "no link ends at it"),
    ],
)
def test_what_a_solid_cannot_be_is_said(rig_file: Path, change: str, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        load_rig(rig_file, [change])
