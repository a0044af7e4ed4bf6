"""The picture of a scene of points: all of it is there, at the same scale up and across."""

from __future__ import annotations

import io

import numpy as np
import pytest

pytest.importorskip("PIL")
from PIL import Image

from tautwave.canvas import GRID, PAPER, panels
from tautwave.config import parse_rig
from tautwave_scenes.networks.network import Link
from tautwave_scenes.networks3d.network import Mass3d, Network3d, Port3d
from tautwave_scenes.report.drawing import HEIGHT, OVER, WIDTH
from tautwave_scenes.report3d.drawing import TALLEST, draw_frame3d, still3d
from tautwave_scenes.report3d.figure import draw_across, draw_heights
from tautwave_scenes.report3d.view import View3d
from tests.config.bench import BENCH

ROWS = 20


def chain(tall: float, wide: float) -> View3d:
    """A chain of five balls and a plane below, `tall` and `wide` [m]."""
    places = [(0.25 * wide * i, 0.0, 0.25 * tall * i) for i in range(5)]
    masses = tuple(Mass3d(f"m{i}", 0.01, place) for i, place in enumerate(places))
    links = [Link(f"s{i}", "spring", f"m{i}", f"m{i + 1}", 100.0) for i in range(4)]
    floor = Link("floor", "contact", "m0", "ground", 1e4, normal=(0.0, 0.0, 1.0))
    at = {mass.name: np.tile(np.array(mass.position), (ROWS, 1)) for mass in masses}
    at["ground"] = np.zeros((ROWS, 3))
    time = 1e-3 * np.arange(ROWS)
    efforts = {"stylus": np.sin(time)}
    return View3d(Network3d(masses, (*links, floor)), parse_rig(BENCH), time, at, efforts, {})


def inked(image: Image.Image, colours: tuple[str, ...]) -> tuple[int, int, int, int]:
    """Left, top, right and bottom of what is drawn in other colours."""
    pixels = np.asarray(image)
    plain = [tuple(int(colour[at : at + 2], 16) for at in (1, 3, 5)) for colour in colours]
    drawn = np.all([(pixels != colour).any(axis=2) for colour in plain], axis=0)
    rows, columns = np.flatnonzero(drawn.any(axis=1)), np.flatnonzero(drawn.any(axis=0))
    return int(columns[0]), int(rows[0]), int(columns[-1]), int(rows[-1])


@pytest.mark.parametrize("tall", [0.02, 0.1, 0.4, 5.0])
def test_nothing_is_cut_off(tall: float) -> None:
    image = draw_frame3d(chain(tall, 0.1), ROWS // 2)
    assert image.width == WIDTH * OVER
    assert HEIGHT * OVER <= image.height <= TALLEST * OVER
    left, top, right, _ = inked(image, (PAPER,))
    assert min(left, top, image.width - 1 - right) > 0
    corners = np.asarray(image) == tuple(int(GRID[at : at + 2], 16) for at in (1, 3, 5))
    plane = corners.all(axis=2)
    assert plane.any()
    assert not plane[[0, -1]].any()
    assert not plane[:, [0, -1]].any()


def test_a_tall_scene_has_a_tall_still() -> None:
    flat, tall = (
        Image.open(io.BytesIO(still3d(chain(size, 0.1), dark=False))) for size in (0.02, 0.3)
    )
    assert tall.height > 1.5 * flat.height
    assert tall.height > tall.width == flat.width


def test_each_of_several_things_in_the_hand_has_its_own_look() -> None:
    plain = chain(0.1, 0.1)
    ports = (Port3d("probe", ("along", "up")), Port3d("clip", ("pull",)))
    at = {port.name: np.full((ROWS, 3), 0.01 * k) for k, port in enumerate(ports)}
    view = plain._replace(network=plain.network._replace(masses=(), ports=ports), at=at)
    for draw in (draw_heights, draw_across):
        _, (axes,) = panels([1.0], "")
        draw(axes, view)
        looks = [(line.get_color(), line.get_linestyle()) for line in axes.lines]
        assert len(looks) == len(set(looks)) >= 2
