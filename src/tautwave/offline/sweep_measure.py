"""What a sweep keeps of one simulation: numbers from the columns of its recording, SI."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.offline.sweep_points import Point
from tautwave.offline.sweep_predict import pair_mode
from tautwave.offline.sweep_rows import BOOKS
from tautwave.rig import pair_scale

Floats = npt.NDArray[np.float64]
Columns = Mapping[str, Floats]

BOUNDED = 1.1
"""Greatest energy of the last half per that of the first half that still counts as stable."""

STEADY = 0.9
"""Share of its course that an exponential explains, above which growth is that of one mode."""

WINDOWS = 20


def measure_point(
    point: Point, wanted: tuple[str, ...], columns: Columns, finished: bool
) -> dict[str, float]:
    """Return the wanted measures of one simulation.

    Amplitudes and errors are in master units, growth in 1/s, energies in J; `stable` is 1 or 0.
    What has no value (the growth of what never moved) is NaN.
    """
    found: dict[str, float] = {}
    if any(name.startswith("predicted_") for name in wanted):
        mode = pair_mode(point.rig, point.pair)
        found["predicted_radius"] = mode.radius
        found["predicted_growth"] = mode.growth
        found["predicted_frequency"] = mode.frequency
    names = set(wanted)
    if names & {"peak_amplitude", "late_amplitude"}:
        swing = amplitude(point, columns)
        found["peak_amplitude"] = float(swing.max())
        found["late_amplitude"] = float(swing[-max(1, len(swing) // 10) :].max())
    if names & {"growth_rate", "stable"}:
        energy = moving_energy(point, columns)
        growth = growth_of(energy, point.rig.period_s)
        found["growth_rate"] = growth.rate
        found["stable"] = float(finished and is_bounded(energy, growth))
    for kind in ("position_error", "effort_error"):
        if names & {f"{kind}_rms", f"{kind}_max"}:
            values = columns[f"{point.pair}.{kind}"]
            found[f"{kind}_rms"] = float(np.sqrt(np.mean(np.square(values))))
            found[f"{kind}_max"] = float(np.abs(values).max())
    if names & set(BOOKS):
        found.update(controller_books(point, columns))
    return {name: found[name] for name in wanted}


def moving_energy(point: Point, columns: Columns) -> Floats:
    """Return kinetic energy and that of grip and environment springs of a pair [J], shape (n,)."""
    summed = columns.get(f"{point.pair}.energy")
    if summed is not None:
        return summed
    total = np.zeros(len(columns["time_s"]))
    weight = 1.0 / pair_scale(point.rig.coupling.pairs[point.pair]).power
    for side, share in (("master", 1.0), ("slave", weight)):
        for part in ("kinetic", "grip_stored", "environment_stored"):
            total += share * columns[f"plant.{side}.{point.pair}.{part}"]
    return total


def amplitude(point: Point, columns: Columns) -> Floats:
    """Return the larger distance of master and slave from their start [master units]."""
    scale = point.rig.coupling.pairs[point.pair].position_scale
    swings = []
    for side, unit in (("master", 1.0), ("slave", scale)):
        x = columns[f"true.{side}.{point.pair}.position"]
        swings.append(np.abs(x - x[0]) / unit)
    return np.asarray(np.maximum(*swings), dtype=np.float64)


class Growth(NamedTuple):
    """Growth of the amplitude [1/s], and how much of its course a pure exponential explains [1]."""

    rate: float
    steadiness: float


def growth_of(energy: Floats, period: float) -> Growth:
    """Return half the slope of ln(energy) over the last half of a simulation.

    Where one mode has outgrown the rest this is its ln|z| / T. Energies are averaged over
    `WINDOWS` windows, so that what swings within them does not count as growth; those too small
    or too large for a float are left out. NaN where nothing is left.
    """
    last = energy[len(energy) // 2 :]
    usable = np.flatnonzero((last > 1e-290) & np.isfinite(last))
    if len(usable) < 2 * WINDOWS:
        return Growth(math.nan, 0.0)
    starts = np.linspace(0, len(usable), WINDOWS + 1).astype(np.int64)
    counts = np.diff(starts)
    time = period * np.add.reduceat(usable, starts[:-1]) / counts
    level = np.add.reduceat(np.log(last[usable]), starts[:-1]) / counts
    time -= time.mean()
    level -= level.mean()
    slope = float(time @ level) / float(time @ time)
    spread = float(level @ level)
    explained = slope * float(time @ level) / spread if spread > 0.0 else 0.0
    return Growth(0.5 * slope, explained)


def is_bounded(energy: Floats, growth: Growth) -> bool:
    """Return whether an energy [J] stays bounded, as far as a finite run can tell.

    It does not if the last half goes beyond the first, or if it grows steadily, however slowly.
    """
    half = len(energy) // 2
    within = half > 0 and bool(energy[half:].max() <= BOUNDED * energy[:half].max())
    return within and not (growth.rate > 0.0 and growth.steadiness > STEADY)


def controller_books(point: Point, columns: Columns) -> dict[str, float]:
    """Return gross flow, residual and generated energy of a pair's controller [J]."""
    pair = point.pair
    start = f"{pair}."
    elements = [
        name.split(".")[1]
        for name in columns
        if name.startswith(start) and name.endswith(".absorbed")
    ]
    balance = np.zeros(len(columns["time_s"]))
    gross = generated = 0.0
    for side in ("master", "slave"):
        entered = columns[f"{side}.{pair}.port_energy"]
        balance += entered - entered[0]
        gross += float(columns[f"{side}.{pair}.gross_flow"][-1])
    for element in elements:
        for part in ("stored", "dissipated"):
            values = columns[f"{pair}.{element}.{part}"]
            balance -= values - values[0]
        generated += max(0.0, -float(columns[f"{pair}.{element}.absorbed"].min()))
    return {
        "gross_flow": gross,
        "residual": float(np.abs(balance).max()),
        "generated": generated,
    }
