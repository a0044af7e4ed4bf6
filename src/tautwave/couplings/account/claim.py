"""What an end of a pair with an account may supply, in joules known before the run.

The bound is that of a wave port, `analysis.claim`, with E0 + D for its 2 E0. The
effort that acts is held, limited and faded by the same controller, so W is the same sum.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.analysis.claim import Claim, joules, short, watts
from tautwave.config import Rig, local_wall
from tautwave.contracts import CoupledAxis
from tautwave.couplings.account.from_keys import noise_share
from tautwave.laws.account import CALM_SHARE, AccountParams
from tautwave.rig import axis_allowance, axis_claim, coupled_axis, end_constants, wall_params
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
        leak=account.income / known.period,
        owed=0.0
        if local_wall(rig, axis_name) is None
        else wall_params(rig, axis_name, delays[axis_name]).reserve,
    )


def claimed_joules(rig: Rig, axis_name: str, delays: Delays) -> float:
    """Return what an end may supply in a run, as seen by its encoder [J]; inf: no claim."""
    claim = claim_of(rig, axis_name, delays)
    return claim.seen(rig.claimed_s) if isinstance(claim, Claim) else math.inf


def held_facts(rig: Rig, delays: Delays) -> Iterator[tuple[str, str]]:
    """Yield for each axis what its account holds while nothing moves, and for how long.

    A force F at rest needs (1 + n) F**2 T**2 / m of the funds that the gate plans with: it expects
    the last command and the n under way to move the device that something holds.
    """
    for axis_name, axis in rig.axes.items():
        known = coupled_axis(rig, axis_name, delays[axis_name])
        account = end_constants(rig, axis_name, delays[axis_name]).account
        assert known.inertia is not None
        most = axis_allowance(rig, axis_name, delays[axis_name]).shared_effort
        planned = CALM_SHARE * account.share * account.reserve
        force = math.sqrt(known.inertia * planned / (1 + known.delay)) / known.period
        unit = "N m" if axis.kind == "rotary" else "N"
        text = f"at rest its reserve of {joules(account.reserve)} holds "
        if force < most:
            full = account.reserve * (most / force) ** 2
            text += f"{force:.3g} {unit}, and {most:.3g} with {joules(full)}"
        else:
            text += f"{most:.3g} {unit}"
        lost = flicker_taken(known, account) / known.period
        if lost > 0.0:
            text += (
                f", for {short(account.reserve / lost)} s at least: a reading that flickers "
                f"between two encoder steps may take {watts(lost)} more than noise is given"
            )
        else:
            text += ", for as long as the noise is no more than declared"
        yield f"held force at {axis_name}", text


def flicker_taken(axis: CoupledAxis, account: AccountParams) -> float:
    """Return what noise, and at worst a flicker of a step, take beyond the income [J per period].

    Errors of +-q/2 by turns take G q**2 / 2.
    """
    noise = noise_share(axis) * axis.position_noise**2
    return account.gain * (noise + 0.5 * axis.encoder_quantum**2) - account.income
