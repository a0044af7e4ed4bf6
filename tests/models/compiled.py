"""The models compiled by numba from the source that runs live."""

from __future__ import annotations

import functools
import importlib
import inspect
from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest

from tautwave.models import (
    crossing,
    encoder,
    foam,
    hand,
    linear,
    plant,
    plant_params,
    reference,
    servo,
    switching,
)

MODULES: tuple[ModuleType, ...] = (
    crossing,
    encoder,
    foam,
    hand,
    linear,
    plant,
    plant_params,
    reference,
    servo,
    switching,
)


def model_functions() -> list[Callable[..., Any]]:
    """Every function the models define, once."""
    return [
        function
        for module in MODULES
        for _, function in inspect.getmembers(module, inspect.isfunction)
        if function.__module__ == module.__name__
    ]


@functools.cache
def _registered() -> Any:
    pytest.importorskip("numba")
    extending = importlib.import_module("numba.extending")
    for function in model_functions():
        extending.register_jitable(function)
    return importlib.import_module("numba")


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return `function` compiled in nopython mode, fastmath off."""
    result: Callable[..., Any] = _registered().njit(function)
    return result
