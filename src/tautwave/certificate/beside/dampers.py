"""Verdicts on dampers in the motors of devices; see `analysis.walls.in_motor`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.analysis.walls.passivity import wall_leak
from tautwave.certificate.data import Element, Verdict
from tautwave.certificate.walls import damping_at, sampled_wall
from tautwave.config import Rig, axis_damper, local_wall
from tautwave.rig import at_axis_rate, axis_allowance, damper_reach
from tautwave.types import CommandDelay, Damper


def damper_elements(rig: Rig, delays: Mapping[str, CommandDelay]) -> Iterator[Element]:
    """Yield the verdict on each damper in a motor."""
    for name in rig.own_axes:
        damper = axis_damper(rig, name)
        if damper is not None:
            yield _damper(at_axis_rate(rig, name), name, delays[name], damper)


def _damper(rig: Rig, axis_name: str, delay: CommandDelay, damper: Damper) -> Element:
    axis, has = rig.axes[axis_name], axis_allowance(rig, axis_name, delay)
    name = f"damper in the motor of {axis_name}"
    rotary = axis.kind == "rotary"
    unit, stiff, effort = ("N m s/rad", "N m/rad", "N m") if rotary else ("N s/m", "N/m", "N")
    alone = has.damping - has.compensated_damping
    numbers = {
        "damping": damper.damping,
        "filter_s": damper.filter_s,
        "loop_s": damper.loop_s,
        "needed_damping": has.damper_damping,
        "damping_margin": alone - has.damper_damping,
        "bias": damper.bias,
    }
    behind = (
        f"its velocity behind {1e3 * damper.filter_s:.3g} ms and a loop of "
        f"{1e6 * damper.loop_s:.3g} us"
    )
    if has.damper_damping >= alone:
        sentence = (
            f"the {name}: {damper.damping:.4g} {unit}, {behind}, takes {has.damper_damping:.3g} "
            f"{unit} of the device's damping at high frequencies, but damping.lower leaves "
            f"{max(alone, 0.0):.3g}; lower its damping to "
            f"{0.9 * damper.damping * max(alone, 0.0) / has.damper_damping:.2g}"
        )
        failed = Verdict(False, sentence, margin=alone - has.damper_damping)
        return Element(name, "damper", axis_name, failed, failed, numbers, (sentence,))
    sentence = (
        f"The {name}, {damper.damping:.4g} {unit}, {behind}, takes {has.damper_damping:.3g} {unit} "
        "of the device's damping at high frequencies, whatever the hand."
    )
    if damper.commanded:
        reach, fast = damper_reach(rig, axis_name, damper, delay), has.velocity
        numbers["reach"] = reach
        numbers["approach_j"] = 0.5 * damper.damping * damper.filter_s * fast * fast
        place = "rad" if rotary else "m"
        sentence += (
            f" It is sent from {reach:.3g} {place} before the wall on, and in stops. As its filter "
            f"lags, each approach may give up to {numbers['approach_j']:.2g} J."
        )
    damping, needed = has.sampled_damping, 0.0
    wall = local_wall(rig, axis_name)
    if wall is not None:
        sampled = sampled_wall(rig, axis_name, wall, delay)
        damping, needed = damping_at(rig, axis_name, delay, sampled), wall_leak(sampled).damping
        sentence += f" It gives the wall {damping:.3g} {unit} instead of {alone:.3g}."
        without = greatest_stiffness(sampled, max(alone, 0.0))
        numbers["stiffness_without"] = without
        sentence += (
            f" A motor that reports an error, or that nothing is heard from, gives no effort at "
            f"all: a wall on it is gone, and nothing is given. One that lost its damper alone "
            f"would bear {without:.4g} {stiff}; where it derates itself below "
            f"{has.effort:.3g} {effort} and its damper's effort together, this does not "
            "hold."
        )
    numbers["wall_damping"] = damping
    margin = damping - needed - has.load_damping
    if margin > 0.0:
        power = damper.bias**2 / (4.0 * margin)
        numbers["bias_w"] = power
        sentence += (
            f" The steps of its velocity and effort push with up to {damper.bias:.2g} {effort} at "
            f"rest, and may give up to {power:.2g} W."
        )
    conditions = (damper.assumed,) if damper.assumed else ()
    verdict = Verdict(True, sentence, conditions, alone - has.damper_damping)
    return Element(name, "damper", axis_name, verdict, verdict, numbers, (sentence,))
