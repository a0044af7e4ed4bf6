"""Friction of a device, taken off the hand by its own motor, within what the device surely has.

A held effort f gives -f dx in a period. The device's Coulomb friction c takes c |path| >= c |dx|:
with |f| <= c the two together take energy in every period, whatever sign, delay, noise or rate the
effort has. A viscous effort b' H v of a velocity read through any |H| <= 1, however late, gives at
most b' v**2, and the device's own damping b >= b' takes that. So both are passive with their device
as far as c and b are lower bounds, and are spent: no wall or port may count on them again.

Source: derived here; the first is the sampled form of what every Coulomb compensation relies on.
"""

from __future__ import annotations

from typing import NamedTuple

from tautwave.laws.limit import clamp


class CompensationParams(NamedTuple):
    """What is taken off: coulomb [N m or N], from `soft` [rad/s or m/s] on in full; viscous."""

    coulomb: float
    viscous: float
    soft: float


NO_COMPENSATION = CompensationParams(0.0, 0.0, 1.0)


def compensation_effort(p: CompensationParams, velocity: float) -> float:
    """Return the resisting effort [N m or N] at a velocity [rad/s or m/s]: it helps, so -."""
    return -(p.coulomb * clamp(velocity / p.soft, 1.0) + p.viscous * velocity)
