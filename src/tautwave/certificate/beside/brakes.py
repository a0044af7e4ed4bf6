"""Verdicts on brakes: what holds an axis at rest, and what it may supply; see `laws.rest.brake`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.certificate.data import Element, Verdict
from tautwave.config import Rig
from tautwave.laws.rest.brake import SHARE
from tautwave.rig.operated.brakes import brake_params, braked_axes
from tautwave.types import CommandDelay


def brake_elements(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the verdict on each axis' brake.

    Walls take no part, nor does compensated friction: neither acts at rest.
    """
    for name in braked_axes(rig):
        if name in rig.own_axes:
            yield _brake(rig, name, delays[name])


def _brake(rig: Rig, axis_name: str, delay: CommandDelay) -> Element:
    name = f"brake of {axis_name}"
    p = brake_params(rig, axis_name, delay)
    if p is None:
        verdict = Verdict(
            False,
            f"the {name}: its load's compensation leaves no damping for it; raise rate_hz, or "
            "remove hold_effort_share",
        )
        return Element(name, "brake", axis_name, verdict, verdict, {}, (verdict.reason,))
    rotary = rig.axes[axis_name].kind == "rotary"
    effort, damping = ("N m", "N m s/rad") if rotary else ("N", "N s/m")
    unit = "rad" if rotary else "m"
    used = 2.0 * SHARE * p.device
    greatest = p.stiffness * p.slip
    sentence = (
        f"Held, {axis_name} resists being moved with up to {greatest:.3g} {effort}, at "
        f"{p.stiffness:.3g} {effort}/{unit}, and slips beyond that; this uses {used:.3g} {damping} "
        f"of the device's damping. Beyond what the device itself dissipates, a hold may supply up "
        f"to {p.capital:.3g} J and {p.power:.2g} W, and {p.reserve:.3g} J more if the host stalls "
        f"once for up to {rig.overrun_limit} cycles."
    )
    numbers = {
        "stiffness": p.stiffness,
        "greatest_effort": greatest,
        "needed_damping": used,
        "hold_j": p.capital,
        "hold_w": p.power,
        "stalled_j": p.reserve,
    }
    verdict = Verdict(True, sentence, margin=p.device - used)
    return Element(name, "brake", axis_name, verdict, verdict, numbers, (sentence,))
