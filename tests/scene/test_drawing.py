"""The drawing of a scene: names can be read where bars meet."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("PIL")
import itertools

from PIL import Image, ImageDraw

from tautwave_scenes.report.drawing import HEIGHT, OVER, WIDTH, _bar
from tautwave_scenes.report.figure import thin


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
