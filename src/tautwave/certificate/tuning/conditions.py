"""What a law that is passive by its tuning still rests on, with the numbers that would drop it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import joules, short
from tautwave.certificate.belief import SIDES, assumed
from tautwave.certificate.tuning.two_port import Tuning
from tautwave.config import Rig, local_wall
from tautwave.rig import axis_allowance, axis_claim, pair_clip, pair_scale
from tautwave.rig.claim_verdict import STALL_PASSES
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def conditions_of(rig: Rig, pair: str, delays: Delays, found: Tuning) -> Iterator[str]:
    """Yield what a law that has the damping it needs still rests on, as sentences."""
    names = [f"{side}.{pair}" for side in SIDES]
    for name in names:
        yield from assumed(rig.axes[name], name, damping=True)
    if found.clipped_short > 0.0:
        unit = "N m" if rig.master.axes[pair].kind == "rotary" else "N"
        clip = pair_clip(rig, pair)
        force = pair_scale(rig.coupling.pairs[pair]).force_scale
        yield (
            f"the coupling of {pair} asks for no more than {clip:.4g} {unit} at the master and "
            f"{clip * force:.4g} at the slave, beyond which it is clipped"
        )
    has = [axis_allowance(rig, name, delays[name]) for name in names]
    for end, name in enumerate(names):
        yield from _of_rate(rig, pair, end, has, found)
        yield from _of_steps(rig, name, has[end])
    for name, one in zip(names, has, strict=True):
        if math.isinf(one.velocity):
            yield (
                f"no sample of {name} is lost and the host does not stall; with a velocity_limit "
                "the energy that this supplies could be bounded"
            )
        else:
            yield from _of_gaps(rig, name, delays[name])


def _of_gaps(rig: Rig, name: str, delay: CommandDelay) -> Iterator[str]:
    """Yield a condition where a stall may give a device more than its own motion at the limit."""
    claim = axis_claim(rig, name, delay)
    most, stall = claim.kinetic, claim.let_go
    if stall <= STALL_PASSES * most:
        return
    safe = claim.safe_gap()
    said = f"no sample of {name} is lost and the host does not stall"
    if safe > 0.0:
        said = f"no gap between samples of {name} is longer than {1e3 * safe:.4g} ms"
    said += (
        f" (it may supply {joules(stall)} in one of {1e3 * claim.gap:.4g} ms, "
        f"{short(stall / most)} times the {joules(most)} that it has at its velocity limit)"
    )
    yield said


def _of_rate(
    rig: Rig, pair: str, end: int, has: list[AxisAllowance], found: Tuning
) -> Iterator[str]:
    """Yield a condition where the effort's rate may be limited.

    A coupling's changes by no more than sum |a[j]| v a second, v how fast the ends move, a wall's
    by K v + 2 B v / T; what compensates friction turns round at once.
    """
    one, name = has[end], f"{SIDES[end]}.{pair}"
    if math.isinf(one.shared_rate):
        return
    scale = pair_scale(rig.coupling.pairs[pair])
    speeds = (has[0].velocity, has[1].velocity / scale.scale)
    needed = sum(a * v for a, v in zip(found.answers[end], speeds, strict=True) if a > 0.0)
    needed *= 1.0 if end == 0 else scale.force_scale
    wall = local_wall(rig, name)
    if wall is not None:
        behind = one.period + rig.axes[name].velocity_filter_s
        needed += (wall.stiffness + 2.0 * wall.damping / behind) * one.velocity
    if one.compensation_effort > 0.0:
        needed += 2.0 * one.compensation_effort / one.period
    if needed <= one.shared_rate:
        return
    said = f"the effort_rate_limit of {name} is not reached in the coupling"
    if math.isfinite(needed):
        whole = needed * one.effort_rate / one.shared_rate
        said += f"; {whole:.4g} would suffice at all velocities within its limits"
    yield said


def _of_steps(rig: Rig, name: str, has: AxisAllowance) -> Iterator[str]:
    """Yield a condition where effort steps may give more than friction takes.

    A step towards 0 leaves out less than one quantum, which Coulomb friction of that size takes.
    """
    if not has.quantum > 0.0:
        return
    if has.coupling_coulomb < has.quantum:
        yield (
            f"the effort steps of {name} ({has.quantum:.4g}) are not above its Coulomb friction, "
            f"of which {has.coupling_coulomb:.4g} is certain and left"
        )
    else:
        yield from assumed(rig.axes[name], name, coulomb=True)


def stall_joules(rig: Rig, pair: str, delays: Delays) -> tuple[float, float] | None:
    """Return what lost samples and a stalled host may cost at either end [J], its device's.

    None where nothing bounds it. See `analysis.claim` for the bound.
    """
    names = [f"{side}.{pair}" for side in SIDES]
    claims = [axis_claim(rig, name, delays[name]) for name in names]
    if any(math.isinf(min(claim.velocity, claim.travel)) for claim in claims):
        return None
    return claims[0].under_way, claims[1].under_way


def stall_sentence(rig: Rig, pair: str, delays: Delays) -> str:
    """Return what lost samples and a stalled host may cost, '' where nothing bounds it."""
    found = stall_joules(rig, pair, delays)
    if found is None:
        return ""
    parts = [f"{joules(given)} at {side}.{pair}" for side, given in zip(SIDES, found, strict=True)]
    return f" Lost samples and stalls of the host may supply up to {' and '.join(parts)}, each."


def engagement_joules(rig: Rig, pair: str, stiffness: float, delays: Delays) -> float:
    """Return what one engagement may supply [J], infinite where nothing bounds it.

    While its ramp lasts the ends may be moved apart for less than they give afterwards; a fixed
    offset begins with the spring stretched by `engage_tolerance`.
    """
    keys = rig.coupling.pairs[pair]
    clip = pair_clip(rig, pair)
    stretch = 0.0
    if keys.offset != "at_engage":
        stretch = math.inf if keys.engage_tolerance is None else keys.engage_tolerance
    if rig.coupling.engage_ramp_s > 0.0:
        names = [f"{side}.{pair}" for side in SIDES]
        master, slave = (axis_allowance(rig, name, delays[name]).velocity for name in names)
        stretch += (master + slave / pair_scale(keys).scale) * rig.coupling.engage_ramp_s
    if stretch == 0.0 or stiffness == 0.0:
        return 0.0
    slack = min(stretch, clip / stiffness)
    return clip * (stretch - slack) + 0.5 * stiffness * slack * slack
