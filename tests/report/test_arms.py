"""Arms in the report: outlines of walls, where joints are drawn, pictures."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tautwave.config import load_rig
from tautwave.registry import load_driver
from tautwave.report.arms.drawing import arms_still, write_arms_animation
from tautwave.report.arms.solids import wires_of
from tautwave.report.arms.view import ArmsView, ArmView, _places
from tautwave.report.figures.frames import OVER

PLANAR = Path(__file__).parents[2] / "configs" / "arms" / "planar.yaml"


def wall(**keys: Any) -> Any:
    options = load_rig(PLANAR).buses["hand"].options
    keys = {"stiffness": 100.0, "centre": [0.1, 0.2, 0.3], **keys}
    model = load_driver("arm").options
    return model.model_validate(options | {"walls": {"it": keys}}).walls["it"]


@pytest.mark.parametrize(
    ("keys", "lines", "patches"),
    [
        ({"shape": "plane", "normal": [0, 0, 2]}, 0, 1),
        ({"shape": "sphere", "radius": 0.1}, 3, 0),
        ({"shape": "cylinder", "radius": 0.1, "axis": [0, 1, 1], "length": 0.2}, 6, 0),
        ({"shape": "box", "size": [0.1, 0.2, 0.3]}, 0, 6),
        ({"shape": "path", "points": [[0, 0, 0], [1, 0, 0]]}, 1, 0),
        ({"shape": "mesh", "points": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]]},
         0, 1),
    ],
)  # fmt: skip
def test_walls_have_outlines(keys: dict[str, Any], lines: int, patches: int) -> None:
    found = wires_of(wall(**keys), np.eye(3), 1.0, np.zeros(3))
    assert (len(found.lines), len(found.patches)) == (lines, patches)
    if keys["shape"] == "box":
        corners = {tuple(corner) for patch in found.patches for corner in patch.round(9).tolist()}
        assert len(corners) == 8
        assert np.mean(list(corners), axis=0) == pytest.approx((0.1, 0.2, 0.3))


def a_view(height: float) -> ArmsView:
    joints = np.zeros((3, 4, 3))
    joints[:, 2] = (0.2, 0.0, height)
    joints[:, 3] = [(0.2, 0.1 * k, height) for k in range(3)]
    force = {"coupling": np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]])}
    walls = {"it": wires_of(wall(shape="sphere", radius=0.05), np.eye(3), 1.0, np.zeros(3))}
    arms = [
        ArmView("hand", "master", joints, force, walls),
        ArmView("slave", "slave", joints, {}, {}),
    ]
    return ArmsView(np.array([0.0, 0.5, 1.0]), arms, 1)


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_arms_are_drawn_side_by_side_light_and_dark(height: float, tmp_path: Path) -> None:
    view = a_view(height)
    assert view.arms[0].flat == (height == 0.0)
    light, dark = (Image.open(io.BytesIO(arms_still(view, d))) for d in (False, True))
    assert light.size == dark.size == (720 * OVER, 360 * OVER)
    assert light.getpixel((0, 0)) != dark.getpixel((0, 0))
    halves = [np.ptp(np.asarray(light)[:, k : k + 720].reshape(-1, 3), axis=0) for k in (0, 720)]
    assert all(part.min() > 50 for part in halves)  # something is drawn in both
    if height:
        return
    write_arms_animation(view, tmp_path / "arms.gif")
    with Image.open(tmp_path / "arms.gif") as moving:
        assert moving.n_frames == 3  # type: ignore[attr-defined]


def test_more_than_two_arms_stand_in_rows_each_in_its_place() -> None:
    view = a_view(0.3)
    names = ("master.left", "master.right", "slave.left", "slave.right")
    sides = (name.partition(".")[0] for name in names)
    arms = [view.arms[1]._replace(name=n, side=s) for n, s in zip(names, sides, strict=True)]
    four = Image.open(io.BytesIO(arms_still(view._replace(arms=arms), False)))
    size = 360 * OVER
    assert four.size == (2 * size, 2 * size)
    spots = [(x, y, x + size, y + size) for y in (0, size) for x in (0, size)]
    for arm, spot in zip(arms, spots, strict=True):
        alone = Image.open(io.BytesIO(arms_still(view._replace(arms=[arm]), False)))
        above = (0, 0, size, size - 24 * OVER)  # the time stands below
        part = four.crop(spot).crop(above)
        assert np.array_equal(np.asarray(part), np.asarray(alone.crop(above)))


def test_captions_arrows_and_shadows_keep_clear_of_each_other() -> None:
    view = a_view(0.3)
    push = np.zeros((3, 3))
    push[1] = (0.0, 0.0, 9.0)  # up, where the arm is highest
    tall = view.arms[0]._replace(forces={"coupling": push}, walls={})
    drawn = Image.open(io.BytesIO(arms_still(view._replace(arms=[tall]), False)))
    pixels = np.asarray(drawn).astype(int)
    ink = (pixels != pixels[0, 0]).any(axis=2)
    assert not ink[23 * OVER : 29 * OVER].any()  # between the caption and the arrow
    assert ink[29 * OVER : 60 * OVER].any()
    assert not ink[-5 * OVER :, 80 * OVER :].any()  # beside the time: the shadow is whole


def test_a_row_without_a_sample_repeats_the_last() -> None:
    options: Any = load_driver("arm").options.model_validate(load_rig(PLANAR).buses["hand"].options)
    q = np.array([[0.0, 0.0], [np.nan, 0.0], [0.0, np.pi / 2]])
    found = _places(options.believed(), q)
    assert np.array_equal(found[0], found[1])
    assert found[0, -1] == pytest.approx((0.34, 0.0, 0.0))
    assert found[2, -1] == pytest.approx((0.18, 0.16, 0.0))
