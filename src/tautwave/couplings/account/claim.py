"""What an end of a pair with an account may supply, in joules known before the run.

The bound is that of a wave port, `analysis.claim`, with E0 + D for its 2 E0. The
effort that acts is held, limited and faded by the same controller, so W is the same sum.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.analysis.claim import Claim
from tautwave.config import Rig, local_wall
from tautwave.couplings.account.from_keys import greatest_income
from tautwave.rig import axis_claim, coupled_axis, end_constants, wall_params
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def claim_of(rig: Rig, axis_name: str, delays: Delays) -> Claim | str:
    """Return what the end at an axis may supply, or the key without which it is unbounded."""
    axis = rig.axes[axis_name]
    assert axis.inertia is not None
    for key in ("velocity_limit", "effort_rate_limit"):
        if getattr(axis, key) is None:
            return key
    known = coupled_axis(rig, axis_name, delays[axis_name])
    account = end_constants(rig, axis_name, delays[axis_name]).account
    return axis_claim(rig, axis_name, delays[axis_name])._replace(
        reserve=0.5 * (account.reserve + account.debt),
        leak=greatest_income(account) / known.period,
        owed=0.0
        if local_wall(rig, axis_name) is None
        else wall_params(rig, axis_name, delays[axis_name]).reserve,
    )


def claimed_joules(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what an end may supply in a run, as seen by its encoder [J]; inf: no claim."""
    claim = claim_of(rig, axis_name, delays)
    return claim.seen(rig.claimed_s) if isinstance(claim, Claim) else math.inf
