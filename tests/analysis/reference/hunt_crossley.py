"""Hunt and Crossley's contact fitted to a bounce."""

from __future__ import annotations

import numpy as np

from tautwave.analysis.identification.contact_motion import EXPONENTS
from tautwave.analysis.identification.regression import Array, solve


def fit_hunt_crossley(depth: Array, rate: Array, effort: Array) -> tuple[float, float, float]:
    """Stiffness k, loss coefficient c and exponent n of `F = k y^n + c y^n dy/dt`.

    For samples with exact depth [m] and rate [m/s] and no offset, unfiltered; y > 0.
    """

    def columns(n: float) -> Array:
        power = depth**n
        return np.stack([power, power * rate], axis=1)

    def residual(n: float) -> Array:
        part = columns(n)
        rest: Array = effort - part @ solve(part, effort)
        return rest

    n = min(EXPONENTS, key=lambda e: float(np.sum(residual(e) ** 2)))
    for _ in range(60):
        here = residual(n)
        slope = (residual(n + 1e-6) - residual(n - 1e-6)) / 2e-6
        change = -float(slope @ here) / float(slope @ slope)
        n += min(max(change, -0.3), 0.3)
        if abs(change) < 1e-13 * n:
            break
    found = solve(columns(n), effort)
    return float(found[0]), float(found[1]), n
