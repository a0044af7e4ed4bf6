"""Closed forms of the damping that a sampled wall needs, for special walls."""

from __future__ import annotations

import math

from tautwave.analysis.walls.sampled import PulseTransfer, SampledWall, split_delay


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
