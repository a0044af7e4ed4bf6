"""The drawing of a scene: names can be read where bars meet."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("PIL")
import itertools
from types import SimpleNamespace
from typing import Any

from PIL import Image, ImageDraw

from tautwave_scenes.networks.network import Mass, Network
from tautwave_scenes.report.drawing import HEIGHT, OVER, WIDTH, _bar, draw_frame
from tautwave_scenes.report.figure import thin
from tautwave_scenes.report.view import SceneView


@pytest.mark.parametrize(("count", "step"), [(3000, 1), (3001, 3), (10_001, 7)])
def test_of_long_series_every_stretch_keeps_its_extremes(count: int, step: int) -> None:
    """The last of the series says where they are; a rest shorter than a stretch is left out."""
    time = np.arange(float(count))
    values = np.sin(0.37 * time) + 0.3 * np.cos(1.9 * time)
    at, drawn = thin(time, values)
    expected = time
    if step > 1:
        expected = np.array([
            begin + place
            for begin in range(0, count - step + 1, step)
            for place in sorted(
                (values[begin : begin + step].argmin(), values[begin : begin + step].argmax())
            )
        ])  # fmt: skip
    assert at.tolist() == expected.tolist()
    assert drawn.tolist() == values[expected.astype(int)].tolist()


def test_names_of_bars_that_meet_lie_apart() -> None:
    drawn = []
    taken = 0.0
    for names, fixed in ((("stick", "bow"), False), (("ground", "floor"), True)):
        taken = 0.0
        for name in names:
            image = Image.new("L", (WIDTH * OVER, HEIGHT * OVER))
            taken += _bar(ImageDraw.Draw(image), name, 300.0, "white", taken, fixed=fixed)
            inked = np.asarray(image)[:290].any(axis=0)  # above the bar
            drawn.append(np.flatnonzero(inked))
    assert all(len(columns) for columns in drawn)
    ends = sorted((int(columns[0]), int(columns[-1])) for columns in drawn)
    assert all(one[1] < two[0] for one, two in itertools.pairwise(ends))
    assert ends[-1][1] < WIDTH * OVER


def view_of(places: dict[str, np.ndarray]) -> SceneView:
    """Return a scene of balls in a row at 100 Hz."""
    masses = tuple(Mass(name, 1.0) for name in places)
    rig: Any = SimpleNamespace(rate_hz=100.0)
    return SceneView(Network(masses, (), ()), rig, 0.01 * np.arange(200), places, {}, {})


def test_a_frame_shows_all_that_moves_within_a_quarter_of_a_second() -> None:
    """Balls stand in columns from left to right; heights are those of the rows around."""
    still = {name: np.zeros(200) for name in "abc"}
    frames = []
    for moved in (0, 70, 80, 130):
        places = {name: values.copy() for name, values in still.items()}
        places["b"][moved] = 1.0
        frames.append(np.asarray(draw_frame(view_of(places), 100)))
    far, out, near, beyond = frames
    assert np.array_equal(far, out)
    assert np.array_equal(far, beyond)
    assert not np.array_equal(far, near)
    inked = np.flatnonzero((far != far[0, 0]).any(axis=(0, 2)))
    balls = inked[1:][np.diff(inked) > 30]
    assert len(balls) == 3
    assert np.ptp(np.diff(balls)) <= 1
