"""The share of a motion's power that no hand makes by will, from a recording."""

from __future__ import annotations

import math

import numpy as np

from tautwave.analysis.fast_motion import fast_share
from tautwave.report.run.rundir import SIDES, Run, block, served_rows
from tautwave.report.units import number


def fast_shares(run: Run, pair: str) -> dict[str, float]:
    """Return `fast_share` of both sides of a pair, as measured; no key where none was recorded."""
    shares: dict[str, float] = {}
    for side in SIDES:
        name = f"{side}.{pair}.position"
        values = run.read(name).get(name)
        if values is None or not math.isfinite(run.rate_hz):
            continue
        served = served_rows(run, f"{side}.{pair}")
        kept = values[served]
        if len(kept) < 2 or not np.isfinite(kept).all():
            continue
        keys = block(run.rig, side, "axes", pair)
        noise, step = (
            number(keys.get(key)) or 0.0 for key in ("position_noise", "encoder_quantum")
        )
        period = len(values) / len(kept) / run.rate_hz
        shares[side] = fast_share(kept, period, math.sqrt(noise**2 + step**2 / 12.0))
    return shares
