"""What carries the loads of a rig's sides, and what a change of it may give out; SI units."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

from tautwave.config import Rig
from tautwave.config.keys.arm import Chain, SideArm
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.load import load_effort, load_energy
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.arms import (
    MARGIN,
    SAMPLES,
    arm_chain,
    each_payload,
    felt_arms,
    felt_axes,
    felt_ranges,
    joint_ranges,
    load_groups,
    load_params,
    own_carried,
    postures,
    with_payloads,
)
from tautwave.rig.scales import pair_scale, slave_offset
from tautwave.runtime.carrying.felt import FeltLoad, FeltPlace, Weighing
from tautwave.runtime.carrying.side import CarriedAxis, SideLoad
from tautwave.types import CommandDelay

STILL_SHARE = 0.02
"""Of its velocity limit below which an axis stands, so that another payload may be taken up."""

TAKEN_UP_S = 0.5
"""How long another payload takes, and what the hand feels to rise or fall."""

UNDONE_S = 0.05
"""How long it takes to undo one: a wrong payload drives the arm until then."""


def side_loads(
    rig: Rig, delays: Mapping[str, CommandDelay]
) -> tuple[list[SideLoad], dict[str, tuple[SideLoad, int]]]:
    """Return what carries the loads of each side, and the seat of each axis in it."""
    sides: list[SideLoad] = []
    seats: dict[str, tuple[SideLoad, int]] = {}
    groups = [one for side in ("master", "slave") for one in load_groups(rig, side).items()]
    for group, names in groups:
        if names[0] not in delays:  # of two sites each carries its own
            continue
        axes = []
        for name in names:
            delay, allowance = delays[name], axis_allowance(rig, name, delays[name])
            late = delay.remainder_s / rig.period_s
            still = STILL_SHARE * allowance.velocity * rig.period_s
            axes.append(
                CarriedAxis(
                    name,
                    allowance.load_effort,
                    allowance.load_step,
                    allowance.quantum,
                    delay.periods,
                    late,
                    still,
                )
            )
        arm = rig.arm_of(names[0])
        others = {} if arm is None else with_payloads(arm.keys)
        slowest = _slowest(rig, arm, axes)
        sides.append(
            SideLoad(
                group, axes, _weighing(rig, names),
                {payload: _chain_weighing(one) for payload, one in others.items()},
                max(1, round(TAKEN_UP_S * rig.rate_hz), slowest),
                max(1, round(UNDONE_S * rig.rate_hz), slowest),
                _felt_load(rig, names, axes) if names[0].startswith("master.") else None,
            )
        )  # fmt: skip
        seats.update({name: (sides[-1], which) for which, name in enumerate(names)})
    return sides, seats


def _weighing(rig: Rig, names: Sequence[str]) -> Weighing:
    """Return what weighs the own loads of some of a side's axes, which carry something."""
    ours = [name for name in own_carried(rig, names[0].partition(".")[0]) if name in names]
    own = _own_weighing(rig, ours)
    if names == ours:
        return own
    seats = [names.index(name) for name in ours]

    def weigh(x: Sequence[float]) -> tuple[list[float], float]:
        held = [0.0] * len(names)
        efforts, potential = own([x[at] for at in seats])
        for at, effort in zip(seats, efforts, strict=True):
            held[at] = effort
        return held, potential

    return weigh


def _felt_load(rig: Rig, names: Sequence[str], axes: Sequence[CarriedAxis] = ()) -> FeltLoad | None:
    """Return what the hand feels of the slave's loads at some of its axes, None if nothing."""
    felt = {master: slave for master, slave in felt_axes(rig).items() if master in names}
    if not felt:
        return None
    own, powers, places = own_carried(rig, "slave"), [], []
    weighed = [name for name in own if name in felt.values() or rig.arm_of(name) is None]
    for slave in weighed:  # in the order in which they are weighed
        master = slave.replace("slave", "master", 1)
        name = slave.partition(".")[2]
        pair = rig.coupling.pairs[name]
        scale, (offset, _) = pair_scale(pair), slave_offset(pair)
        at = -1
        if master in felt:
            at = names.index(master)
            powers.append(scale.power)
        places.append(FeltPlace(name, at, scale.sign * scale.scale, offset or 0.0))
    slowest = max((math.ceil(axis.reserve / axis.step) for axis in axes), default=1)
    ramp = max(1, round(TAKEN_UP_S * rig.rate_hz), slowest)
    weigh, level = _own_weighing(rig, weighed), 0.0
    if rig.operate is not None:  # in the middle: there a ramp puts nothing in, wherever the zero is
        ranges = felt_ranges(rig)
        middle = (0.5 * sum(ranges.get(name, (0.0, 0.0))) for name in weighed)
        level = weigh(list(middle))[1]
    return FeltLoad(weigh, places, powers[0], ramp, coupled=rig.operate is None, level=level)


def _own_weighing(rig: Rig, names: Sequence[str]) -> Weighing:
    """Return what weighs the own loads of some of a side's axes: whole arms, or none."""
    arms = {arm.name: arm for name in names if (arm := rig.arm_of(name)) is not None}
    if not arms:
        keys = [rig.axes[name].load for name in names]
        loads = [load_params(load) for load in keys if load is not None]
        return lambda x: (
            [-load_effort(p, at) for p, at in zip(loads, x, strict=True)],
            sum(load_energy(p, at) for p, at in zip(loads, x, strict=True)),
        )
    each = [(_chain_weighing(arm.keys), len(arm.axes)) for arm in arms.values()]
    if len(each) == 1:
        return each[0][0]

    def weigh(x: Sequence[float]) -> tuple[list[float], float]:
        held: list[float] = []
        height = 0.0
        for one, count in each:
            efforts, potential = one(x[len(held) : len(held) + count])
            held += efforts
            height += potential
        return held, height

    return weigh


def _chain_weighing(keys: Chain) -> Weighing:
    chain = arm_chain(keys)

    def weigh(x: Sequence[float]) -> tuple[list[float], float]:
        held = [0.0] * len(x)
        return held, chain_gravity(chain, chain_frames(chain, x), held)

    return weigh


def payload_swing(rig: Rig, arm: SideArm) -> float:
    """Return the most that taking up one payload may give out [J], sampled; 0 without any.

    That is how far, over the range, the potentials with two payloads are apart.
    """
    return MARGIN * max((swing for _, swing in _changes(rig, arm)), default=0.0)


def _slowest(rig: Rig, arm: SideArm | None, axes: Sequence[CarriedAxis]) -> int:
    """Return the periods that a change of payload takes at least: no effort outruns its rate."""
    shares = [
        effort / axis.step
        for efforts, _ in _changes(rig, arm)
        for effort, axis in zip(efforts, axes, strict=True)
    ]
    return math.ceil(MARGIN * max(shares, default=0.0))


def _changes(rig: Rig, arm: SideArm | None) -> Iterator[tuple[list[float], float]]:
    """Yield, for each pair of payloads, how far apart their efforts and potentials are.

    Efforts by axis [N m or N], potentials as a swing [J]: over the range, sampled.
    """
    if arm is None or not arm.keys.payloads:
        return
    weigh = [_chain_weighing(one) for one in each_payload(arm.keys)]
    weights = [[one(q) for one in weigh] for q in postures(joint_ranges(rig, arm))]
    for one, other in itertools.combinations(range(len(weigh)), 2):
        most = [0.0] * len(weights[0][one][0])
        for row in weights:
            both = zip(most, row[one][0], row[other][0], strict=True)
            most = [max(so_far, abs(a - b)) for so_far, a, b in both]
        gaps = [row[one][1] - row[other][1] for row in weights]
        yield most, max(gaps) - min(gaps)


def felt_swing(rig: Rig) -> float:
    """Return the most that one beginning or end of a coupling may give out at the master [J].

    That is how far the slave's potential, as the hand feels it, is apart over the places that the
    master may stand for, sampled; 0 where it is felt all along, or not at all.
    """
    felt = _felt_load(rig, list(felt_axes(rig)))
    if felt is None or not felt.lets_go:
        return 0.0
    ranges = felt_ranges(rig)
    energy = 0.0
    for arm in felt_arms(rig):
        weigh = _chain_weighing(arm.keys)
        heights = [weigh(q)[1] for q in postures([ranges[name] for name in arm.axes])]
        energy += max(heights) - min(heights)
    for name, (low, high) in ranges.items():
        load = rig.axes[name].load
        if load is None:
            continue
        places = [low + (high - low) * k / SAMPLES for k in range(SAMPLES + 1)]
        heights = [load_energy(load_params(load), x) for x in places]
        energy += max(heights) - min(heights)
    return MARGIN * energy / felt.power
