"""The drawing of a scene: names can be read where bars meet."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("PIL")
import itertools

from PIL import Image, ImageDraw

from tautwave.report.scene.drawing import HEIGHT, OVER, WIDTH, _bar


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
