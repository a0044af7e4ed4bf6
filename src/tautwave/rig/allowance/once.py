"""Answers about a rig that are computed once: rigs do not change, but some answers cost a while."""

from __future__ import annotations

import functools
from collections import OrderedDict
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar

from tautwave.config import Rig

P = ParamSpec("P")
T = TypeVar("T")

KEPT = 16
"""Rigs whose answers are kept: a rig, and those that a certificate makes of it."""


def once_per_rig(
    function: Callable[Concatenate[Rig, P], T],
) -> Callable[Concatenate[Rig, P], T]:
    """Return a function of a rig and hashable arguments that answers from memory the second time.

    A rig is known by its identity: it holds mappings, which have no hash, and it is frozen.
    """
    kept: OrderedDict[int, tuple[Rig, dict[Any, T]]] = OrderedDict()

    def answer(rig: Rig, /, *args: P.args, **kwargs: P.kwargs) -> T:
        entry = kept.get(id(rig))
        if entry is None:
            entry = kept[id(rig)] = (rig, {})  # holding the rig keeps its id from another one
            if len(kept) > KEPT:
                kept.popitem(last=False)
        else:
            kept.move_to_end(id(rig))
        key = (args, tuple(sorted(kwargs.items())))
        if key not in entry[1]:
            entry[1][key] = function(rig, *args, **kwargs)
        return entry[1][key]

    functools.update_wrapper(answer, function)
    return answer
