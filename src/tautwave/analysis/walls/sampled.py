"""A virtual wall as the sampled controller sees it: its pulse transfer and closed-form bounds.

The wall's resisting effort is u[k] = K x[k] + B w[k] with w the velocity as the live law filters
it, held for a period and late by a delay. Bilateral here: the one-sided wall of the live law
needs no more damping than this one.

Sources: Colgate & Schenkel, "Passivity of a class of sampled-data systems", J. Robotic Systems
14(1), 1997; Colgate & Brown, "Factors affecting the Z-width of a haptic display", ICRA 1994.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

from tautwave.errors import ConfigError


class SampledWall(NamedTuple):
    """A wall on a loop; SI, linear or rotary.

    Attributes
    ----------
    stiffness : float
        K [N/m or N m/rad].
    damping : float
        B [N s/m or N m s/rad], of either sign.
    period : float
        Loop period T [s].
    delay : float
        Periods from a sample until its effort acts, with a fraction; 0: at once. The hold's own
        half period is not part of it.
    filter_s : float
        Time constant [s] of the velocity's low-pass, as `velocity_filter_s` of an axis; 0: none.
    """

    stiffness: float
    damping: float = 0.0
    period: float = 1e-3
    delay: float = 0.0
    filter_s: float = 0.0


class PulseTransfer(NamedTuple):
    """E(z): effort [N or N m] per position [m or rad]; real coefficients, highest power first."""

    numerator: tuple[float | Fraction, ...]
    denominator: tuple[float | Fraction, ...] = (1.0,)


SNAP = 1e-9
"""Share of a period below which a delay counts as whole."""


def check_wall(wall: SampledWall) -> None:
    """Raise ConfigError, one sentence per fault, unless the numbers can be those of a wall."""
    problems = [
        f"wall {name}: must be finite (got {value})"
        for name, value in wall._asdict().items()
        if not math.isfinite(value)
    ]
    if not problems:
        if wall.period <= 0.0:
            problems.append(f"wall period: must be positive (got {wall.period})")
        problems += [
            f"wall {name}: must not be negative (got {value})"
            for name, value in wall._asdict().items()
            if name not in ("damping", "period") and value < 0.0
        ]
    if problems:
        raise ConfigError(problems)


def split_delay(delay: float) -> tuple[int, float]:
    """Return the whole periods of a delay and the rest in [0, 1)."""
    whole = math.floor(delay + SNAP)
    rest = delay - whole
    return whole, rest if rest > SNAP else 0.0


def velocity_gain(wall: SampledWall) -> float:
    """Return the gain T / (T + tau) of the velocity's low-pass, as the live loop has it [1]."""
    return wall.period / (wall.period + wall.filter_s)


def wall_transfer(wall: SampledWall) -> PulseTransfer:
    """Return E(z) = K + B g (z - 1) / (T (z - 1 + g)) of a wall, without its delay.

    The coefficients are fractions and exact: beside a large K a slow filter's B would be rounded.
    """
    stiffness = Fraction(wall.stiffness)
    if wall.damping == 0.0:
        return PulseTransfer((stiffness,))
    gain = Fraction(wall.period) / (Fraction(wall.period) + Fraction(wall.filter_s))
    slope = Fraction(wall.damping) * gain / Fraction(wall.period)
    return PulseTransfer((stiffness + slope, stiffness * (gain - 1) - slope), (1, gain - 1))
