"""The verdict on a law of positions by its tuning, as a sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from tautwave.analysis.claim import joules
from tautwave.certificate.belief import SIDES, broken_damping
from tautwave.certificate.data import Element, Verdict
from tautwave.certificate.tuning.conditions import (
    conditions_of,
    engagement_condition,
    engagement_joules,
    engagement_refusal,
    stall_sentence,
)
from tautwave.certificate.tuning.two_port import Tuning, coupling_damping, tuning
from tautwave.config import Rig, local_wall
from tautwave.rig import axis_allowance, axis_claim, coupling_law, pair_clip
from tautwave.rig.claim_verdict import stall_refusal
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def tuned_element(rig: Rig, pair: str, delays: Delays, remedy: str) -> Element:
    """Return the coupling of a pair as an element; `remedy` ends the sentence of one that fails."""
    head = f"coupling of {pair}"
    why = _uncovered(rig)
    tuned = tuning(rig, pair, delays) if why is None else None
    if tuned is None:
        why = why or (
            "an axis takes no effort or is served by a slow bus, or the law does not come to rest, "
            "or reads an effort sensor"
        )
        verdict = Verdict(False, f"{head}: not certified: {why}. {remedy}")
        return Element(head, "coupling", pair, verdict, verdict, {}, (verdict.reason,))
    names = [f"{side}.{pair}" for side in SIDES]
    clipped = tuned.clipped_short <= 0.0
    margin = -min(tuned.short, tuned.clipped_short)
    numbers = {
        **tuned._asdict(),
        "damping": [axis_allowance(rig, name, delays[name]).free_damping for name in names],
        "damping_left": list(coupling_damping(rig, pair, delays)),
        "clip": pair_clip(rig, pair),
    }
    text = f"{head}: {tuning_sentence(rig, pair, tuned)}"
    broken = [f"{name}, {why}" for name in names if (why := broken_damping(rig, name)) is not None]
    if broken:
        verdict = Verdict(False, f"{head}: {broken[0]}", margin=margin)
    elif not clipped and tuned.short > 0.0:
        verdict = Verdict(False, f"{text} {remedy}", margin=margin)
    elif not clipped and tuned.hears and (beside := _beside(rig, pair)) is not None:
        verdict = Verdict(
            False,
            f"{head}: not certified: its filtered velocities are predicted from all that is sent, "
            f"so {beside} would enter its spring; remove that or velocity_filter_s",
            margin=margin,
        )
    else:
        numbers["holds"] = "by tuning"
        text += stall_sentence(rig, pair, delays)
        conditions = list(conditions_of(rig, pair, delays, tuned))
        engaging = engagement_joules(rig, pair, tuned.stiffness, delays)
        if math.isinf(engaging):
            numbers["engage_j"] = None
            conditions.append(
                f"the ends of {pair} are not moved apart while it engages; with velocity limits "
                "and engage_tolerance the energy that this supplies could be bounded"
            )
        elif engaging > 0.0:
            numbers["engage_j"] = engaging
            text += f" Each engagement may supply up to {joules(engaging)} more."
            if said := engagement_condition(rig, pair, engaging):
                conditions.append(said)
        verdict = Verdict(True, text, tuple(conditions), margin)
        refused = _refused(rig, names, delays) or engagement_refusal(
            rig, pair, tuned.stiffness, delays
        )
        if refused:  # it is passive all the same, and what it claims is known
            numbers["refused"] = f"{head}: {refused}"
            verdict = Verdict(False, f"{head}: {refused}", margin=margin)
    quantised = verdict
    if verdict.passed and any(rig.axes[name].encoder_quantum for name in names):
        quantised = Verdict(
            False, f"{head}: no proof covers its limit cycles caused by encoder steps."
        )
    return Element(head, "coupling", pair, verdict, quantised, numbers, (verdict.reason,))


def _refused(rig: Rig, names: Sequence[str], delays: Delays) -> str:
    """Return why an end may supply too much in a stall to depend on there being none; "" if not."""
    refusals = (
        (name, stall_refusal(rig, name, axis_claim(rig, name, delays[name]))) for name in names
    )
    return next((f"at {name}, {refusal}" for name, refusal in refusals if refusal), "")


def _uncovered(rig: Rig) -> str | None:
    """Return why a law cannot be passive by its tuning, as a clause."""
    if rig.link is not None:
        return "over a network its delay is not known"
    if not coupling_law(rig).alike:
        return (
            f"law {rig.coupling.law} does not send the efforts of one spring to both ends, which "
            "the proof by tuning is of"
        )
    return None


def _beside(rig: Rig, pair: str) -> str | None:
    """Return what else is sent to a pair's motors than its coupling, as a noun."""
    for side in SIDES:
        name = f"{side}.{pair}"
        if local_wall(rig, name) is not None:
            return f"the wall of {name}"
        if rig.axes[name].compensation is not None:
            return f"the compensation of {name}"
    return None


def tuning_sentence(rig: Rig, pair: str, tuning: Tuning) -> str:
    """Return what a law needs and what its devices have, as a sentence."""
    unit = "N m s/rad" if rig.master.axes[pair].kind == "rotary" else "N s/m"
    if tuning.clipped_short <= 0.0:
        times = ""
        if 0.0 < tuning.needed < tuning.clipped_needed:
            times = f" ({tuning.clipped_needed / tuning.needed:.3g} times what it needs unclipped)"
        return (
            "passive by tuning for any hand and environment, also where it is clipped: sampled, "
            f"with delays, it needs {tuning.clipped_needed:.4g} {unit} of each device if both have "
            f"equal damping{times}, and they have {-tuning.clipped_short:.4g} to spare."
        )
    if tuning.short <= 0.0:
        more = ""
        if math.isfinite(tuning.clipped_short):
            more = (
                f" Clipped as well it would need {tuning.clipped_needed:.4g}; both lack "
                f"{tuning.clipped_short:.4g}."
            )
        return (
            "passive by tuning for any hand and environment as long as it is not clipped: sampled, "
            f"with delays, it needs {tuning.needed:.4g} {unit} of each device if both have equal "
            f"damping, and they have {-tuning.short:.4g} to spare.{more}"
        )
    needed, short = tuning.needed, tuning.short
    if math.isinf(needed):
        needed, short = tuning.clipped_needed, tuning.clipped_short
    if math.isinf(needed):
        return "not passive: no amount of device damping suffices at low frequencies."
    apart = (
        "with a hand and an environment that do not touch each other it is still stable."
        if tuning.short_apart <= 0.0
        else "even for a hand and an environment that do not touch each other both lack "
        f"{tuning.short_apart:.4g}."
    )
    if math.isinf(tuning.short_apart):
        apart = "nothing more is proved for commands that act after a fraction of a period."
    at = f", worst at {tuning.at:.3g} Hz" if math.isfinite(tuning.needed) else ""
    return (
        f"not passive: sampled, with delays, it would need {needed:.4g} {unit} of each "
        f"device{at}; both lack {short:.4g}; {apart}"
    )
