"""What surrounds a law, such as an account: its steps call the law's, its records hold more."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import field, make_dataclass
from functools import lru_cache
from types import FunctionType
from typing import Any, NamedTuple, get_type_hints


def bound(step: Callable[..., Any], own: Mapping[str, Any]) -> Callable[..., Any]:
    """Return a step in which some global names mean something else: those of the law inside.

    It is a plain function, so that numba compiles it as it does any other. The same around the same
    law is the same function: a law is wrapped for every rig, and compiled once.
    """
    return _bound(step, tuple(own.items()))


@lru_cache(maxsize=4096)
def _bound(step: Callable[..., Any], own: tuple[tuple[str, Any], ...]) -> Callable[..., Any]:
    assert isinstance(step, FunctionType)
    made = FunctionType(step.__code__, {**step.__globals__, **dict(own)}, step.__name__)
    made.__doc__ = step.__doc__
    made.__module__ = step.__module__
    return made


@lru_cache(maxsize=64)
def record_with(record: Callable[[], Any], name: str, more: type[Any]) -> type[Any]:
    """Return the state of a law's end, or between its ends, with `more` in it under a name."""
    kind: Any = type(record())
    return make_dataclass(
        f"{kind.__name__}With{more.__name__}",
        [(name, more, field(default_factory=more))],
        bases=(kind,),
        slots=True,
    )


@lru_cache(maxsize=64)
def _params_type(kind: Any, name: str, more: Any) -> Any:
    members = [*get_type_hints(kind).items(), (name, more)]
    return NamedTuple(f"{kind.__name__}With{more.__name__}", members)


def params_with(given: Any, name: str, more: Any) -> Any:
    """Return the constants of a law's end with more of them under a name."""
    kind: Any = type(given)
    added: Any = type(more)
    return _params_type(kind, name, added)(*given, more)
