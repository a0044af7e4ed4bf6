"""Overrides of a sweep, and the axes along which they vary."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from tautwave.config.text.yaml12 import KeyPath


class Choice(NamedTuple):
    """One override and where it was written."""

    key: str
    value: Any
    path: KeyPath

    @property
    def argument(self) -> str:
        """Return it as `--set` takes it."""
        return f"{self.key}={json.dumps(self.value, allow_nan=False)}"

    @property
    def cell(self) -> str:
        """Return its value as shown in a table."""
        return self.value if isinstance(self.value, str) else json.dumps(self.value)


class PointId(NamedTuple):
    """A point without its rig: id (a hash of fixed and varied settings), case and values."""

    id: str
    case: str
    values: dict[str, Any]


class Recipe(NamedTuple):
    """One case: its fixed settings and its axes; an axis is a list of groups."""

    case: str
    fixed: tuple[Choice, ...]
    axes: tuple[tuple[tuple[Choice, ...], ...], ...]

    @property
    def size(self) -> int:
        """Return how many points it has."""
        return math.prod(len(axis) for axis in self.axes)

    def places(self, number: int) -> tuple[int, ...]:
        """Return the index of a point along each axis; the last varies fastest."""
        indices = []
        for axis in reversed(self.axes):
            number, at = divmod(number, len(axis))
            indices.append(at)
        return tuple(reversed(indices))

    def choices(self, number: int) -> list[Choice]:
        """Return the varied settings of a point of this case."""
        places = self.places(number)
        groups = (axis[at] for axis, at in zip(self.axes, places, strict=True))
        return [choice for group in groups for choice in group]

    def varied(self) -> Iterator[str]:
        """Yield every varied key."""
        for axis in self.axes:
            for choice in axis[0]:
                yield choice.key

    def corners(self) -> Iterator[int]:
        """Yield points that cover every value of every key, in addition to the first and last."""
        yield 0
        stride = 1
        for axis in reversed(self.axes):
            for at in range(1, len(axis)):
                yield at * stride
                yield self.size - 1 - at * stride
            stride *= len(axis)
        yield self.size - 1


class Texts:
    """Text of a case's points, precomputed for each group of each axis.

    Parameters
    ----------
    recipe : Recipe
        The case.
    salt : bytes
        Input to its ids besides the varied settings.
    """

    def __init__(self, recipe: Recipe, salt: bytes) -> None:
        self._case = recipe.case
        self._digest = hashlib.sha256(salt)
        self.arguments = [
            [", ".join(json.dumps(choice.argument) for choice in group) for group in axis]
            for axis in recipe.axes
        ]
        self._cells = [
            [{choice.key: choice.cell for choice in group} for group in axis]
            for axis in recipe.axes
        ]

    def identity(self, texts: Sequence[str]) -> bytes:
        """Return the id of the point with these of `arguments`, 8 bytes."""
        digest = self._digest.copy()
        digest.update(f"[{', '.join(texts)}]".encode())
        return digest.digest()[:8]

    def identity_at(self, places: Sequence[int]) -> str:
        """Return the id of the point at these places."""
        texts = [axis[at] for axis, at in zip(self.arguments, places, strict=True)]
        return self.identity(texts).hex()

    def row(self, places: Sequence[int]) -> dict[str, str]:
        """Return id, case and values of the point at these places, as shown in a table."""
        row = {"id": self.identity_at(places), "case": self._case}
        for axis, at in zip(self._cells, places, strict=True):
            row.update(axis[at])
        return row
