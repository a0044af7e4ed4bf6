"""The grip of a hand that moves, where what it wanted is known: an instructed motion, a display.

F = f0 - K (x - r) - B d(x - r)/dt - M a, the effort on the device at the sensor: the grip pulls the
hand's own mass M along, from where it is (x) towards where it wants to be (r).
"""

from __future__ import annotations

import numpy as np

from tautwave.analysis.identification.contact_model import ContactFit
from tautwave.analysis.identification.contact_motion import Motion
from tautwave.analysis.identification.regression import Array, goodness, intervals, solve


def fit_hand(motion: Motion, intent: Array) -> ContactFit:
    """Return stiffness, damping and mass of a grip, and the sensor's offset.

    Parameters
    ----------
    motion : Motion
        Position and effort at the hand, filtered.
    intent : array, (n,)
        Wanted position [rad or m], on the same times as the position.
    """
    away = motion.position - intent
    columns = np.stack(
        [
            np.ones(len(motion.rows)),
            motion.filtered(away),
            motion.filtered(away, 1),
            motion.filtered(motion.position, 2),
        ],
        axis=1,
    )
    coefficients = solve(columns, motion.target)
    residual = motion.target - columns @ coefficients
    sign = 1.0 if coefficients[1] >= 0.0 else -1.0
    offset, stiffness, damping, mass = intervals(columns, residual, list(coefficients))
    elastic = coefficients[1] * columns[:, 1]
    spread = float(np.var(motion.target))
    return ContactFit(
        "hand",
        {
            "stiffness": stiffness.scaled(sign),
            "damping": damping.scaled(sign),
            "mass": mass.scaled(sign),
            "offset": offset,
        },
        0,
        int(sign),
        stiffness.scaled(sign),
        float(np.var(elastic)) / spread if spread > 0.0 else 0.0,
        1.0,
        *goodness(motion.target, residual),
        np.asarray((motion.rows + motion.kernel.half) * motion.kernel.period, dtype=np.float64),
        motion.filtered(motion.position),
        motion.target,
        np.asarray(columns @ coefficients, dtype=np.float64),
        np.ones(len(motion.rows), dtype=bool),
        columns,
    )
