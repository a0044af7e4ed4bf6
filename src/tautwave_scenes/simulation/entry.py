"""The step of a scene and its axes as machine code that Python calls by address.

This module imports numba, and is imported only where it is used.
"""

from __future__ import annotations

import importlib
from typing import Any

from tautwave.controller.records import AxisParams, AxisState, RunParams, RunState, Sample
from tautwave.simulation.live.entry import Entry
from tautwave_scenes.runtime.hold import Debt, Held
from tautwave_scenes.simulation.cycle import ScenePort, SceneState, step_scene
from tautwave_scenes.simulation.sources import SOURCES

carray: Any = importlib.import_module("numba").carray

STEPS: Any = None


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


STEP_SCENE = Entry(
    _step_scene,
    (
        *(RunParams, RunState, AxisParams, AxisState, Sample),
        *(SceneState, ScenePort, Held, Debt),
        *(float, float, float, int, int, int, *(float,) * 6),
    ),
    6,
    SOURCES,
)
