"""The same laws and models, compiled by numba from the source that runs live."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from types import ModuleType
from typing import Any

import tautwave.laws
import tautwave.models
from tautwave.bench.calls import Call
from tautwave.bench.chunks import Work

NO_NUMBA = "numba is not installed: pip install 'tautwave[fast]'"


def has_numba() -> bool:
    """Whether numba can be imported; does not import it."""
    return find_spec("numba") is not None


def kernels(calls: tuple[Call, ...]) -> dict[str, Work]:
    """Return, for each call, the work of doing it in a compiled loop.

    Each turn's first argument along the chain depends on the result of the turn before, so the
    compiler can neither drop nor overlap the calls; the time is that of a step in a simulation.
    """
    numba: Any = importlib.import_module("numba")
    extending: Any = importlib.import_module("numba.extending")
    for function in _functions():
        extending.register_jitable(function)
    return {call.name: _work(numba, call) for call in calls}


def _functions() -> Iterator[Callable[..., Any]]:
    for package in (tautwave.laws, tautwave.models):
        for found in pkgutil.iter_modules(package.__path__):
            module: ModuleType = importlib.import_module(f"{package.__name__}.{found.name}")
            for _, function in inspect.getmembers(module, inspect.isfunction):
                if function.__module__ == module.__name__:
                    yield function


def _work(numba: Any, call: Call) -> Work:
    law = call.function
    result = law(*call.arguments)
    head = call.arguments[: call.chain]
    start = call.arguments[call.chain]
    tail = call.arguments[call.chain + 1 :]
    if isinstance(result, tuple):

        def run(n: int, head: Any, start: float, tail: Any, link: float) -> float:
            last = 0.0
            for _ in range(n):
                last = law(*(*head, start + link * last, *tail))[0]
            return last

    else:

        def run(n: int, head: Any, start: float, tail: Any, link: float) -> float:
            last = 0.0
            for _ in range(n):
                last = float(law(*(*head, start + link * last, *tail)))
            return last

    compiled = numba.njit(run)

    def work(n: int) -> float:
        began = time.thread_time_ns()
        compiled(n, head, start, tail, 1e-300)
        return (time.thread_time_ns() - began) * 1e-9

    return work
