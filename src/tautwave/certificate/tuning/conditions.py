"""What a law that is passive by its tuning still rests on, with the numbers that would drop it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import joules, short
from tautwave.certificate.belief import SIDES, assumed
from tautwave.certificate.tuning.two_port import Tuning
from tautwave.config import Rig, local_wall
from tautwave.rig import (
    axis_allowance,
    axis_claim,
    end_energy,
    kinetic_energy,
    pair_clip,
    pair_scale,
)
from tautwave.rig.claim_verdict import PROMPT_PASSES, STALL_PASSES, prompt_refusal
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def conditions_of(rig: Rig, pair: str, delays: Delays, tuning: Tuning) -> Iterator[str]:
    """Yield what a law that has the damping it needs still rests on, as sentences."""
    names = [f"{side}.{pair}" for side in SIDES]
    for name in names:
        yield from assumed(rig.axes[name], name, damping=True)
    if tuning.clipped_short > 0.0:
        unit = "N m" if rig.master.axes[pair].kind == "rotary" else "N"
        clip = pair_clip(rig, pair)
        force = pair_scale(rig.coupling.pairs[pair]).force_scale
        yield (
            f"the coupling of {pair} asks for no more than {clip:.4g} {unit} at the master and "
            f"{clip * force:.4g} at the slave, beyond which it is clipped"
        )
    has = [axis_allowance(rig, name, delays[name]) for name in names]
    for end, name in enumerate(names):
        yield from _of_rate(rig, pair, end, has, tuning)
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
    condition = f"no sample of {name} is lost and the host does not stall"
    if safe > 1.5 * claim.period:  # a period is no gap
        condition = f"no gap between samples of {name} is longer than {1e3 * safe:.4g} ms"
    condition += (
        f" (it may supply {joules(stall)} in one of {1e3 * claim.gap:.4g} ms, "
        f"{short(stall / most)} times the {joules(most)} that it has at its velocity limit)"
    )
    yield condition


def _of_rate(
    rig: Rig, pair: str, end: int, has: list[AxisAllowance], tuning: Tuning
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
    needed = sum(a * v for a, v in zip(tuning.answers[end], speeds, strict=True) if a > 0.0)
    needed *= 1.0 if end == 0 else scale.force_scale
    wall = local_wall(rig, name)
    if wall is not None:
        behind = one.period + rig.axes[name].velocity_filter_s
        needed += (wall.stiffness + 2.0 * wall.damping / behind) * one.velocity
    if one.compensation_effort > 0.0:
        needed += 2.0 * one.compensation_effort / one.period
    if needed <= one.shared_rate:
        return
    condition = f"the effort_rate_limit of {name} is not reached in the coupling"
    if math.isfinite(needed):
        whole = needed * one.effort_rate / one.shared_rate
        condition += f"; {whole:.4g} would suffice at all velocities within its limits"
    yield condition


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
    energies = stall_joules(rig, pair, delays)
    if energies is None:
        return ""
    parts = [
        f"{joules(given)} at {side}.{pair}" for side, given in zip(SIDES, energies, strict=True)
    ]
    return f" Lost samples and stalls of the host may supply up to {' and '.join(parts)}, each."


def engagement_joules(rig: Rig, pair: str, stiffness: float, delays: Delays) -> float:
    """Return what one engagement may supply [J], infinite where nothing bounds it.

    While its ramp lasts the ends may be moved apart for less than they give afterwards, as far as
    their velocities and ranges allow: from one end of a range to the other, since a pair engages
    anywhere, and beyond until the run has ended. A fixed offset begins with the spring stretched by
    `engage_tolerance`.
    """
    keys = rig.coupling.pairs[pair]
    clip = pair_clip(rig, pair)
    stretch = 0.0
    if keys.offset != "at_engage":
        stretch = math.inf if keys.engage_tolerance is None else keys.engage_tolerance
    if rig.coupling.engage_ramp_s > 0.0:
        master, slave = (_moved(rig, f"{side}.{pair}", delays) for side in SIDES)
        stretch += master + slave / pair_scale(keys).scale
    if stretch == 0.0 or stiffness == 0.0:
        return 0.0
    slack = min(stretch, clip / stiffness)
    return clip * (stretch - slack) + 0.5 * stiffness * slack * slack


def _moved(rig: Rig, name: str, delays: Delays) -> float:
    """Return how far an axis may be moved while its pair engages [rad or m]."""
    has, ends = axis_allowance(rig, name, delays[name]), rig.axes[name].position_range
    drawn = has.velocity * rig.coupling.engage_ramp_s
    if ends is None:
        return drawn
    return min(drawn, ends[1] - ends[0] + has.velocity * (has.period + has.delay))


def engagement_condition(rig: Rig, pair: str, engaging: float) -> str:
    """Return the condition on an engagement that may supply much, "" where none is needed."""
    for name in (f"{side}.{pair}" for side in SIDES):
        given, most = end_energy(rig, name, engaging), kinetic_energy(rig, name)
        if given > PROMPT_PASSES * most:
            return (
                f"the ends of {pair} are not moved apart while it engages ({name} may supply "
                f"{joules(given)} in one engagement, {short(given / most)} times the "
                f"{joules(most)} that it has at its velocity limit)"
            )
    return ""


def engagement_refusal(rig: Rig, pair: str, stiffness: float, delays: Delays) -> str:
    """Return why an engagement may supply too much to depend on a condition; "" if not."""
    engaging = engagement_joules(rig, pair, stiffness, delays)
    for name in (f"{side}.{pair}" for side in SIDES):
        most = kinetic_energy(rig, name)
        if math.isfinite(engaging) and (
            refusal := prompt_refusal(end_energy(rig, name, engaging), most)
        ):
            remedy = _shorter_ramp(rig, pair, stiffness, delays)
            return f"at {name}, {refusal}: its ends may be moved apart as it engages; {remedy}"
    return ""


def _shorter_ramp(rig: Rig, pair: str, stiffness: float, delays: Delays) -> str:
    """Return the ramp of an engagement that is not refused, in words."""
    low, high = 0.0, rig.coupling.engage_ramp_s

    def allowed(ramp: float) -> bool:
        coupling = rig.coupling.model_copy(update={"engage_ramp_s": ramp})
        trial = rig.model_copy(update={"coupling": coupling})
        given = engagement_joules(trial, pair, stiffness, delays)
        names = [f"{side}.{pair}" for side in SIDES]
        return not any(
            prompt_refusal(end_energy(rig, name, given), kinetic_energy(rig, name))
            for name in names
        )

    if not allowed(0.0):
        return "lower engage_tolerance or effort_limit"
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if allowed(middle) else (low, middle)
    return f"coupling.engage_ramp_s of {float(f'{0.95 * low:.2g}'):g} s or less would do"
