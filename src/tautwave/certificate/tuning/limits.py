"""Limits under which a law of positions can be passive by its tuning, beside its damping.

A clipped spring is a spring only while both ends clip alike: where one motor gives out before the
other, a stretch beyond it is carried around and let go with the stronger one's effort. A local wall
takes from the effort of one end what the other still has.
"""

from __future__ import annotations

import math

from tautwave.config import Rig, local_wall
from tautwave.rig import pair_scale
from tautwave.rig.arms import load_reserves

LONGEST_LINE = 400
"""Periods of delay up to which the grid of angles is fine enough."""


def unlike_ends(rig: Rig, pair: str) -> str | None:
    """Return why a pair's two motors cannot hold one spring, as a clause; None where they can."""
    names = [f"{side}.{pair}" for side in ("master", "slave")]
    for name in names:
        if local_wall(rig, name) is not None:
            return (
                f"the local wall of {name} takes from its motor what the other end still has; "
                "remove the wall"
            )
    reserves = load_reserves(rig)
    left = [rig.axes[name].effort_limit - reserves.get(name, 0.0) for name in names]
    left[1] /= pair_scale(rig.coupling.pairs[pair]).force_scale
    if not math.isclose(left[0], left[1], rel_tol=1e-9):
        unit = "N m" if rig.master.axes[pair].kind == "rotary" else "N"
        return (
            f"the motor of {names[0]} has {left[0]:.4g} {unit} for the coupling, that of "
            f"{names[1]} {left[1]:.4g} in the master's units, and beyond the weaker one the "
            "stronger one gives energy; give both the same"
        )
    return None


def too_long(rig: Rig) -> str | None:
    """Return why a delay is not covered, as a clause; None where it is."""
    if rig.delay_samples <= LONGEST_LINE:
        return None
    return (
        f"its delay of {rig.delay_samples} periods is more than {LONGEST_LINE}, the longest "
        "whose need is known"
    )
