"""Local walls: Colgate and Schenkel's condition under the rig's beliefs, or passivity control.

The wall and the port of an axis act on one device. The port on a free device needs none of its
damping, so the wall may use all of it; the rest is left for the port when a hand holds the device.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from tautwave.allowance import AxisAllowance
from tautwave.analysis.claim import joules
from tautwave.analysis.walls.in_motor import damping_for
from tautwave.analysis.walls.messages import (
    passivity_sentence,
    quantum_sentence,
    stability_sentence,
)
from tautwave.analysis.walls.noise import wall_noise_power
from tautwave.analysis.walls.sampled import SampledWall, wall_transfer
from tautwave.analysis.walls.verdict import WallDevice, WallVerdict, assess_wall
from tautwave.certificate.belief import (
    assumed,
    broken_coulomb,
    broken_damping,
    broken_inertia,
    declared_delays,
    delay_in_periods,
)
from tautwave.certificate.data import Element, Verdict
from tautwave.config import Axis, Rig, Wall, axis_damper, local_wall
from tautwave.rig import axis_allowance, coupling_part, wall_params
from tautwave.rig.allowance.filling import at_least, wall_push, wall_steepness
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay

FREE_FLIGHT = (
    "no hand reverses the device within one period: the wall's controller predicts free flight"
)


def wall_name(rig: Rig, axis_name: str) -> str:
    """Return the name of a wall: "slave wall", with its pair if there are several."""
    side, pair = axis_name.split(".")
    return f"{side} wall" if len(rig.coupling.pairs) == 1 else f"{side} wall of {pair}"


def sampled_wall(rig: Rig, axis_name: str, wall: Wall, delay: CommandDelay) -> SampledWall:
    """Return a wall as the loop renders it."""
    return SampledWall(
        stiffness=wall.stiffness,
        damping=wall.damping,
        period=rig.period_s,
        delay=delay_in_periods(rig, delay),
        filter_s=rig.axes[axis_name].velocity_filter_s,
    )


def damping_at(rig: Rig, axis_name: str, delay: CommandDelay, wall: SampledWall) -> float:
    """Return the device damping that a wall finds, with what a damper in the motor lends to it."""
    has = axis_allowance(rig, axis_name, delay)
    damper = axis_damper(rig, axis_name)
    if damper is None:
        return has.free_damping
    return max(damping_for(damper, has.damping - has.compensated_damping, wall), 0.0)


def wall_verdict(
    rig: Rig,
    axis_name: str,
    wall: Wall,
    delays: Mapping[str, CommandDelay],
    coulomb: Mapping[str, float],
) -> WallVerdict:
    """Return the analysis of one wall on an impedance axis."""
    axis = rig.axes[axis_name]
    side, pair = axis_name.split(".")
    has = axis_allowance(rig, axis_name, delays[axis_name])
    rendered = sampled_wall(rig, axis_name, wall, delays[axis_name])
    device = WallDevice(
        has.inertia,
        damping_at(rig, axis_name, delays[axis_name], rendered),
        coulomb.get(axis_name, 0.0),
        # An effort truncated to its step is off by up to that step, like 2 / K of it in position.
        axis.encoder_quantum + 2.0 * axis.effort_quantum / wall.stiffness,
    )
    hand = stated_hand(rig, pair).hand if side == "master" else None
    return assess_wall(rendered, device, hand)


def wall_element(
    rig: Rig,
    axis_name: str,
    delays: Mapping[str, CommandDelay],
    coulomb: Mapping[str, float],
    asked: float,
) -> Element | None:
    """Return the wall of an axis with its verdicts, None without one.

    `asked` is the stiffness in the rig file, which `derate` may have reduced.
    """
    wall = local_wall(rig, axis_name)
    if wall is None:
        return None
    name = wall_name(rig, axis_name)
    axis = rig.axes[axis_name]
    if axis.causality == "admittance":
        reason = (
            f"{name}: no theorem covers a local wall on an admittance axis; move it to the other "
            f"side, or require coupled_stable"
        )
        verdict = Verdict(False, reason)
        numbers = {"stiffness": wall.stiffness, "damping": wall.damping}
        return Element(name, "wall", axis_name, verdict, verdict, numbers, (reason,))
    judged = wall_verdict(rig, axis_name, wall, delays, coulomb)
    rotary = axis.kind == "rotary"
    has = axis_allowance(rig, axis_name, delays[axis_name])
    passive = _passive(rig, axis_name, wall, judged, has, name, rotary)
    quantum = quantum_sentence(judged, name, rotary=rotary)
    sentences = [passive.reason]
    if asked > wall.stiffness:
        unit = "N m/rad" if rotary else "N/m"
        sentences.insert(
            0,
            f"{name}: K = {asked:.6g} {unit} requested, derated to {wall.stiffness:.6g}, the "
            f"stiffest that is {rig.require.replace('_', ' ')}.",
        )
    if not passive.passed:
        sentences += adversary(rig, axis_name, wall, delays[axis_name], name)
    sentences += [quantum, stability_sentence(judged, name, rotary=rotary)]
    noise = noise_power(rig, axis_name, judged)
    if noise > 0.0:
        sentences.append(_noise_sentence(axis, name, noise))
    claim = wall_claim(rig, axis_name, wall, delays[axis_name])
    if math.isfinite(claim) and not coupling_part(rig).claim_terms:  # else the axis says it
        sentences.append(
            f"{name}: gives at most {joules(claim)} more than it took, in a host's stalls of up to "
            f"{rig.overrun_limit} slots. The next contacts pay that back; until then the wall is "
            "softer, the more it owes."
        )
    return Element(
        name,
        "wall",
        axis_name,
        passive,
        _quantised(rig, axis_name, passive, judged, quantum),
        _numbers(judged, asked)
        | ({"claim_j": claim} if math.isfinite(claim) else {})
        | ({"noise_w": noise} if noise > 0.0 else {}),
        tuple(sentences),
    )


def adversary(rig: Rig, axis_name: str, wall: Wall, delay: CommandDelay, name: str) -> list[str]:
    """Return a sentence with a passive hand that is unstable with this wall; none if none is found.

    The hand is one mass on a spring and a damper, found by the necessity theorem's construction
    (`analysis.necessity`) and verified on the exact sampled loop.
    """
    from tautwave.analysis.exact.rational import Sampled, rational
    from tautwave.analysis.ports.necessity import User, destabilising_hand

    has = axis_allowance(rig, axis_name, delay)
    if axis_damper(rig, axis_name) is not None:
        return []  # the construction is one for a device whose damping is its own
    sampled = sampled_wall(rig, axis_name, wall, delay)
    law = wall_transfer(sampled)
    hand = destabilising_hand(
        Sampled(
            rational(list(law.numerator), list(law.denominator)),
            sampled.period,
            sampled.delay * sampled.period,
        ),
        device=User(has.inertia, has.free_damping),
    )
    if hand is None:
        return []
    numbers = hand.sentence(rotary=rig.axes[axis_name].kind == "rotary").partition(
        " is unstable with this hand"
    )
    return [f"{name}: unstable with this hand on the device{numbers[2]}."]


def wall_claims(rig: Rig) -> dict[str, float]:
    """Return, by axis, the greatest debt of each wall that is bounded [J]."""
    delays = declared_delays(rig)
    debts = {}
    for name in rig.axes:
        wall = local_wall(rig, name)
        if wall is not None and rig.axes[name].causality == "impedance":
            debts[name] = wall_claim(rig, name, wall, delays[name])
    return {name: claim for name, claim in debts.items() if math.isfinite(claim)}


def wall_claim(rig: Rig, axis_name: str, wall: Wall, delay: CommandDelay) -> float:
    """Return the greatest debt of a wall after stalls of the host [J]; inf: no bound.

    What makes it pay is exact without command delay only, and must be able to take the effort away.
    """
    has = axis_allowance(rig, axis_name, delay)
    if has.delay > 0.0 or not _is_prompt(has, _push(rig, axis_name, wall, has)):
        return math.inf
    return wall_params(rig, axis_name, delay).reserve


def _is_prompt(has: AxisAllowance, push: float) -> bool:
    """Return whether an axis can take a wall's effort away in one period, but for rounding."""
    return has.shared_step >= push * (1.0 - 1e-9)


def _push(rig: Rig, axis_name: str, wall: Wall, has: AxisAllowance) -> float:
    """Return the greatest effort of a wall within what its axis has [N m or N]."""
    return min(wall_push(rig.axes[axis_name], wall), has.shared_effort)


def noise_power(rig: Rig, axis_name: str, judged: WallVerdict) -> float:
    """Return what declared noise has a passive wall give on average [W].

    0 under passivity control: its observer counts the noise as given, and softens the wall for it.
    """
    axis = rig.axes[axis_name]
    if not judged.passive or axis.position_noise == 0.0:
        return 0.0
    colour = axis.position_noise_autocorrelation
    return wall_noise_power(
        judged.wall, judged.device.mass, judged.margin, axis.position_noise, colour
    )


def _noise_sentence(axis: Axis, name: str, noise: float) -> str:
    unknown = axis.position_noise_autocorrelation is None
    colour = ", of any colour," if unknown else ""
    return (
        f"{name}: the declared position noise{colour} makes it generate up to {noise:.3g} W "
        "indefinitely, beyond what the device's damping dissipates; that falls with the square "
        "of its stiffness."
    )


def _quantised(
    rig: Rig, axis_name: str, passive: Verdict, judged: WallVerdict, sentence: str
) -> Verdict:
    if not passive.passed:
        return passive
    noise = noise_power(rig, axis_name, judged)
    if noise > 0.0:
        return Verdict(
            False, _noise_sentence(rig.axes[axis_name], wall_name(rig, axis_name), noise)
        )
    if judged.device.quantum == 0.0:
        return passive
    margin = judged.quantised_stiffness - judged.wall.stiffness
    if not judged.passive_quantised:
        return Verdict(False, sentence, margin=margin)
    broken = broken_coulomb(rig, axis_name)
    if broken is not None:
        return Verdict(False, f"{wall_name(rig, axis_name)}: {broken}", margin=margin)
    conditions = (*passive.conditions, *assumed(rig.axes[axis_name], axis_name, coulomb=True))
    return Verdict(True, sentence, conditions, margin)


def _passive(
    rig: Rig,
    axis_name: str,
    wall: Wall,
    judged: WallVerdict,
    has: AxisAllowance,
    name: str,
    rotary: bool,
) -> Verdict:
    axis = rig.axes[axis_name]
    sentence = passivity_sentence(judged, name, rotary=rotary)
    broken = broken_damping(rig, axis_name)
    if judged.passive and broken is None:
        conditions = (
            *assumed(axis, axis_name, damping=True),
            *_rate_limit(rig, axis_name, wall, has),
        )
        return Verdict(True, sentence, conditions, judged.margin)
    if broken is not None and judged.passive:
        return Verdict(False, f"{name}: {broken}", margin=judged.margin)
    if not wall.passivity_control:
        return Verdict(False, sentence, margin=judged.margin)
    if judged.wall.delay > 0.0:
        return Verdict(
            False,
            f"{sentence} Its passivity control is exact only without command delay; these "
            f"commands act {judged.wall.delay:g} periods late.",
            margin=judged.margin,
        )
    broken = broken_inertia(rig, axis_name)
    if broken is not None:
        return Verdict(False, f"{name}: {broken}", margin=judged.margin)
    push = _push(rig, axis_name, wall, has)
    if not _is_prompt(has, push):
        beside = " beside its load" if has.load_rate > 0.0 else ""
        needed = at_least(push / has.period * (has.effort_rate / has.shared_rate))
        return Verdict(
            False,
            f"{sentence} Its passivity control must remove the effort at once, but "
            f"effort_rate_limit allows a drop of only {has.shared_step:.4g} per period{beside}; "
            f"raise that to {needed:g}.",
            margin=judged.margin,
        )
    unit = "N m/rad" if rotary else "N/m"
    reason = (
        f"{name}: K = {wall.stiffness:g} {unit} gives back no more energy than it received, by "
        f"its exact energy observer and controller (Hannaford and Ryu 2002), on a device of at "
        f"least "
        f"{has.inertia:g}; damping alone would allow {judged.passive_stiffness:.4g}."
    )
    conditions = (FREE_FLIGHT, *assumed(axis, axis_name, inertia=True))
    return Verdict(True, reason, conditions)


def _rate_limit(rig: Rig, axis_name: str, wall: Wall, has: AxisAllowance) -> tuple[str, ...]:
    """Return a condition if the effort rate limit may delay the release of the wall's effort.

    A wall's effort changes by at most K v + 2 B v / T per second at the speed v.
    """
    if wall_steepness(rig, axis_name, wall) <= has.shared_rate:
        return ()
    return (f"the effort_rate_limit of {axis_name} is not reached in the wall",)


def _numbers(judged: WallVerdict, asked: float) -> dict[str, Any]:
    return {
        "asked_stiffness": asked,
        **judged.wall._asdict(),
        "device": judged.device._asdict(),
        "needed_damping": judged.leak.damping,
        "needed_at_hz": judged.leak.frequency,
        "damping_margin": judged.margin,
        "passive_stiffness": judged.passive_stiffness,
        "prompt_stiffness": judged.prompt_stiffness,
        "blame": judged.blame._asdict(),
        "remedies": judged.remedies._asdict(),
        "hand": None if judged.hand is None else judged.hand._asdict(),
        "stable_stiffness": judged.stable.limit,
        "stable_at_hz": judged.stable.frequency,
        "stable": judged.coupled_stable,
        "growth": judged.decay,
        "quantised_stiffness": judged.quantised_stiffness,
        "activity_j": judged.activity,
    }
