"""The points of a sweep, built lazily: a sweep of a million points starts as fast as one of ten.

A point is identified by its index; its rig is read, checked and completed on demand. The rig file
is parsed once, and points that differ in local keys only (`sweep.local_keys`) share one reading.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import pickle
import zlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, overload

import numpy as np
import numpy.typing as npt

from tautwave.config import Rig
from tautwave.config.load import finish_rig
from tautwave.config.text.document import Document, open_document, read_text
from tautwave.config.text.overrides import apply_overrides
from tautwave.sweep.family import Families, Family
from tautwave.sweep.grid import Choice, PointId, Recipe, Texts


class Point(NamedTuple):
    """One simulation: its id and values, and the rig built for it."""

    id: str
    case: str
    values: dict[str, Any]
    rig: Rig
    pair: str
    duration_s: float


class Points(Sequence[Point]):
    """All points of a sweep, in its order; small, and cheap to send to another process.

    Parameters
    ----------
    rig_path : Path
        The rig file.
    recipes : sequence of Recipe
        The cases.
    pair : str, optional
        Measured pair; the first if not given.
    duration_s : float, optional
        Length of each simulation [s]; the rig's own if not given.

    Raises
    ------
    ConfigError
        The rig file does not exist, or is not YAML.
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
        kept = json.dumps([document.value, pair, duration_s], default=str, allow_nan=True)
        self._salts = []
        for recipe in self._recipes:
            fixed = json.dumps([choice.argument for choice in recipe.fixed])
            self._salts.append(hashlib.sha256(f"{recipe.case}\n{fixed}\n{kept}".encode()).digest())
        self._begin()

    def _begin(self) -> None:
        """Start with empty caches."""
        self._documents: dict[int, bytes] = {}
        self._texts: dict[int, Texts] = {}
        self._families = Families()

    def __getstate__(self) -> dict[str, Any]:
        """Return the state to send to another process, without what it can compute itself."""
        return {
            name: value
            for name, value in self.__dict__.items()
            if name not in ("_documents", "_texts", "_families")
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._begin()

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

    def _place(self, number: int) -> tuple[int, int]:
        """Return the index of a point's case, and its index within it."""
        if number < 0:
            number += len(self)
        for case, recipe in enumerate(self._recipes):
            if 0 <= number < recipe.size:
                return case, number
            number -= recipe.size
        raise IndexError(f"there are {len(self)} points")

    def choices(self, number: int) -> tuple[int, list[Choice]]:
        """Return the index of a point's case and its varied settings."""
        case, own = self._place(number)
        return case, self._recipes[case].choices(own)

    def overrides(self, number: int) -> list[Choice]:
        """Return all settings of a point, in order."""
        case, varied = self.choices(number)
        return [*self._recipes[case].fixed, *varied]

    def point_id(self, number: int) -> PointId:
        """Return id, case and values of a point; no rig is read."""
        case, own = self._place(number)
        recipe = self._recipes[case]
        values = {choice.key: choice.value for choice in recipe.choices(own)}
        return PointId(self._texts_of(case).identity_at(recipe.places(own)), recipe.case, values)

    def firsts(self) -> list[int]:
        """Return the first point of each case."""
        return list(itertools.accumulate((it.size for it in self._recipes[:-1]), initial=0))

    def row(self, number: int) -> dict[str, str]:
        """Return the leading cells of a point's row: id, case and values as text."""
        case, own = self._place(number)
        return self._texts_of(case).row(self._recipes[case].places(own))

    def ids(self) -> npt.NDArray[np.uint64]:
        """Return the ids of all points as numbers, in order."""
        return np.fromiter(self._identities(), np.uint64, len(self))

    def _identities(self) -> Iterator[int]:
        for case in range(len(self._recipes)):
            texts = self._texts_of(case)
            for arguments in itertools.product(*texts.arguments):
                yield int.from_bytes(texts.identity(arguments), "big")

    def _texts_of(self, case: int) -> Texts:
        texts = self._texts.get(case)
        if texts is None:
            texts = self._texts[case] = Texts(self._recipes[case], self._salts[case])
        return texts

    def _document_of(self, case: int) -> Document:
        """Return the rig file's document with a case's settings, to be consumed."""
        kept = self._documents.get(case)
        if kept is None:
            document = pickle.loads(self._document)
            apply_overrides(document, [choice.argument for choice in self._recipes[case].fixed])
            kept = self._documents[case] = pickle.dumps(document)
        copy: Document = pickle.loads(kept)
        return copy

    def rig(self, number: int) -> Rig:
        """Return the rig of a point.

        Raises
        ------
        ConfigError
            It is not valid.
        """
        shared_family = self.family(number)
        if shared_family is not None:
            family, values = shared_family
            read = family.read(values)
            if read is not None:
                return self._seeded(family.rig(read), number)
        return self.read_rig(number)

    def read_rig(self, number: int) -> Rig:
        """Return the rig of a point like `rig`, read for this point alone."""
        return self._seeded(self._read(*self.choices(number)), number)

    def _read(self, case: int, varied: Sequence[Choice]) -> Rig:
        arguments = [choice.argument for choice in varied]
        return finish_rig(self._document_of(case), self._path, arguments)

    def _seeded(self, rig: Rig, number: int) -> Rig:
        return rig.model_copy(update={"seed": self.seed_at(number, rig.seed)})

    def seed_at(self, number: int, given: int) -> int:
        """Return the seed of a point of a rig whose file gives a seed.

        Points have independent noise, unless the seed is varied.
        """
        _, varied = self.choices(number)
        values = {choice.key: choice.value for choice in varied}
        seed: int = values.get("seed", given)
        return seed if "seed" in values else given + zlib.crc32(repr(values).encode())

    def family(self, number: int) -> tuple[Family, tuple[Any, ...]] | None:
        """Return the family that this point shares a reading with, and its values in it.

        None if there is none. The first of a family is read here, see `rig`.
        """
        case, own = self._place(number)
        recipe = self._recipes[case]
        return self._families.find(
            case, recipe, recipe.places(own), lambda: self._read(case, recipe.choices(own))
        )

    def pair_of(self, rig: Rig) -> str:
        """Return the measured pair."""
        return self._pair or next(iter(rig.coupling.pairs))

    def duration_of(self, rig: Rig) -> float:
        """Return the length of a simulation [s]."""
        return self._duration_s or rig.duration_s

    def point(self, number: int) -> Point:
        """Return a point with its rig, see `rig`."""
        rig = self.rig(number)
        return Point(*self.point_id(number), rig, self.pair_of(rig), self.duration_of(rig))

    def keys(self) -> tuple[str, ...]:
        """Return every varied key, in the order of the sweep."""
        return tuple(dict.fromkeys(key for recipe in self._recipes for key in recipe.varied()))

    def varied(self) -> Iterator[Choice]:
        """Yield every value of every varied key, case by case."""
        for recipe in self._recipes:
            yield from (choice for axis in recipe.axes for group in axis for choice in group)

    def sample(self, most: int) -> Iterable[int]:
        """Return the points to check beforehand: all, or about `most` of them.

        From every case those that cover every value of every key, then some spread over the rest.
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
