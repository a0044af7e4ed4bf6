"""Precision of a run: against its oracle, and at half and double its rate.

A simulated run is simulated again: with its devices integrated by Dormand-Prince at 1e-12 (the
integrator's error), and at half and double the rate (the effect of sampling). A hardware run's laws
are run again on its recorded positions, at its own rate (they have to give the recorded efforts)
and at half and double rate: how much of the effort is the discretisation's. Units are SI.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from tautwave.config import Bus, Rig, Simulation
from tautwave.errors import TautwaveError
from tautwave.files import json_ready
from tautwave.report.figures.envelope import Floats
from tautwave.report.figures.resampling import distance, resampled
from tautwave.report.hooks import report_hooks
from tautwave.report.run.rundir import Run, served_rows
from tautwave.simulation.kernel.pack import Job, pack_rig
from tautwave.simulation.kernel.schemes import with_positions, with_scheme
from tautwave.simulation.rows import Simulation as Rows
from tautwave.simulation.run import engine_of, simulation_of_run
from tautwave.summary import Summary

ORACLE = 1e-12
DORMAND_PRINCE = 4
FEW_CYCLES = 2000
"""Cycles of one pair that plain Python replays in less than a second, all rates together."""

MAX_CYCLES = 120_000
"""Most cycles replayed when compiled: an hour's report stays as quick as a minute's."""

FACTORS = {"half": 0.5, "double": 2.0}


class Replay(NamedTuple):
    """How to replay a run: over which span [s], by which engine, and whether that is all of it."""

    span_s: float
    engine: str
    whole: bool


def measure_precision(run: Run) -> Summary:
    """Return a run's summary with `precision`.

    If it cannot be computed, `precision.error` says why; that is not an error of the run.
    """
    try:
        precision = precision_of(run, run.checked_rig)
    except (TautwaveError, ArithmeticError, LookupError) as err:
        precision = {"error": str(err) or type(err).__name__}
    return run.result.model_copy(update={"precision": json_ready(precision)})


def precision_of(run: Run, rig: Rig) -> dict[str, Any]:
    """Return the precision of a run, as plain numbers.

    Raises
    ------
    TautwaveError
        The rig cannot be replayed.
    """
    if rig.scene is not None:
        return report_hooks().precision(run, rig)
    if not rig.coupling.pairs or run.rows < 3:
        return {"error": "no coupled pair, or almost no rows, to replay"}
    taken = [bus.way for bus in run.result.buses.values()]
    hardware = rig.simulation is None or "hardware" in taken
    lead = np.inf
    if run.time is not None:
        # Compare only before the release ramp, which starts at a different time in each run.
        lead = float(run.time[-1]) + rig.period_s
    span = min(rig.duration_s, lead)
    replay = replay_of(rig, span)
    precision: dict[str, Any] = {
        "kind": "hardware" if hardware else "simulated",
        "span_s": replay.span_s,
        "whole": replay.whole,
        "engine": replay.engine,
    }
    precision.update(_hardware(run, rig, replay) if hardware else _simulated(run, rig, replay))
    return precision


def replay_of(rig: Rig, span_s: float) -> Replay:
    """Return how much of a run to replay and by which engine, to take a second or two."""
    cycles = round(span_s * rig.rate_hz)
    few = max(200, FEW_CYCLES // max(1, len(rig.coupling.pairs)))
    if cycles <= few:
        return Replay(span_s, "python", True)
    if kernel_is_kept(rig):
        most = min(cycles, MAX_CYCLES)
        return Replay(most * rig.period_s, "compiled", most == cycles)
    return Replay(few * rig.period_s, "python", False)


def kernel_is_kept(rig: Rig) -> bool:
    """Return whether the law's compiled kernel is in the cache; a report never compiles it."""
    if find_spec("numba") is None:
        return False
    from tautwave.simulation.run import is_compiled

    return is_compiled(rig)


def _rows(job: Job, replay: Replay) -> Rows:
    """Run a job over the replayed span; its release ramp is cut off."""
    cycles = max(1, round(replay.span_s * 1e9 / job.run.period_ns))
    longer = min(cycles + job.run.release_cycles + 2, job.run.cycles)
    job = job._replace(run=job.run._replace(cycles=longer))
    kernel, tables_of = engine_of(replay.engine, job.law)
    tables = tables_of(job)
    rows = simulation_of_run(job, tables, kernel(tables))
    return Rows(rows.columns, rows.data[:cycles], rows.error)


def at_rate(rig: Rig, factor: float) -> Rig:
    """Return the same rig at another rate: times in seconds stay, those in cycles change."""
    return rig.model_copy(update={"rate_hz": factor * rig.rate_hz})


def _simulated(run: Run, rig: Rig, replay: Replay) -> dict[str, Any]:
    job = pack_rig(rig, rig.duration_s)
    base = _rows(job, replay)
    result: dict[str, Any] = {"pairs": {}, "replayed_equal": _equal(run, base)}
    oracle = _rows_or_reason(lambda: _rows(with_scheme(job, DORMAND_PRINCE, 1, ORACLE), replay))
    others = {
        name: _rows_or_reason(lambda f=factor: _at(rig, f, replay))  # type: ignore[misc]
        for name, factor in FACTORS.items()
    }
    for pair in rig.coupling.pairs:
        position = f"true.slave.{pair}.position"
        effort = f"master.{pair}.port_effort"
        block: dict[str, Any] = {
            "travel": float(np.ptp(base[position])),
            "effort": float(np.nanmax(np.abs(base[effort]))),
            "oracle": _differences(base, oracle, position, effort),
        }
        for name, rows in others.items():
            block[name] = _differences(base, rows, position, effort)
        result["pairs"][pair] = block
    return result


def _at(rig: Rig, factor: float, replay: Replay) -> Rows:
    return _rows(pack_rig(at_rate(rig, factor), rig.duration_s), replay)


def _rows_or_reason(make: Callable[[], Rows]) -> Rows | str:
    """Return rows, or why there are none."""
    try:
        rows = make()
    except TautwaveError as err:
        return str(err)
    return rows


def _differences(base: Rows, other: Rows | str, position: str, effort: str) -> dict[str, Any]:
    """Return the greatest distance of two runs at their common instants."""
    if isinstance(other, str):
        return {"why_not": other}
    errors: dict[str, Any] = {}
    for key, name in (("position", position), ("effort", effort)):
        gap = distance(base["time_s"], base[name], other["time_s"], other[name])
        errors[key] = float(np.max(np.abs(gap))) if gap.size else None
        errors[f"{key}_rms"] = float(np.sqrt(np.mean(gap * gap))) if gap.size else None
    if other.error is not None and base.error is None:
        errors["ended"] = str(other.error)
    return errors


def _equal(run: Run, rows: Rows) -> bool | None:
    """Return whether the replayed rows are the recorded ones to the bit; None on a real clock."""
    if run.result.clock != "fake":
        return None
    names = [name for name in rows.columns if name in run.columns and name.startswith("true.")]
    for name, recorded in run.each(names):
        n = min(len(recorded), len(rows))
        if not np.array_equal(recorded[:n], rows[name][:n], equal_nan=True):
            return False
    return bool(names)


def twin_of(run: Run, rig: Rig) -> Rig:
    """Return a rig of the same laws whose devices are simulated, with the delays of its buses.

    Raises
    ------
    ConfigError
        Nothing of the kind can be built.
    """
    buses = {}
    for name, bus in rig.buses.items():
        result = run.result.buses.get(name)
        delay = None if result is None else result.command_delay
        waits = 0.0
        if delay is not None:
            waits = delay.periods * rig.period_s * bus.divisor + delay.remainder_s
        options = {"command_delay_s": waits} if waits > 0.0 else {}
        buses[name] = Bus(driver="loopback", divisor=bus.divisor, options=options)
    return rig.model_copy(update={"buses": buses, "simulation": Simulation()})


def _hardware(run: Run, rig: Rig, replay: Replay) -> dict[str, Any]:
    slow = [name for name, axis in rig.axes.items() if axis.causality != "impedance"]
    if slow:
        return {"error": f"{slow[0]} takes velocities: its measured efforts cannot be replayed"}
    names = {axis: f"{axis}.position" for axis in rig.axes}
    recorded = run.read("time_s", *names.values(), *(f"{axis}.valid" for axis in rig.axes))
    if "time_s" not in recorded or any(name not in recorded for name in names.values()):
        return {"error": "positions were not recorded"}
    twin = twin_of(run, rig)
    base = _played(run, twin, replay, recorded)
    others = {
        name: _rows_or_reason(lambda f=factor: _played(run, at_rate(twin, f), replay, recorded))  # type: ignore[misc]
        for name, factor in FACTORS.items()
    }
    result: dict[str, Any] = {"pairs": {}}
    for pair in rig.coupling.pairs:
        block: dict[str, Any] = {}
        for side in ("master", "slave"):
            effort = f"{side}.{pair}.commanded"
            sent = run.read(effort).get(effort)
            part: dict[str, Any] = {"effort": float(np.nanmax(np.abs(base[effort])))}
            if sent is not None:
                gap = distance(recorded["time_s"], sent, base["time_s"], base[effort])
                part["replayed"] = float(np.max(np.abs(gap))) if gap.size else None
            for name, rows in others.items():
                part[name] = _differences(base, rows, f"{side}.{pair}.position", effort)
            block[side] = part
        result["pairs"][pair] = block
    return result


def _played(run: Run, rig: Rig, replay: Replay, recorded: dict[str, Floats]) -> Rows:
    """Return the laws of a rig on recorded positions, resampled to the rig's rate."""
    job = pack_rig(rig, rig.duration_s)
    positions = {}
    for axis in job.axes:
        period = rig.axis_period_s(axis)
        time, position = recorded["time_s"], recorded[f"{axis}.position"]
        good = np.isfinite(position)
        valid = recorded.get(f"{axis}.valid")
        if valid is not None:
            good &= valid > 0.5
        seen = np.zeros(len(time), dtype=bool)
        seen[served_rows(run, axis)] = True
        good &= seen
        slots = np.asarray(np.arange(round(replay.span_s / period) + 2) * period, dtype=np.float64)
        # In a cycle of a slow bus the sample is that of its last slot.
        positions[axis] = resampled(slots, time[good] - float(time[0]), position[good])
    return _rows(with_positions(job, positions), replay)
