"""The points of a sweep, made one by one where they are wanted: a million cost what ten do.

A point is named by a number; its rig is read, checked and completed when it is asked for. The rig
file is parsed once, and every point gets a copy of what came out.
"""

from __future__ import annotations

import hashlib
import json
import math
import pickle
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.config.document import Document, open_document, read_text
from tautwave.config.load import finish_rig
from tautwave.config.overrides import apply_overrides
from tautwave.config.yaml12 import KeyPath


class Choice(NamedTuple):
    """One override and where it was written."""

    key: str
    value: Any
    path: KeyPath

    @property
    def argument(self) -> str:
        """Return it as `--set` takes it."""
        return f"{self.key}={json.dumps(self.value, allow_nan=False)}"


class Recipe(NamedTuple):
    """One case: what it sets, and along which axes it varies; an axis is a list of groups."""

    case: str
    fixed: tuple[Choice, ...]
    axes: tuple[tuple[tuple[Choice, ...], ...], ...]

    @property
    def size(self) -> int:
        """Return how many points it has."""
        return math.prod(len(axis) for axis in self.axes)

    def choices(self, number: int) -> list[Choice]:
        """Return what is varied at a point of this case; the last axis changes fastest."""
        groups = []
        for axis in reversed(self.axes):
            number, at = divmod(number, len(axis))
            groups.append(axis[at])
        return [choice for group in reversed(groups) for choice in group]

    def corners(self) -> Iterator[int]:
        """Give points that hold every value of every key: beside the first and the last of all."""
        yield 0
        stride = 1
        for axis in reversed(self.axes):
            for at in range(1, len(axis)):
                yield at * stride
                yield self.size - 1 - at * stride
            stride *= len(axis)
        yield self.size - 1


class Mark(NamedTuple):
    """A point without its rig: its id follows from what was varied, and from what was not."""

    id: str
    case: str
    values: dict[str, Any]


class Point(NamedTuple):
    """One simulation: its mark, and the rig that was made for it."""

    id: str
    case: str
    values: dict[str, Any]
    rig: Rig
    pair: str
    duration_s: float


class Points(Sequence[Point]):
    """All points of a sweep, in its order; small, and as easily sent to another process.

    Parameters
    ----------
    rig_path : Path
        The rig file.
    recipes : sequence of Recipe
        The cases.
    pair : str, optional
        Pair that is measured; the first if not given.
    duration_s : float, optional
        Length of each simulation [s]; the rig's own if not given.

    Raises
    ------
    ConfigError
        There is no such rig file, or it is not YAML.
    """

    def __init__(
        self,
        rig_path: Path,
        recipes: Sequence[Recipe],
        pair: str | None = None,
        duration_s: float | None = None,
    ) -> None:
        self._path = rig_path
        self._pair = pair
        self._duration_s = duration_s
        self._recipes = tuple(recipes)
        document = open_document(read_text(rig_path), str(rig_path), rig_path.parent)
        self._document = pickle.dumps(document)
        self._documents: dict[int, bytes] = {}
        kept = json.dumps([document.value, pair, duration_s], default=str, allow_nan=True)
        self._salts = []
        for recipe in self._recipes:
            fixed = json.dumps([choice.argument for choice in recipe.fixed])
            self._salts.append(hashlib.sha256(f"{recipe.case}\n{fixed}\n{kept}".encode()).digest())

    def __len__(self) -> int:
        return sum(recipe.size for recipe in self._recipes)

    @overload
    def __getitem__(self, at: int) -> Point: ...
    @overload
    def __getitem__(self, at: slice) -> Sequence[Point]: ...
    def __getitem__(self, at: int | slice) -> Point | Sequence[Point]:
        if isinstance(at, slice):
            return [self[number] for number in range(*at.indices(len(self)))]
        return self.point(at)

    def choices(self, number: int) -> tuple[int, list[Choice]]:
        """Return the number of a point's case and what is varied at it."""
        if number < 0:
            number += len(self)
        for at, recipe in enumerate(self._recipes):
            if number < recipe.size:
                return at, recipe.choices(number)
            number -= recipe.size
        raise IndexError(f"there are {len(self)} points")

    def overrides(self, number: int) -> list[Choice]:
        """Return everything that is set at a point, in order."""
        case, varied = self.choices(number)
        return [*self._recipes[case].fixed, *varied]

    def mark(self, number: int) -> Mark:
        """Return id, case and values of a point; no rig is read."""
        return self._mark(*self.choices(number))

    def _mark(self, case: int, varied: Sequence[Choice]) -> Mark:
        text = json.dumps([choice.argument for choice in varied])
        digest = hashlib.sha256(self._salts[case] + text.encode())
        values = {choice.key: choice.value for choice in varied}
        return Mark(digest.hexdigest()[:16], self._recipes[case].case, values)

    def ids(self) -> npt.NDArray[np.uint64]:
        """Return the ids of all points as numbers, in order."""
        numbers = (int(self.mark(at).id, 16) for at in range(len(self)))
        return np.fromiter(numbers, np.uint64, len(self))

    def _document_of(self, case: int) -> Document:
        """Return the rig file's document with what a case sets, to be used up."""
        kept = self._documents.get(case)
        if kept is None:
            document = pickle.loads(self._document)
            apply_overrides(document, [choice.argument for choice in self._recipes[case].fixed])
            kept = self._documents[case] = pickle.dumps(document)
        found: Document = pickle.loads(kept)
        return found

    def rig(self, number: int) -> Rig:
        """Return the rig of a point.

        Raises
        ------
        ConfigError
            It is not right.
        """
        case, varied = self.choices(number)
        arguments = [choice.argument for choice in varied]
        rig = finish_rig(self._document_of(case), self._path, arguments)
        values = {choice.key: choice.value for choice in varied}
        if "seed" in values:
            return rig
        # Noise of one point says nothing about that of its neighbour.
        return rig.model_copy(update={"seed": rig.seed + zlib.crc32(repr(values).encode())})

    def pair_of(self, rig: Rig) -> str:
        """Return the pair that is measured."""
        return self._pair or next(iter(rig.coupling.pairs))

    def point(self, number: int, mark: Mark | None = None) -> Point:
        """Return a point with its rig, see `rig`; `mark` if it is known already."""
        rig = self.rig(number)
        return Point(
            *(mark or self.mark(number)), rig, self.pair_of(rig), self._duration_s or rig.duration_s
        )

    def keys(self) -> tuple[str, ...]:
        """Return every key that is varied, in the order of the sweep."""
        found: dict[str, None] = {}
        for recipe in self._recipes:
            found.update(dict.fromkeys(choice.key for axis in recipe.axes for choice in axis[0]))
        return tuple(found)

    def sample(self, most: int) -> Iterable[int]:
        """Return the points to look at beforehand: all, or at most about `most` of them.

        Of every case those that hold every value of every key, then some spread over the rest.
        """
        if len(self) <= most:
            return range(len(self))
        chosen: dict[int, None] = {}
        start = 0
        for recipe in self._recipes:
            for number in recipe.corners():
                chosen[start + number] = None
            start += recipe.size
        listed = list(chosen)
        if len(listed) > most:
            listed = [listed[round(at)] for at in np.linspace(0, len(listed) - 1, most)]
        return listed
