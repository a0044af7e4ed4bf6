"""Constants as plain Python reads them fastest: records with slots.

A field of a NamedTuple costs plain Python four times as much as a slot, and a step reads a hundred.
NamedTuples are what compiled code takes, and what everything that builds constants works on.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any, TypeVar, cast

from tautwave.controller.pair import make_pair
from tautwave.controller.records import RunView

T = TypeVar("T")


def slotted(value: T) -> T:
    """Return the same constants with slots, of NamedTuples within them too.

    They are read by name. A kind with properties or methods of its own stays as it is.
    """
    slotted_class: Any = type(value)
    kind = _kind_of(slotted_class)
    if kind is None:
        return value
    made = kind()
    for name in kind.__slots__:
        setattr(made, name, slotted(getattr(value, name)))
    return cast(T, made)


def all_slotted(values: Sequence[T]) -> list[T]:
    """Return a list of constants with slots."""
    return [slotted(value) for value in values]


def with_views(x: RunView) -> RunView:
    """Return a run's axes and pairs with the views of all pairs made."""
    return x._replace(views=[slotted(make_pair(x, k)) for k in range(len(x.pairs))])


@functools.cache
def _kind_of(kind: Any) -> Any:
    """Return the class with slots for a class of NamedTuples, None for any other."""
    fields = getattr(kind, "_fields", None)
    if fields is None or any(
        not name.startswith("_") and name not in fields for name in vars(kind)
    ):
        return None
    return type(kind.__name__, (), {"__slots__": fields})
