"""The steps of `simulation.live.steps` as machine code that Python calls by address.

A call of numba's own costs by the argument, records most; a C function of addresses costs a
microsecond. This module imports numba, and is imported only where it is used.
"""

from __future__ import annotations

import ctypes
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
from tautwave.controller.steps import ALONE, Law, NoParams, Steps
from tautwave.runtime.scene.hold import Debt, Held
from tautwave.simulation.kernel import compiled
from tautwave.simulation.kernel.records import DeviceParams, DeviceState, record_type
from tautwave.simulation.live.scene import ScenePort, SceneState, step_scene
from tautwave.simulation.live.steps import end_control, step_control, step_devices

numba: Any = importlib.import_module("numba")
types: Any = numba.types
carray: Any = numba.carray


STEPS: Any = None


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
        r,
        o,
        p,
        s,
        m,
        q,
        c,
        carray(table, 1),
        given,
        commands,
        carray(row, 1),
        slot,
        skipped,
        fault,
        STEPS,
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


def _step_scene(
    runs: Any, outcomes: Any, params: Any, axes: Any, samples: Any, scenes: Any, ends: Any,
    helds: Any, debts: Any, table: Any, pipe: Any, floats: Any, wholes: Any, places: Any,
    ports: Any, forces: Any, efforts: Any, start: Any, inputs: Any, outputs: Any, row: Any,
    count: int, size: int, whole: int, fields: int, slot: int, skipped: int,
) -> None:  # fmt: skip
    r: Any = carray(runs, 1)
    n: Any = r[0].axes
    step_scene(
        r,
        carray(outcomes, 1),
        carray(params, n),
        carray(axes, n),
        carray(samples, n),
        carray(scenes, 1),
        carray(ends, count),
        carray(helds, count),
        carray(debts, 1),
        carray(table, 1),
        carray(pipe, 1),
        carray(floats, size),
        carray(wholes, whole),
        carray(places, fields),
        carray(ports, count),
        carray(forces, 1),
        carray(efforts, 1),
        carray(start, 1),
        carray(inputs, 1),
        carray(outputs, 1),
        carray(row, 1),
        slot,
        skipped,
        STEPS,
    )


_FLOATS = (float,) * 4
_SCENE = (SceneState, ScenePort, Held, Debt)
_ENTRIES: dict[str, tuple[Callable[..., None], tuple[type[Any], ...], int]] = {
    "step_control": (
        _step_control,
        (RunParams, RunState, AxisParams, AxisState, Sample, PairParams, PairState, *_FLOATS),
        3,
    ),
    "step_scene": (
        _step_scene,
        (
            *(RunParams, RunState, AxisParams, AxisState, Sample, *_SCENE),
            *(float, float, float, int, int, int, *(float,) * 6),
        ),
        6,
    ),
    "end_control": (_end_control, (RunParams, RunState, AxisState, float), 2),
    "step_devices": (
        _step_devices,
        (DeviceParams, DeviceState, Sample, float, bool, float, float),
        3,
    ),
}
"""Function, what its arrays hold, and how many whole numbers follow them."""


def _type_of(kind: type[Any], parts: dict[type[Any], dict[str, Any]]) -> Any:
    """Return numba's type of what an array holds."""
    numbers = {float: types.float64, int: types.int64, bool: types.boolean}
    if kind in numbers:
        return numbers[kind]
    return numba.from_dtype(record_type(kind, **parts.get(kind, {})))


def entry(
    name: str,
    law: Law = ALONE,
    ends: dict[str, type[Any]] | None = None,
    links: dict[str, type[Any]] | None = None,
) -> Callable[..., None]:
    """Return a step for addresses of arrays and whole numbers; compiled, or from the cache.

    `ends` and `links` are `records.parts_of` the constants of axes and pairs.
    """
    key = name, law.steps
    if key not in _made:
        function, kinds, wholes = _ENTRIES[name]
        parts: dict[type[Any], dict[str, Any]] = {
            AxisParams: ends or {"end": NoParams},
            PairParams: links or {"link": NoParams},
            AxisState: {"end": law.end},
            PairState: {"link": law.link},
        }
        pointers = [types.CPointer(_type_of(kind, parts)) for kind in kinds]
        signature = types.void(*pointers, *[types.int64] * wholes)
        made = compiled.cached_c(function, signature, law)
        given = [ctypes.c_void_p] * len(kinds) + [ctypes.c_int64] * wholes
        _made[key] = ctypes.PYFUNCTYPE(None, *given)(made.address)
        _kept.append(made)
    return _made[key]


_made: dict[tuple[str, Steps], Callable[..., None]] = {}


_kept: list[Any] = []
"""Compiled functions whose addresses are in use."""
