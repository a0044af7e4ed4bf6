"""The noise of a run's encoders, as white noise, against what the rig declares.

Third and fifth differences of the positions: white noise shows in the n-th with `binom(2 n, n)`
times its variance, an encoder step q in the third with at most (4 q)**2, 0.8 q**2 of variance, and
of a smooth motion the less the higher n is: at the angular frequency w each is w T of the one
before. So the lesser of both is the estimate: on noise they agree. The median over windows leaves
contacts out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tautwave.report.motors import motion
from tautwave.report.run.rundir import SIDES, Run, block
from tautwave.report.units import number, quantity

Array = NDArray[np.float64]

WINDOW = 200
"""Samples of a window; their deviation is sure to a tenth."""

TOLERATED = 1.15
"""Times the declared deviation: what is above it is reported."""

ORDERS = (3, 5)

STEP_SHARE = 0.8
"""Of a step's square: the greatest variance that rounding shows as in third differences."""

MIN_SHARE = 1e-6
"""Of the velocity limit: a deviation that reads as less in a period is ignored. The leak that it
causes is in proportion to its square, 1e-12 of the power of a device at its limit."""

SLIPPED = 0.1
"""Of an encoder's step or noise: how far a device may go while the host samples it late."""


def noise_sentences(run: Run) -> Iterator[str]:
    """Yield a sentence on every axis with a claim that is noisier than its rig declares."""
    for pair in run.pairs:
        for side in SIDES:
            axis = f"{side}.{pair}"
            claimed = run.result_of(pair).claim_j.get(side)
            if claimed is None or f"{axis}.position" not in run.columns:
                continue
            keys = block(run.rig, side, "axes", pair)
            deviation = measured_deviation(run, axis, keys)
            declared = number(keys.get("position_noise")) or 0.0
            limit = number(keys.get("velocity_limit")) or 1.0
            floor = MIN_SHARE * limit / (number(run.rig.get("rate_hz")) or 1.0)
            if deviation is not None and deviation > max(TOLERATED * declared, floor):
                unit = "rad" if keys.get("kind") == "rotary" else "m"
                times = f", {deviation / declared:.2g} times the declared" if declared > 0.0 else ""
                yield (
                    f"{axis}: its position noise is {quantity(deviation, unit, 3)}{times} "
                    f"(position_noise {declared:g}): its port may decouple, and its claim does "
                    f"not hold; measure it at rest with `tautwave identify RIG --axis {axis} "
                    "--noise`, and paste its lines."
                )


def measured_deviation(run: Run, axis: str, keys: dict[str, Any]) -> float | None:
    """Return the deviation beyond the encoder's step [rad or m], None where it is too short.

    `keys` are the axis', whose declared colour is believed.
    """
    moved, lasted, good = motion(run, axis)
    if not len(lasted):
        return None
    quantum = number(keys.get("encoder_quantum")) or 0.0
    # Across a lost sample or a skipped slot a motion does not cancel, nor does one that was sampled
    # early and late: a late host is no noise of an encoder.
    late = np.nan_to_num(run.read("lateness_us").get("lateness_us", np.zeros(len(good))))[good]
    slip = np.abs(moved / lasted * np.diff(1e-6 * late))
    shown = max(quantum, number(keys.get("position_noise")) or 0.0)
    even = (lasted < 1.5 * lasted.min()) & (slip <= SLIPPED * shown)
    lags = (1.0, *(keys.get("position_noise_autocorrelation") or ()))
    deviations = [_deviation(moved, even, order, quantum, lags) for order in ORDERS]
    known = [one for one in deviations if one is not None]
    return min(known) if known else None


def _deviation(
    moved: Array, even: NDArray[np.bool_], order: int, quantum: float, lags: Sequence[float]
) -> float | None:
    """Return the deviation that the differences of one order show, None of too few of them.

    `moved` are first differences, `even` those over one period each.
    """
    whole = np.convolve(even, np.ones(order), "valid") > order - 0.5
    differences = np.diff(moved, order - 1)[whole]
    windows = len(differences) // WINDOW
    if windows < 2:
        return None
    squares = differences[: windows * WINDOW].reshape(windows, WINDOW) ** 2
    per_variance = sum(
        (1.0 if lag == 0 else 2.0) * (-1.0) ** lag * math.comb(2 * order, order - lag) * value
        for lag, value in enumerate(lags[: order + 1])
    )
    step = STEP_SHARE * math.comb(2 * order, order) * quantum * quantum
    beyond = float(np.median(squares.mean(axis=1))) - step
    if not beyond > 0.0 or per_variance <= 0.0:
        return 0.0
    return math.sqrt(beyond / per_variance)
