"""Axes of a sweep: the corners that are computed first."""

from __future__ import annotations

import pytest

from tautwave.sweep.grid import Choice, Recipe


def recipe(*sizes: int) -> Recipe:
    axes = [
        tuple((Choice(f"k{axis}", value, ()),) for value in range(size))
        for axis, size in enumerate(sizes)
    ]
    return Recipe("", (), tuple(axes))


@pytest.mark.parametrize("sizes", [(1,), (3,), (2, 3), (3, 1, 4)])
def test_corners_hold_the_ends_and_every_value_of_every_key(sizes: tuple[int, ...]) -> None:
    made = recipe(*sizes)
    found = set(made.corners())
    assert {0, made.size - 1} <= found <= set(range(made.size))
    values = {choice for number in found for choice in made.choices(number)}
    assert values == {choice for axis in made.axes for group in axis for choice in group}
    assert len(found) <= 2 * sum(sizes)


def test_the_last_axis_varies_fastest() -> None:
    assert [recipe(2, 3).places(number) for number in range(4)] == [(0, 0), (0, 1), (0, 2), (1, 0)]
