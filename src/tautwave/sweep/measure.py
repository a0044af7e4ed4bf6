"""Measures of one simulation in a sweep: numbers from the columns of its recording, SI."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.felt import FELT, felt_measures
from tautwave.config import Rig
from tautwave.config.keys.simulation import Hold, MinimumJerk
from tautwave.rig import pair_scale
from tautwave.sweep.predict import pair_mode

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Columns = Mapping[str, Floats]

PREDICTED = ("predicted_radius", "predicted_growth", "predicted_frequency")
"""Measures of the rig, not of its simulation."""

BOOKS = ("gross_flow", "residual", "generated")
"""Measures that need every account of a recording."""


RESTING_S = 2.0
"""[s] Of the two windows at the end of a run, in which the hand's reference stands still."""

ALIKE = 1.01
"""Of the energy of the first window, what that of the second still counts as equal to it."""

SETTLED = 1e-9
"""Of the greatest energy of a run, less than which is rest."""

STEADY = 0.9
"""Explained share of the variance above which growth is that of a single mode."""

WINDOWS = 20

FAINTEST = 1e-290
"""[J] Energies below are ignored: they are rounding."""


class Scales(NamedTuple):
    """Scales of a pair's columns: period [s], slave per master units; `ratio` with its sign.

    `rest_s`: when the reference of its hand stands still [s]; inf: never.
    """

    pair: str
    period_s: float
    position_scale: float
    power: float
    ratio: float
    rest_s: float = 0.0


def scales_of(rig: Rig, pair: str) -> Scales:
    """Return the scales of a pair of a rig."""
    keys = rig.coupling.pairs[pair]
    scale = pair_scale(keys)
    ratio = scale.sign * scale.scale
    return Scales(pair, rig.period_s, scale.scale, scale.power, ratio, rest_of(rig, pair))


def rest_of(rig: Rig, pair: str) -> float:
    """Return from when on the reference of a pair's hand stands still [s]; inf: never."""
    hand = None if rig.simulation is None else rig.simulation.hand.get(pair)
    if hand is None:
        return 0.0
    reference = getattr(hand, "reference", None)
    if isinstance(reference, MinimumJerk):
        points = reference.waypoints
        moved = [two[0] for one, two in pairwise(points) if one[1] != two[1]]
        return moved[-1] if moved else 0.0
    return 0.0 if isinstance(reference, Hold) else math.inf


def measure_run(
    scales: Scales, wanted: tuple[str, ...], columns: Columns, *, finished: bool
) -> dict[str, float]:
    """Return the requested measures of one simulation, without predictions.

    Amplitudes and errors are in master units, growth in 1/s, energies in J; `stable` is 1 or 0.
    A measure without a value (growth without motion, stability of a hand that never rests) is NaN.
    """
    names = set(wanted)
    count = len(columns[f"{scales.pair}.position_error"])
    if count == 0:  # the coupling never engaged
        return {name: 0.0 if name == "stable" else math.nan for name in wanted}
    measured: dict[str, float] = {}
    for name, first in (("peak_amplitude", 0), ("late_amplitude", -max(1, count // 10))):
        if name in names:
            measured[name] = amplitude(scales, columns, first)
    if names & {"growth_rate", "stable"}:
        energy = moving_energy(scales, columns)
        growth = growth_of(energy, scales.period_s)
        measured["growth_rate"] = growth.rate
        measured["stable"] = is_stable(energy, scales) if finished else 0.0
    for kind in ("position_error", "effort_error"):
        values = columns[f"{scales.pair}.{kind}"]
        if f"{kind}_rms" in names:
            measured[f"{kind}_rms"] = float(np.sqrt(np.mean(np.square(values))))
        if f"{kind}_max" in names:
            measured[f"{kind}_max"] = farthest(values, 0.0)
    if names & set(FELT):
        measured.update(
            felt_measures(
                scales.pair, columns, scales.period_s, ratio=scales.ratio, power=scales.power
            )
        )
    if names & set(BOOKS):
        measured.update(controller_books(scales.pair, columns))
    return {name: measured[name] for name in wanted if name in measured}


def predict_pair(rig: Rig, pair: str) -> dict[str, float]:
    """Return the measures of `PREDICTED`, in 1/s and Hz, from the rig alone."""
    mode = pair_mode(rig, pair)
    return dict(zip(PREDICTED, (mode.radius, mode.growth, mode.frequency), strict=True))


def moving_energy(scales: Scales, columns: Columns) -> Floats:
    """Return kinetic energy and that of grip and environment springs of a pair [J], shape (n,)."""
    summed = columns.get(f"{scales.pair}.energy")
    if summed is not None:
        return summed
    total = np.zeros(len(columns["time_s"]))
    for side, share in (("master", 1.0), ("slave", 1.0 / scales.power)):
        for part in ("kinetic", "grip_stored", "environment_stored"):
            total += share * columns[f"plant.{side}.{scales.pair}.{part}"]
    return total


def farthest(values: Floats, origin: float) -> float:
    """Return max |values - origin|; rounding keeps the order, so the ends are enough."""
    return float(np.maximum(abs(values.max() - origin), abs(values.min() - origin)))


def amplitude(scales: Scales, columns: Columns, first: int) -> float:
    """Return the largest distance of master or slave from their start [master units].

    From cycle `first` on; an index, so -10 means the last ten.
    """
    distances = []
    for side, unit in (("master", 1.0), ("slave", scales.position_scale)):
        x = columns[f"true.{side}.{scales.pair}.position"]
        distances.append(farthest(x[first:], x[0]) / unit)
    return float(np.maximum(distances[0], distances[1]))


class Growth(NamedTuple):
    """Growth of the amplitude [1/s], and the share a pure exponential explains [1]."""

    rate: float
    steadiness: float


def growth_of(energy: Floats, period: float) -> Growth:
    """Return half the slope of ln(energy) over the last half of a simulation.

    If one mode dominates this is its ln|z| / T. Energies are averaged over `WINDOWS` windows, so
    that oscillation within them does not count as growth; those too small or too large for a float
    are ignored. NaN if nothing is left.
    """
    last = np.ascontiguousarray(energy[len(energy) // 2 :])
    if len(last) >= 2 * WINDOWS and last.min() > FAINTEST and last.max() < math.inf:
        starts, counts, time = _windows(len(last), period)
    else:
        usable = np.flatnonzero((last > FAINTEST) & np.isfinite(last))
        if len(usable) < 2 * WINDOWS:
            return Growth(math.nan, 0.0)
        starts, counts, time = _windows_of(usable, period)
        last = last[usable]
    level = np.add.reduceat(np.log(last), starts) / counts
    level -= level.mean()
    slope = float(time @ level) / float(time @ time)
    spread = float(level @ level)
    explained = slope * float(time @ level) / spread if spread > 0.0 else 0.0
    return Growth(0.5 * slope, explained)


Windows = tuple[Integers, Integers, Floats]


@functools.lru_cache(maxsize=8)
def _windows(count: int, period: float) -> Windows:
    """Return windows long enough that all are usable."""
    return _windows_of(np.arange(count), period)


def _windows_of(usable: Integers, period: float) -> Windows:
    """Return where windows begin, how many energies are in each, and their mean times [s]."""
    ends = np.linspace(0, len(usable), WINDOWS + 1).astype(np.int64)
    counts = np.diff(ends)
    time = period * np.add.reduceat(usable, ends[:-1]) / counts
    time -= time.mean()
    return ends[:-1], counts, time


def is_stable(energy: Floats, scales: Scales) -> float:
    """Return 1 for a pair that comes to rest with its hand, 0 for one that does not; NaN: unknown.

    After the hand's reference stands still, the energy over the last 2 s is no more than over the
    2 s before, or the half of a shorter rest. What is pressed against holds an energy that may
    still rise while everything comes to rest: then its variation is no more. Less than 1e-9 of
    the greatest energy is rest.
    """
    begin = 0.0 if scales.rest_s == 0.0 else scales.rest_s / scales.period_s
    rest = len(energy) - begin
    width = int(min(RESTING_S / scales.period_s, 0.5 * rest)) if rest > 0.0 else 0
    if width < WINDOWS:
        return math.nan
    first, last = energy[-2 * width : -width], energy[-width:]
    if not np.isfinite(energy).all():
        return 0.0
    if last.max() <= SETTLED * energy.max():
        return 1.0
    more = float(last.mean()) > float(first.mean()) and float(np.ptp(last)) > float(np.ptp(first))
    if not more:
        return 1.0
    growth = growth_of(energy[-2 * width :], scales.period_s)
    steadily = growth.rate > 0.0 and growth.steadiness > STEADY
    return float(not (steadily or float(last.mean()) > ALIKE * float(first.mean())))


def controller_books(pair: str, columns: Columns) -> dict[str, float]:
    """Return gross flow, residual and generated energy of a pair's controller [J]."""
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
