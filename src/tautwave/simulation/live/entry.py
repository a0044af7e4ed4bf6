"""The steps of `simulation.live.steps` as machine code that Python calls by address.

A call of numba's own costs by the argument, records most; a C function of addresses costs a
microsecond. This module imports numba, and is imported only where it is used.
"""

from __future__ import annotations

import ctypes
import functools
import importlib
from collections.abc import Callable
from typing import Any

from tautwave.controller.records import (
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    RunParams,
    RunState,
    Sample,
)
from tautwave.simulation.kernel import compiled
from tautwave.simulation.kernel.records import DeviceParams, DeviceState, record_type
from tautwave.simulation.live.steps import end_control, step_control, step_devices

numba: Any = importlib.import_module("numba")
types: Any = numba.types
carray: Any = numba.carray


def _step_control(
    runs: Any, outcomes: Any, params: Any, axes: Any, samples: Any, pairs: Any, states: Any,
    table: Any, inputs: Any, outputs: Any, row: Any, slot: int, skipped: int, fault: int,
) -> None:  # fmt: skip
    r: Any = carray(runs, 1)
    n: Any = r[0].axes
    k: Any = r[0].pairs
    o: Any = carray(outcomes, 1)
    p: Any = carray(params, n)
    s: Any = carray(axes, n)
    m: Any = carray(samples, n)
    q: Any = carray(pairs, k)
    c: Any = carray(states, k)
    given: Any = carray(inputs, 1)
    commands: Any = carray(outputs, 1)
    step_control(
        r, o, p, s, m, q, c, carray(table, 1), given, commands, carray(row, 1), slot, skipped, fault
    )


def _end_control(
    runs: Any, outcomes: Any, axes: Any, outputs: Any, slot: int, skipped: int
) -> None:
    r: Any = carray(runs, 1)
    o: Any = carray(outcomes, 1)
    s: Any = carray(axes, r[0].axes)
    end_control(r, o, s, carray(outputs, 1), slot, skipped)


def _step_devices(
    devices: Any, bodies: Any, samples: Any, table: Any, flags: Any, values: Any, row: Any,
    count: int, slot: int, command: int,
) -> None:  # fmt: skip
    d: Any = carray(devices, count)
    b: Any = carray(bodies, count)
    m: Any = carray(samples, count)
    lost: Any = carray(flags, 1)
    given: Any = carray(values, 1)
    step_devices(d, b, m, carray(table, 1), lost, given, carray(row, 1), count, slot, command != 0)


_FLOATS = (float,) * 4
_ENTRIES: dict[str, tuple[Callable[..., None], tuple[type[Any], ...], int]] = {
    "step_control": (
        _step_control,
        (RunParams, RunState, AxisParams, AxisState, Sample, PairParams, PairState, *_FLOATS),
        3,
    ),
    "end_control": (_end_control, (RunParams, RunState, AxisState, float), 2),
    "step_devices": (
        _step_devices,
        (DeviceParams, DeviceState, Sample, float, bool, float, float),
        3,
    ),
}
"""Function, what its arrays hold, and how many whole numbers follow them."""


def _type_of(kind: type[Any]) -> Any:
    """Return numba's type of what an array holds."""
    numbers = {float: types.float64, bool: types.boolean}
    return numbers[kind] if kind in numbers else numba.from_dtype(record_type(kind))


@functools.cache
def entry(name: str) -> Callable[..., None]:
    """Return a step for addresses of arrays and whole numbers; compiled, or from the cache."""
    function, kinds, wholes = _ENTRIES[name]
    pointers = [types.CPointer(_type_of(kind)) for kind in kinds]
    made = compiled.cached_c(function, types.void(*pointers, *[types.int64] * wholes))
    given = [ctypes.c_void_p] * len(kinds) + [ctypes.c_int64] * wholes
    call: Callable[..., None] = ctypes.PYFUNCTYPE(None, *given)(made.address)
    _kept.append(made)
    return call


_kept: list[Any] = []
"""Compiled functions whose addresses are in use."""
