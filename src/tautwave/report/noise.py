"""The noise of a run's encoders, as white noise, against what the rig declares.

Third differences of the positions: a motion hardly shows in them, white noise twenty times its
variance, an encoder step q at most (4 q)**2. The median over windows leaves contacts out.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tautwave.report.motors import motion
from tautwave.report.run.rundir import SIDES, Run, block
from tautwave.report.units import number, quantity

WINDOW = 200
"""Samples of a window; their deviation is sure to a tenth."""

TOLERATED = 1.15
"""Times the declared deviation: what is above it is reported."""

SLIPPED = 0.1
"""Of an encoder's step or noise: how far a device may go while the host samples it late."""

COEFFICIENTS = (20.0, -30.0, 12.0, -2.0)
"""Variance of a third difference per autocovariance of lag 0, 1, 2, 3."""


def noise_sentences(run: Run) -> Iterator[str]:
    """Yield a sentence on every axis with a claim that is noisier than its rig declares."""
    for pair in run.pairs:
        for side in SIDES:
            axis = f"{side}.{pair}"
            claimed = run.result_of(pair).claim_j.get(side)
            if claimed is None or f"{axis}.position" not in run.columns:
                continue
            keys = block(run.rig, side, "axes", pair)
            found = measured_deviation(run, axis, keys)
            declared = number(keys.get("position_noise")) or 0.0
            if found is not None and found > TOLERATED * declared:
                unit = "rad" if keys.get("kind") == "rotary" else "m"
                times = f", {found / declared:.2g} times the declared" if declared > 0.0 else ""
                yield (
                    f"{axis}: its position noise is {quantity(found, unit, 3)}{times} "
                    f"(position_noise {declared:g}): its port may decouple, and its claim does "
                    "not hold."
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
    thirds = np.diff(moved, 2)[even[2:] & even[1:-1] & even[:-2]]
    windows = len(thirds) // WINDOW
    if windows < 2:
        return None
    squares = thirds[: windows * WINDOW].reshape(windows, WINDOW) ** 2
    lags = (1.0, *(keys.get("position_noise_autocorrelation") or ()), 0.0, 0.0, 0.0)
    per_variance = sum(c * r for c, r in zip(COEFFICIENTS, lags, strict=False))
    beyond = float(np.median(squares.mean(axis=1))) - 16.0 * quantum * quantum
    if not beyond > 0.0 or per_variance <= 0.0:
        return 0.0
    return float(np.sqrt(beyond / per_variance))
