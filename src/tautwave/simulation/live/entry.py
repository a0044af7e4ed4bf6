"""The steps of `simulation.live.steps` as machine code that Python calls by address.

A call of numba's own costs by the argument, records most; a C function of addresses costs a
microsecond. This module imports numba, and is imported only where it is used.
"""

from __future__ import annotations

import ctypes
import importlib
from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from tautwave.controller.records import (
    AxisParams,
    AxisState,
    PairParams,
    PairState,
    RunParams,
    RunState,
    RunView,
    Sample,
)
from tautwave.controller.steps import ALONE, Law, NoParams, Steps
from tautwave.simulation.kernel import compiled
from tautwave.simulation.kernel.records import DeviceParams, DeviceState, record_type
from tautwave.simulation.live.steps import Devices, Ways, end_control, step_control, step_devices

numba: Any = importlib.import_module("numba")
types: Any = numba.types
carray: Any = numba.carray


STEPS: Any = None


def _step_control(
    runs: Any, outcomes: Any, params: Any, axes: Any, samples: Any, pairs: Any, states: Any,
    table: Any, inputs: Any, outputs: Any, row: Any, slot: int, skipped: int, fault: int,
) -> None:  # fmt: skip
    r: Any = carray(runs, 1)[0]
    o: Any = carray(outcomes, 1)[0]
    x = RunView(
        carray(params, r.axes),
        carray(axes, r.axes),
        carray(samples, r.axes),
        carray(pairs, r.pairs),
        carray(states, r.pairs),
        carray(table, 1),
        (),
    )
    ways = Ways(carray(inputs, 1), carray(outputs, 1), carray(row, 1))
    step_control(r, o, x, ways, slot, skipped, fault, STEPS)


def _end_control(
    runs: Any, outcomes: Any, axes: Any, outputs: Any, slot: int, skipped: int
) -> None:
    r: Any = carray(runs, 1)[0]
    o: Any = carray(outcomes, 1)[0]
    end_control(r, o, carray(axes, r.axes), carray(outputs, 1), slot, skipped)


def _step_devices(
    devices: Any, bodies: Any, samples: Any, table: Any, flags: Any, values: Any, row: Any,
    count: int, slot: int, command: int,
) -> None:  # fmt: skip
    w = Devices(
        carray(devices, count),
        carray(bodies, count),
        carray(samples, count),
        carray(table, 1),
        carray(flags, 1),
    )
    step_devices(w, carray(values, 1), carray(row, 1), count, slot, command != 0)


_FLOATS = (float,) * 4


class Entry(NamedTuple):
    """What is compiled: function, what its arrays hold, how many whole numbers follow them.

    `modules` are those that it is made of beside the kernel's.
    """

    function: Callable[..., None]
    arrays: tuple[type[Any], ...]
    wholes: int
    modules: tuple[ModuleType, ...] = ()


STEP_CONTROL = Entry(
    _step_control,
    (RunParams, RunState, AxisParams, AxisState, Sample, PairParams, PairState, *_FLOATS),
    3,
)
END_CONTROL = Entry(_end_control, (RunParams, RunState, AxisState, float), 2)
STEP_DEVICES = Entry(
    _step_devices, (DeviceParams, DeviceState, Sample, float, bool, float, float), 3
)


def _type_of(kind: type[Any], parts: dict[type[Any], dict[str, Any]]) -> Any:
    """Return numba's type of what an array holds."""
    numbers = {float: types.float64, int: types.int64, bool: types.boolean}
    if kind in numbers:
        return numbers[kind]
    return numba.from_dtype(record_type(kind, **parts.get(kind, {})))


def entry(
    what: Entry,
    law: Law = ALONE,
    ends: dict[str, type[Any]] | None = None,
    links: dict[str, type[Any]] | None = None,
) -> Callable[..., None]:
    """Return a step for addresses of arrays and whole numbers; compiled, or from the cache.

    `ends` and `links` are `records.parts_of` the constants of axes and pairs.
    """
    function, kinds, wholes, modules = what
    key = function, law.steps
    if key not in _made:
        parts: dict[type[Any], dict[str, Any]] = {
            AxisParams: ends or {"end": NoParams},
            PairParams: links or {"link": NoParams},
            AxisState: {"end": law.end},
            PairState: {"link": law.link},
        }
        pointers = [types.CPointer(_type_of(kind, parts)) for kind in kinds]
        signature = types.void(*pointers, *[types.int64] * wholes)
        made = compiled.cached_c(function, signature, law, modules)
        given = [ctypes.c_void_p] * len(kinds) + [ctypes.c_int64] * wholes
        _made[key] = ctypes.PYFUNCTYPE(None, *given)(made.address)
        _kept.append(made)
    return _made[key]


_made: dict[tuple[Callable[..., None], Steps], Callable[..., None]] = {}


_kept: list[Any] = []
"""Compiled functions whose addresses are in use."""
