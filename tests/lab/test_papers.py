"""What `python -m tests.lab papers` shows: each number beside its reference, figures drawn."""

from __future__ import annotations

import numpy as np
import pytest

from tests.lab.papers import CHAPTERS, chapter, granular

QUICK = [name for name in CHAPTERS if name != "coupling"]


@pytest.mark.sparse(3)
@pytest.mark.parametrize("name", CHAPTERS)
def test_every_number_agrees_with_its_reference(name: str) -> None:
    rows = chapter(name).rows()
    assert [row.what for row in rows if not row.agrees] == []
    assert len({row.what for row in rows}) == len(rows) >= 3
    assert all(row.source for row in rows)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in QUICK if name not in ("granular", "hand")])
def test_every_axis_of_a_figure_is_named(name: str) -> None:
    for make in chapter(name).figures.values():
        for axes in make().axes:
            assert axes.get_ylabel()
            assert axes.lines or axes.collections


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("name", ["granular", "hand", "coupling"])
def test_every_axis_of_a_slow_figure_is_named(name: str) -> None:
    for make in chapter(name).figures.values():
        assert all(axes.get_ylabel() for axes in make().axes)


def test_grains_stay_between_floor_and_bar() -> None:
    _, bar, grains, force = granular.play(0.02)
    assert grains.min() > granular.FLOOR - 1e-3
    assert np.all(grains <= bar[:, None] + 1.5e-3)
    assert force.min() < 0.0 <= force.max() + 1e-12


@pytest.mark.slow
def test_the_greatest_needed_damping_is_marked_on_its_curve() -> None:
    """Where a wall needs most, and how much: the curve is there and has no other value."""
    marked = 0
    for axes in chapter("wall").figures["wall-damping"]().axes:
        curves = [line for line in axes.lines if line.get_marker() != "o"]
        marks = [line for line in axes.lines if line.get_marker() == "o"]
        for curve, mark in zip(curves, marks, strict=True):
            at, height = float(mark.get_xdata()[0]), float(mark.get_ydata()[0])
            x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
            assert height == pytest.approx(float(np.max(y)), rel=1e-3)
            assert height == pytest.approx(float(np.interp(at, x, y)), rel=1e-3)
            marked += 1
    assert marked == 8
