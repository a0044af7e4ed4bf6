"""Rigs from plain dictionaries, run on the fake clock, and what their books say."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
import yaml

from tautwave.config import Rig, parse_rig
from tautwave.contracts import RowSource
from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState
from tautwave.rig import Assembly, build_rig
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.loop import Loop, LoopResult

Tree = dict[str, Any]

BASE: Tree = {
    "name": "test",
    "rate_hz": 1000.0,
    "duration_s": 1.0,
    "seed": 1,
    "buses": {"hand": {"driver": "loopback"}, "arm": {"driver": "loopback"}},
    "master": {
        "axes": {
            "a": {
                "bus": "hand",
                "id": 1,
                "kind": "linear",
                "inertia": {"value": 0.5, "lower": 0.4, "source": "test"},
                "effort_limit": 1000.0,
                "velocity_limit": 20.0,
            }
        }
    },
    "slave": {
        "axes": {
            "a": {
                "bus": "arm",
                "id": 1,
                "kind": "linear",
                "inertia": {"value": 0.5, "lower": 0.4, "source": "test"},
                "effort_limit": 1000.0,
                "velocity_limit": 20.0,
            }
        }
    },
    "coupling": {
        "engage_ramp_s": 0.0,
        "release_ramp_s": 0.0,
        "pairs": {"a": {"wave_impedance": 10.0, "pole_master": "plain", "pole_slave": "plain"}},
    },
    "simulation": {},
}
"""Two linear masses of half a kilogram on a line without delay; nobody holds or touches them.

Their ports have no observers: closed forms are those of the plain port."""


def tree(*changes: Tree, base: Tree = BASE) -> Tree:
    """Return `base` with dotted keys replaced, e.g. `{"coupling.delay_s": 0.01}`.

    The full names of axes (`simulation.axes`) have a dot of their own: write `master/a` there.
    """
    out = deepcopy(base)
    for change in changes:
        for key, value in change.items():
            at = out
            *path, last = [part.replace("/", ".") for part in key.split(".")]
            for part in path:
                at = at.setdefault(part, {})
            if value is None:
                at.pop(last, None)
            else:
                at[last] = deepcopy(value)
    return out


def unfiltered(data: Tree) -> Tree:
    """Return a rig whose wave lines have no filter, as the closed forms of a line have none."""
    out = deepcopy(data)
    for pair in out["coupling"]["pairs"].values():
        pair["wave_filter_hz"] = None
    return out


class Plain(yaml.SafeDumper):
    """Writes everything out: rig files have no aliases."""

    def ignore_aliases(self, data: object) -> bool:
        return True


def rig_of(data: Tree) -> Rig:
    """Return the checked rig of a dictionary, by way of its YAML text."""
    return parse_rig(yaml.dump(data, Dumper=Plain, sort_keys=False))


class ListSink:
    """Rows appended as lists."""

    def __init__(self, columns: int) -> None:
        self.row = [0.0] * columns
        self.rows: list[list[float]] = []

    def commit(self) -> None:
        self.rows.append(self.row.copy())


class Run(NamedTuple):
    """A finished run: the table by column name, how it went, and what was built."""

    columns: list[str]
    table: np.ndarray[Any, np.dtype[np.float64]]
    result: LoopResult
    assembly: Assembly
    loop: Loop

    def __getitem__(self, column: str) -> np.ndarray[Any, np.dtype[np.float64]]:
        return self.table[:, self.columns.index(column)]


def run_rig(
    data: Tree | Rig,
    *,
    change: Callable[[Assembly], object] | None = None,
    sources: tuple[RowSource, ...] = (),
    raises: bool = True,
    duration_s: float | None = None,
) -> Run:
    """Run a rig on the fake clock; `change` may tamper with what was built."""
    rig = data if isinstance(data, Rig) else rig_of(data)
    built = build_rig(rig, clock="fake", duration_s=duration_s, allow_unwatched=True)
    if change is not None:
        change(built)
    sources = (*built.sources, *sources)
    columns = [*built.columns[:4], *(name for source in sources for name in source.columns)]
    sink = ListSink(len(columns))
    loop = Loop(built.clock, built.buses, built.control, sources, sink)
    result = loop.run()
    if raises and result.error is not None:
        raise result.error
    return Run(columns, np.array(sink.rows), result, built, loop)


class ControlledPair(NamedTuple):
    """A pair of a run's controller, its constants and state, and those of both axes."""

    control: CoupledControl
    params: PairParams
    state: PairState
    axes: dict[str, tuple[AxisParams, AxisState]]


def pair_of(assembly: Assembly, name: str = "a") -> ControlledPair:
    """Return a pair by name."""
    control = assembly.control
    assert isinstance(control, CoupledControl)
    at = control.pair_names.index(name)
    q = control.pairs[at]
    axes = {
        side: (control.params[which], control.axes[which])
        for side, which in (("master", q.master), ("slave", q.slave))
    }
    return ControlledPair(control, q, control.states[at], axes)


class Books(NamedTuple):
    """Controller's books of one pair, all in J: the worst over time."""

    gross_flow: float
    residual: float
    generated: dict[str, float]
    element_residual: float
    plant_flow: float
    plant_residual: float
    sensing_gap: float
    uncertainty: float


def books(run: Run, name: str = "a") -> Books:
    """Close the books of one pair from the recorded columns alone."""
    pair = pair_of(run.assembly, name)
    ports = [f"{side}.{name}.port_energy" for side in ("master", "slave")]
    total = sum(run[port] - run[port][0] for port in ports)
    generated = {}
    worst = 0.0
    for element in pair.control.elements(name):
        absorbed, stored, lost = (
            run[f"{name}.{element}.{part}"] for part in ("absorbed", "stored", "dissipated")
        )
        own = absorbed - (stored - stored[0]) - lost
        worst = max(worst, float(np.abs(own).max()))
        total = total - (stored - stored[0]) - lost
        generated[element] = max(0.0, -float(absorbed.min()))
    flow = sum(float(run[f"{side}.{name}.gross_flow"][-1]) for side in ("master", "slave"))
    plant_flow = plant_residual = gap = 0.0
    for side in ("master", "slave"):
        axis = f"plant.{side}.{name}"
        parts = {
            part: run[f"{axis}.{part}"] - run[f"{axis}.{part}"][0]
            for part in (
                "hand_work", "motor_work", "kinetic", "grip_stored", "environment_stored",
                "grip_loss", "viscous_loss", "coulomb_loss", "environment_loss",
            )
        }  # fmt: skip
        gained = parts["hand_work"] + parts["motor_work"]
        spent = sum(value for part, value in parts.items() if not part.endswith("work"))
        plant_residual = max(plant_residual, float(np.abs(gained - spent).max()))
        plant_flow += sum(float(np.abs(np.diff(value)).sum()) for value in parts.values())
        weight = 1.0 if side == "master" else pair.params.weight
        sent = run[f"{side}.{name}.port_energy"]
        gap += float(sent[-1] + weight * parts["motor_work"][-1])
    uncertainty = sum(float(run[f"{side}.{name}.uncertainty"][-1]) for side in ("master", "slave"))
    return Books(
        flow, float(np.abs(total).max()), generated, worst, plant_flow, plant_residual, gap,
        uncertainty,
    )  # fmt: skip
