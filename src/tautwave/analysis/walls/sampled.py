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


def tustin_velocity(damping: float, period: float, leak: float = 1.0) -> PulseTransfer:
    """Return B (1 + r)(z - 1) / (T (z + r)): Tustin's difference at leak r = 1.

    With r = 1 the pole at z = -1 makes every damping too small; see `needed_damping`.
    """
    gain = damping * (1.0 + leak) / period
    return PulseTransfer((gain, -gain), (1.0, leak))


def leaky_bound(stiffness: float, damping: float, period: float, leak: float) -> float:
    """Return the damping that K and the leaky Tustin velocity need, B >= 0, 0 <= leak < 1."""
    return 0.5 * stiffness * period + damping * (1.0 + leak) / (1.0 - leak)


def prompt_bound(wall: SampledWall) -> float:
    """Return the damping [N s/m or N m s/rad] a wall without delay needs, in closed form.

    K T / 2 + max(B T / (T + 2 tau), -B): a positive damper leaks at half the sampling rate, where
    a filter helps; a negative one at low frequencies, where none does.
    """
    lag = wall.period / (wall.period + 2.0 * wall.filter_s)
    return 0.5 * wall.stiffness * wall.period + max(wall.damping * lag, -wall.damping)


def spring_bound(wall: SampledWall) -> float:
    """Return the damping [N s/m or N m s/rad] the wall's spring alone needs, for any delay.

    K T (1/2 + d) for d whole periods. With a share f of a period more, the largest eigenvalue of
    the rank-two form at theta -> 0: K T (L + sqrt(L^2 + 4 f (1 - f))) / 4, L = 2 d + 1 + 2 f; up
    to 7.7 % above K (T / 2 + delay).
    """
    whole, rest = split_delay(wall.delay)
    span = 2.0 * whole + 1.0 + 2.0 * rest
    reach = span + math.sqrt(span * span + 4.0 * rest * (1.0 - rest))
    return 0.25 * wall.stiffness * wall.period * reach


def lag_rule(wall: SampledWall) -> float:
    """Return K (T / 2 + delay) + |B|: the usual rule [N s/m or N m s/rad]; a hint, no bound."""
    return wall.stiffness * wall.period * (0.5 + wall.delay) + abs(wall.damping)
