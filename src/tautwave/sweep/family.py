"""Families of sweep points that differ in local keys only: their rig file is read once."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from typing import Any, NamedTuple

from tautwave.config import Rig
from tautwave.config.load import choose_again
from tautwave.sweep.grid import Recipe
from tautwave.sweep.local_keys import LocalKey, local_keys, read_value, with_values

KEPT = 128
"""Size of the cache; a sweep returns to a family after its innermost non-local axis."""

Values = tuple[Any, ...]


class Family:
    """The rig of one point, and the local keys in which the other points differ.

    Parameters
    ----------
    rig : Rig
        The rig as read for any of the points.
    keys : sequence of LocalKey
        The keys in which they differ, in the order of their values.
    """

    def __init__(self, rig: Rig, keys: tuple[LocalKey, ...]) -> None:
        self.base = rig
        self.keys = keys
        self._read: list[dict[str, float | int | None]] = [{} for _ in keys]

    def read(self, values: Values) -> tuple[float | int, ...] | None:
        """Return the values as in a validated rig.

        None if one is invalid, or if the law would choose otherwise with them: such points are
        read alone, and equal the rig file with these values.
        """
        numbers = []
        for local, known, value in zip(self.keys, self._read, values, strict=True):
            key = repr(value)
            if key not in known:
                known[key] = read_value(self.base, local, value)
            number = known[key]
            if number is None:
                return None
            numbers.append(number)
        read = tuple(numbers)
        if self.base.choices and choose_again(self.rig(read)).choices != self.base.choices:
            return None
        return read

    def rig(self, read: tuple[float | int, ...]) -> Rig:
        """Return the rig with values from `read`; its seed is the family's."""
        return with_values(self.base, dict(zip(self.keys, read, strict=True)))


class _Shape(NamedTuple):
    """Which axes of a case vary local keys only, and those keys."""

    is_local: tuple[bool, ...]
    keys: tuple[LocalKey, ...]


class Families:
    """A bounded cache of the families of all cases."""

    def __init__(self) -> None:
        self._shapes: dict[int, _Shape] = {}
        self._found: OrderedDict[tuple[int, ...], Family] = OrderedDict()

    def find(
        self, case: int, recipe: Recipe, places: tuple[int, ...], read: Callable[[], Rig]
    ) -> tuple[Family, Values] | None:
        """Return the family of a point and its values there; None if it has no local keys.

        `read` reads the rig of this point; its errors are passed on.
        """
        shape = self._shapes.get(case)
        if shape is None:
            shape = self._shapes[case] = shape_of(recipe)
        if not shape.keys:
            return None
        values: list[Any] = []
        outer = [case]
        for axis, at, is_local in zip(recipe.axes, places, shape.is_local, strict=True):
            if is_local:
                values += [choice.value for choice in axis[at]]
            else:
                outer.append(at)
        key = tuple(outer)
        family = self._found.get(key)
        if family is None:
            family = self._found[key] = Family(read(), shape.keys)
            if len(self._found) > KEPT:
                self._found.popitem(last=False)
        else:
            self._found.move_to_end(key)
        return family, tuple(values)


def shape_of(recipe: Recipe) -> _Shape:
    """Return which axes of a case vary local keys only, and those keys."""
    known = local_keys(recipe.varied())
    is_local = tuple(all(choice.key in known for choice in axis[0]) for axis in recipe.axes)
    keys = (
        known[choice.key]
        for axis, local in zip(recipe.axes, is_local, strict=True)
        if local
        for choice in axis[0]
    )
    return _Shape(is_local, tuple(keys))
