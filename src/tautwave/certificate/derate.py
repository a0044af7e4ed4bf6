"""`derate: true` on a wall: replace it by the stiffest one that the required verdict certifies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from tautwave.analysis.walls.limits import TIGHT, greatest_stiffness, is_passive
from tautwave.analysis.walls.rules import quantum_force
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.certificate.loops import pair_loop
from tautwave.certificate.walls import damping_at, sampled_wall
from tautwave.config import Axis, Rig, Wall, local_wall, replace_wall
from tautwave.rig import at_axis_rate, coupling_part
from tautwave.types import CommandDelay

DIGITS = 6
"""Digits to which a derated stiffness is rounded, downwards."""

BISECTIONS = 24

PORT_SHARE = 0.05
"""Share of the device's damping that a derated wall leaves to its wave port, which needs some."""

Delays = Mapping[str, CommandDelay]


def derate_walls(
    rig: Rig, delays: Delays, coulomb: Mapping[str, float]
) -> tuple[Rig, dict[str, dict[str, Any]]]:
    """Return the rig with derated walls, and requested and rendered stiffness by axis.

    A wall that passes at no stiffness is left unchanged, and fails.
    """
    walls: dict[str, dict[str, Any]] = {}
    for axis_name in rig.axes:
        wall = local_wall(rig, axis_name)
        if wall is None:
            continue
        rendered = wall.stiffness
        if wall.derate and rig.axes[axis_name].causality == "impedance":
            limit = _limit(rig, axis_name, wall, delays, coulomb)
            if 0.0 < limit < wall.stiffness:
                rendered = _round_down(limit)
                rig = replace_wall(rig, axis_name, wall.model_copy(update={"stiffness": rendered}))
        walls[axis_name] = {
            "asked_stiffness": wall.stiffness,
            "rendered_stiffness": rendered,
            "derate": wall.derate,
        }
    return rig, walls


def _limit(
    rig: Rig, axis_name: str, wall: Wall, delays: Delays, coulomb: Mapping[str, float]
) -> float:
    """Return the greatest stiffness that the required verdict allows; `wall`'s own if it passes."""
    if rig.require == "coupled_stable":
        return _stable_limit(rig, axis_name, wall, delays)
    sampled = sampled_wall(at_axis_rate(rig, axis_name), axis_name, wall, delays[axis_name])
    axis = rig.axes[axis_name]
    share = 1.0 - PORT_SHARE if coupling_part(rig).carries == "waves" else 1.0
    controlled = wall.passivity_control and sampled.delay == 0.0
    limit = wall.stiffness
    for _ in range(1 if controlled else BISECTIONS):
        # What a damper in the motor does for a wall depends on the wall.
        at = sampled._replace(stiffness=limit)
        damping = damping_at(at_axis_rate(rig, axis_name), axis_name, delays[axis_name], at)
        if controlled or limit == 0.0 or is_passive(at, share * damping):
            break
        limit = min(limit, greatest_stiffness(at, share * damping))
    if rig.require == "passive_quantised":
        friction = coulomb.get(axis_name, 0.0)
        limit = min(limit, _quantised_limit(sampled, axis, friction))
    return limit


def _quantised_limit(sampled: SampledWall, axis: Axis, friction: float) -> float:
    """Return the greatest K with K Q / 2 + q + B' (Q + 2 q / K) <= c; 0 if there is none.

    Q is the encoder's step, q the effort's, B' the effort of the wall's damper per step, c the
    Coulomb friction: `walls.wall_verdict`'s condition.
    """
    step, cut = axis.encoder_quantum, axis.effort_quantum
    damper = quantum_force(sampled._replace(stiffness=0.0), 1.0)
    spare, beside = friction - cut - damper * step, 2.0 * damper * cut
    if step == 0.0:
        return math.inf if cut == 0.0 or spare > 0.0 else 0.0
    root = spare * spare - 2.0 * step * beside
    return (spare + math.sqrt(root)) / step if spare > 0.0 and root >= 0.0 else 0.0


def _stable_limit(rig: Rig, axis_name: str, wall: Wall, delays: Delays) -> float:
    """Return the greatest stiffness below the wall's at which the pair is stable; 0: none found."""
    pair = axis_name.split(".")[1]

    def stable(stiffness: float) -> bool:
        changed = wall.model_copy(update={"stiffness": stiffness})
        return pair_loop(replace_wall(rig, axis_name, changed), pair, delays).verdict.passed

    if wall.passivity_control or stable(wall.stiffness):
        return wall.stiffness
    low, high = 1e-6 * wall.stiffness, wall.stiffness
    if not stable(low):
        return 0.0
    for _ in range(BISECTIONS):
        middle = math.sqrt(low * high)
        if stable(middle):
            low = middle
        else:
            high = middle
    return low


def _round_down(value: float) -> float:
    step = 10.0 ** (math.floor(math.log10(value)) + 1 - DIGITS)
    # 3.9999999999 is 4: the verdict allows for that much rounding.
    return float(f"{math.floor(value / step * (1.0 + TIGHT)) * step:.{DIGITS}g}")
