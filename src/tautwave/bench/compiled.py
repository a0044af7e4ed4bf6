"""The same laws and models, compiled by numba from the source that runs live."""

from __future__ import annotations

import importlib
import time
from importlib.util import find_spec
from typing import Any

from tautwave.bench.calls import Call
from tautwave.bench.chunks import Work

NO_NUMBA = "numba is not installed: pip install 'tautwave[fast]'"


def has_numba() -> bool:
    """Whether numba can be imported; does not import it."""
    return find_spec("numba") is not None


def kernels(calls: tuple[Call, ...]) -> dict[str, Work]:
    """Return, for each call, the work of doing it in a compiled loop.

    Each turn's argument along the chain depends on the result of the turn before, so the
    compiler can neither drop nor overlap the calls; the time is that of a step in a simulation.
    """
    from tautwave.simulation.kernel.compiled import functions_of, register, source_modules

    numba: Any = importlib.import_module("numba")
    for module in source_modules():  # known to numba, with the simulation's own settings
        register(_work, functions_of(module))
    return {call.name: _work(numba, call) for call in calls}


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

    compiled = numba.njit(error_model="numpy")(run)

    def work(n: int) -> float:
        began = time.thread_time_ns()
        compiled(n, head, start, tail, 1e-300)
        return (time.thread_time_ns() - began) * 1e-9

    return work
