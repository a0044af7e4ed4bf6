"""Position-position coupling: a spring and a damper between delayed positions.

The classic alternative to waves, kept for comparison: it is passive without delay and on a
continuous device only. Stable with delay if b + d >= K tau at both ends (Nuno et al., Automatica
47, 2011); a lossless device loses stability at any delay.
"""

from __future__ import annotations


def coupler_effort(
    stiffness: float,
    damping: float,
    position: float,
    velocity: float,
    far_position: float,
    far_velocity: float,
) -> float:
    """Return the resisting effort K (x - x_far) + B (v - v_far) [N m or N]."""
    return stiffness * (position - far_position) + damping * (velocity - far_velocity)


def coupler_loss(stiffness: float, work: float, before: float, after: float) -> float:
    """Return what the coupler dissipated [J] of the `work` both devices did on it.

    `before` and `after` are the errors x - x_far [rad or m] at both ends of the period; negative
    where delay and sampling created energy.
    """
    return work - 0.5 * stiffness * (after - before) * (after + before)


def coupler_stored(stiffness: float, position: float, far_position: float) -> float:
    """Return the energy K (x - x_far)**2 / 2 [J] of the spring between the present positions."""
    error = position - far_position
    return 0.5 * stiffness * error * error
