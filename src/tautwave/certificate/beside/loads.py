"""Verdicts on loads: what carrying one takes of a device's damping, what not carrying it costs.

An effort that holds a load with slope h half-way through a period of length T, predicted over the
command delay of d periods from the last stride, is wrong by at most h (|q'| / 2 + the strides that
it predicts and those that it predicts them from). Over a run that gives out at most
h (1 + 2 d) sum q'^2, by a b <= (a^2 + b^2) / 2 term by term, and the device's damping b takes
b / T sum q'^2 (its mean speed in a period is q'/T). For several joints h is a row sum of the
potential's second derivatives. Held as it is at the sample, without a prediction, a load would take
half of that and lag by half a period. One that is believed wrongly has a potential of its own.
"""

from __future__ import annotations

from collections.abc import Mapping

from tautwave.certificate.data import Element, Verdict
from tautwave.config import Rig
from tautwave.rig import axis_allowance
from tautwave.rig.arms import (
    felt_axes,
    greatest_loads,
    load_reserves,
    load_stiffnesses,
)
from tautwave.rig.rates import load_offset
from tautwave.types import CommandDelay


def load_element(rig: Rig, axis_name: str, delays: Mapping[str, CommandDelay]) -> Element | None:
    """Return the verdict on an axis' load, None without one.

    Parameters
    ----------
    rig : Rig
        A checked rig.
    axis_name : str
        Full name.
    delays : mapping
        Command delay by axis.
    """
    side = axis_name.partition(".")[0]
    if axis_name in load_reserves(rig):
        return _carried(rig, axis_name, delays)
    most = greatest_loads(rig, side).get(axis_name)
    return None if most is None else _borne(rig, axis_name, delays, most)


def _carried(rig: Rig, axis_name: str, delays: Mapping[str, CommandDelay]) -> Element:
    from tautwave.rig.carrying import felt_swing, payload_swing  # loads what runs them

    axis, delay = rig.axes[axis_name], delays[axis_name]
    rotary = axis.kind == "rotary"
    unit, stiff = ("N m s/rad", "N m/rad") if rotary else ("N s/m", "N/m")
    effort = "N m" if rotary else "N"
    slope = load_stiffnesses(rig, axis_name.partition(".")[0])[axis_name]
    has = axis_allowance(rig, axis_name, delay)
    needed, left = has.load_damping, has.loaded_damping
    friction = has.load_coulomb
    numbers = {
        "load_stiffness": slope,
        "needed_damping": needed,
        "damping_margin": left - needed,
        "needed_coulomb": friction,
    }
    felt = felt_axes(rig).get(axis_name)
    what = f", including the weight of {felt} rendered to the hand," if felt else ""
    sentence = (
        f"The load of {axis_name}{what} is compensated at the middle of each period; its slope is "
        f"at most {slope:.3g} {stiff}, which uses {needed:.3g} {unit} of the device's damping."
    )
    if has.load_lent > 0.0:
        sentence += f" The damper in its motor pays {has.load_lent:.3g} of that."
    if axis_name == next(iter(felt_axes(rig)), None) and (swing := felt_swing(rig)) > 0.0:
        numbers["engage_j"] = swing
        sentence += (
            f" Each engagement, and each end of one, may supply up to {swing:.3g} J to the hand "
            "while that weight is ramped in or out."
        )
    arm = rig.arm_of(axis_name)
    if arm is not None and axis_name == arm.axes[0] and (swing := payload_swing(rig, arm)) > 0.0:
        numbers["payload_j"] = swing
        sentence += (
            f" Each payload change may supply up to {swing:.3g} J more over the range if the "
            "tip does not actually hold it."
        )
    passive = Verdict(True, sentence, margin=left - needed)
    if needed > left:
        spent = {"a wall": has.wall_damping, "compensation": has.compensated_damping}
        used = " and ".join(f"{who} uses {much:.3g}" for who, much in spent.items() if much > 0.0)
        wall = f", of which {used}" if used else ""
        passive = Verdict(
            False,
            f"the load of {axis_name}: compensating for it takes {needed:.3g} {unit} of damping, "
            f"but damping.lower is {has.damping:.3g}{wall}; raise rate_hz to "
            f"{rig.rate_hz * needed / left:.4g}"
            if left > 0.0
            else f"the load of {axis_name}: compensating for it takes {needed:.3g} {unit} of "
            "damping, and none is left; give the device's damping.lower",
            margin=left - needed,
        )
    quantised = passive
    if passive.passed and friction > has.loaded_coulomb:
        compensated = has.coulomb - has.loaded_coulomb
        of = f", of which compensation uses {compensated:.3g}" if compensated > 0.0 else ""
        quantised = Verdict(
            False,
            f"the load of {axis_name}: with encoder steps, compensating for it takes "
            f"{friction:.3g} {effort} of Coulomb friction, but coulomb.lower is "
            f"{has.coulomb:.3g}{of}",
        )
    return Element(
        f"load of {axis_name}", "load", axis_name, passive, quantised, numbers, (sentence,)
    )


def _borne(rig: Rig, axis_name: str, delays: Mapping[str, CommandDelay], most: float) -> Element:
    """Return the verdict on a load that the coupling carries."""
    axis = rig.axes[axis_name]
    rotary = axis.kind == "rotary"
    unit, place = ("N m", "rad") if rotary else ("N", "m")
    each = load_offset(rig, axis_name, delays)
    low, high = axis.position_range or (float("-inf"), float("inf"))
    sentence = (
        f"The load of {axis_name}, up to {most:.3g} {unit}, is carried by the coupling, which "
        f"causes an offset of up to {each * most:.3g} {place} in the pair."
    )
    verdict = Verdict(True, sentence)
    if each * most > high - low:
        verdict = Verdict(
            False,
            f"the load of {axis_name}, up to {most:.3g} {unit}, causes an offset of up to "
            f"{each * most:.3g} {place} in its pair, more than its range of {high - low:.3g}; "
            "compensate for it (compensate: true)",
        )
    numbers = {"greatest_load": most, "offset_per_effort": each, "offset": each * most}
    return Element(
        f"load of {axis_name}", "load", axis_name, verdict, verdict, numbers, (sentence,)
    )
