"""A slow bus in the certificate: its converters are passive, and its cost is stated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.certificate.data import Element, Verdict
from tautwave.certificate.walls import sampled_wall
from tautwave.config import Rig, Wall, local_wall
from tautwave.rig import (
    at_axis_rate,
    at_full_rate,
    axis_allowance,
    command_delays,
    one_way_delay,
    standing_offset,
)
from tautwave.types import CommandDelay

Delays = Mapping[str, CommandDelay]

PLAIN = Wall(position=0.0, stiffness=1.0)
"""A spring, in place of a wall on an axis without one."""


def converter_element(rig: Rig, axis_name: str, delays: Delays) -> Element | None:
    """Return the rate converter of an axis and what its slow bus costs; None on a fast bus."""
    divisor = rig.axis_divisor(axis_name)
    if divisor == 1:
        return None
    name = f"rate converter of {axis_name}"
    numbers = slow_costs(rig, axis_name, delays)
    reason = (
        f"{name}: the mean of {divisor} waves dissipates their varying part, a wave held for "
        f"{divisor} slots keeps its energy, and both keep the wave integral (Cauchy and Schwarz)."
    )
    verdict = Verdict(True, reason)
    sentences = (reason, _cost(rig, axis_name, divisor, numbers))
    return Element(name, "converter", axis_name, verdict, verdict, numbers, sentences)


def slow_costs(rig: Rig, axis_name: str, delays: Delays) -> dict[str, Any]:
    """Return the performance of an axis at its own rate, and at the rig's rate.

    delay_s: total one-way delay of its pair [s]; wall_stiffness: the stiffest passive local wall on
    it, None without device damping or on an admittance axis; rigid_stiffness: felt at the master in
    front of a rigid environment, at rest: effort per steady-state offset.
    """
    pair = axis_name.partition(".")[2]
    full = at_full_rate(rig)
    prompt = command_delays(full)
    taus = one_way_delay(rig, pair, delays), one_way_delay(full, pair, prompt)
    offsets = standing_offset(rig, pair, delays), standing_offset(full, pair, prompt)
    walls = None
    damping = axis_allowance(rig, axis_name, delays[axis_name]).sampled_damping
    if rig.axes[axis_name].causality == "impedance" and damping > 0.0:
        wall = local_wall(rig, axis_name) or PLAIN
        walls = tuple(
            greatest_stiffness(sampled_wall(seen, axis_name, wall, delay), damping)
            for seen, delay in (
                (at_axis_rate(rig, axis_name), delays[axis_name]),
                (full, prompt[axis_name]),
            )
        )
    return {
        "divisor": rig.axis_divisor(axis_name),
        "rate_hz": 1.0 / rig.axis_period_s(axis_name),
        "delay_s": taus,
        "wall_stiffness": walls,
        "rigid_stiffness": tuple(1.0 / offset for offset in offsets),
    }


def _cost(rig: Rig, axis_name: str, divisor: int, numbers: Mapping[str, Any]) -> str:
    pair = axis_name.partition(".")[2]
    slow, fast = numbers["delay_s"]
    rigid, rigid_fast = numbers["rigid_stiffness"]
    text = (
        f"{axis_name} is served every {divisor} cycles, at {numbers['rate_hz']:.4g} Hz. The cost, "
        f"with values at {rig.rate_hz:.4g} Hz in brackets: one-way delay "
        f"{1e3 * slow:.4g} ms ({1e3 * fast:.4g}); a rigid environment feels like {rigid:.4g} "
        f"{_unit(rig, f'master.{pair}')} at the master ({rigid_fast:.4g})"
    )
    if numbers["wall_stiffness"] is None:
        return f"{text}."
    wall, wall_fast = numbers["wall_stiffness"]
    return (
        f"{text}; the stiffest passive wall on {axis_name} has {wall:.4g} "
        f"{_unit(rig, axis_name)} ({wall_fast:.4g})."
    )


def _unit(rig: Rig, axis_name: str) -> str:
    return "N m/rad" if rig.axes[axis_name].kind == "rotary" else "N/m"
