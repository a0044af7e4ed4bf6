"""The verdict on a law of positions by its tuning, as a sentence."""

from __future__ import annotations

import math
from collections.abc import Mapping

from tautwave.certificate.belief import SIDES, assumed, broken_damping
from tautwave.certificate.data import Element, Verdict
from tautwave.certificate.tuning.limits import too_long, unlike_ends
from tautwave.certificate.tuning.two_port import Tuning, tuning
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]


def tuned_element(rig: Rig, pair: str, delays: Delays, remedy: str) -> Element:
    """Return the coupling of a pair as an element; `remedy` ends the sentence of one that fails."""
    head = f"coupling of {pair}"
    why = too_long(rig)
    found = tuning(rig, pair, delays) if why is None else None
    if found is None:
        if why is None:
            why = (
                "commands act after a fractional period, or its law does not come to rest, or it "
                "reads an effort sensor"
            )
        if rig.link is not None:
            why = "over a network its delay is not known"
        verdict = Verdict(False, f"{head}: not evaluated: {why}. {remedy}")
        return Element(head, "coupling", pair, verdict, verdict, {}, (verdict.reason,))
    names = [f"{side}.{pair}" for side in SIDES]
    numbers = {
        **found._asdict(),
        "damping": [axis_allowance(rig, name, delays[name]).free_damping for name in names],
    }
    text = f"{head}: {tuning_sentence(rig, pair, found)}"
    broken = [said for name in names if (said := broken_damping(rig, name)) is not None]
    if broken:
        verdict = Verdict(False, f"{head}: {broken[0]}", margin=-found.short)
    elif found.short > 0.0:
        verdict = Verdict(False, f"{text} {remedy}", margin=-found.short)
    elif (unlike := unlike_ends(rig, pair)) is not None:
        verdict = Verdict(False, f"{head}: not passive: {unlike}.", margin=-found.short)
    else:
        conditions = [
            said for name in names for said in assumed(rig.axes[name], name, damping=True)
        ]
        conditions += [
            f"the effort_rate_limit of {name} is not reached in the coupling"
            for name in names
            if rig.axes[name].effort_rate_limit is not None
        ]
        numbers["holds"] = "by tuning"
        verdict = Verdict(True, text, tuple(conditions), -found.short)
    quantised = verdict
    if verdict.passed and any(rig.axes[name].encoder_quantum for name in names):
        quantised = Verdict(
            False, f"{head}: no proof covers its limit cycles caused by encoder steps."
        )
    return Element(head, "coupling", pair, verdict, quantised, numbers, (verdict.reason,))


def tuning_sentence(rig: Rig, pair: str, found: Tuning) -> str:
    """Return what a law needs and what its devices have, as a sentence."""
    unit = "N m s/rad" if rig.master.axes[pair].kind == "rotary" else "N s/m"
    if found.short <= 0.0:
        return (
            "passive by tuning for any hand and environment: sampled, with delays, it needs "
            f"{found.needed:.4g} {unit} of each device if both have equal damping, and they have "
            f"{-found.short:.4g} to spare."
        )
    if math.isinf(found.needed):
        return "not passive: no amount of device damping suffices at low frequencies."
    apart = (
        "with a hand and an environment that do not touch each other it is still stable."
        if found.short_apart <= 0.0
        else f"even for a hand and an environment that do not touch each other both lack "
        f"{found.short_apart:.4g}."
    )
    return (
        f"not passive: sampled, with delays, it would need {found.needed:.4g} {unit} of each "
        f"device, worst at {found.at:.3g} Hz; both lack {found.short:.4g}; {apart}"
    )
