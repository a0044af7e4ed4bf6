"""Points that differ in near keys alone: their rig file is read once, for the first of them."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.offline.sweep_near import Near, near_keys, read_value, with_values
from tautwave.offline.sweep_recipe import Recipe

KEPT = 128
"""Families that are remembered; a sweep comes back to one after its innermost far axis."""

Values = tuple[Any, ...]


class Family:
    """The rig of one point, and what to put in it for the others.

    Parameters
    ----------
    rig : Rig
        As it was read for any of the points.
    nears : sequence of Near
        The keys in which they differ, in the order of their values.
    """

    def __init__(self, rig: Rig, nears: tuple[Near, ...]) -> None:
        self.base = rig
        self.nears = nears
        self._read: list[dict[str, float | int | None]] = [{} for _ in nears]

    def read(self, values: Values) -> tuple[float | int, ...] | None:
        """Return the values as a rig that was read has them; None if one is not right."""
        found = []
        for near, known, value in zip(self.nears, self._read, values, strict=True):
            key = repr(value)
            if key not in known:
                known[key] = read_value(self.base, near, value)
            number = known[key]
            if number is None:
                return None
            found.append(number)
        return tuple(found)

    def rig(self, read: tuple[float | int, ...]) -> Rig:
        """Return the rig with values that were `read`; its seed is the family's."""
        return with_values(self.base, dict(zip(self.nears, read, strict=True)))


class _Shape(NamedTuple):
    """Which axes of a case hold near keys alone, and those keys."""

    is_near: tuple[bool, ...]
    nears: tuple[Near, ...]


class Families:
    """The families of all cases, as far as they are remembered."""

    def __init__(self) -> None:
        self._shapes: dict[int, _Shape] = {}
        self._found: OrderedDict[tuple[int, ...], Family] = OrderedDict()

    def find(
        self, case: int, recipe: Recipe, places: tuple[int, ...], read: Callable[[], Rig]
    ) -> tuple[Family, Values] | None:
        """Return the family of a point and its values there; None if it has no near keys.

        `read` reads the rig of this very point; what it raises is raised.
        """
        shape = self._shapes.get(case)
        if shape is None:
            shape = self._shapes[case] = shape_of(recipe)
        if not shape.nears:
            return None
        values: list[Any] = []
        far = [case]
        for axis, at, is_near in zip(recipe.axes, places, shape.is_near, strict=True):
            if is_near:
                values += [choice.value for choice in axis[at]]
            else:
                far.append(at)
        key = tuple(far)
        family = self._found.get(key)
        if family is None:
            family = self._found[key] = Family(read(), shape.nears)
            if len(self._found) > KEPT:
                self._found.popitem(last=False)
        else:
            self._found.move_to_end(key)
        return family, tuple(values)


def shape_of(recipe: Recipe) -> _Shape:
    """Return which axes of a case hold near keys alone, and those keys."""
    known = near_keys(recipe.varied())
    is_near = tuple(all(choice.key in known for choice in axis[0]) for axis in recipe.axes)
    nears = (
        known[choice.key]
        for axis, near in zip(recipe.axes, is_near, strict=True)
        if near
        for choice in axis[0]
    )
    return _Shape(is_near, tuple(nears))
