"""What a law that is passive by its tuning still rests on, with the numbers that would drop it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import joules
from tautwave.certificate.belief import SIDES, assumed
from tautwave.certificate.tuning.two_port import Tuning
from tautwave.config import Rig, local_wall
from tautwave.rig import axis_allowance, pair_clip, pair_scale
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

    An effort F that is held for h, at the velocity limit v and driving the device of mass m, gives
    F (v h + F h^2 / 2 m); h counts the command's delay, what the host may miss, and the ramp to 0.
    None where nothing bounds it.
    """
    found = []
    for side in SIDES:
        name = f"{side}.{pair}"
        has = axis_allowance(rig, name, delays[name])
        if math.isinf(has.velocity):
            return None
        push = has.shared_effort
        held = has.blind + 0.5 * push / has.shared_rate
        found.append(push * (has.velocity * held + 0.5 * push * held * held / has.inertia))
    return found[0], found[1]


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
