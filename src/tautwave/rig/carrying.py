"""What carries the loads of a rig's sides, and what a change of it may give out; SI units."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence

from tautwave.config import Rig
from tautwave.config.keys.arm import Chain
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.load import load_effort, load_energy
from tautwave.rig.allowance.filling import axis_allowance
from tautwave.rig.arms import (
    MARGIN,
    SAMPLES,
    arm_chain,
    carried_axes,
    each_payload,
    felt_axes,
    felt_ranges,
    joint_ranges,
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
    for side in ("master", "slave"):
        names = carried_axes(rig, side)
        if not names or names[0] not in delays:  # of two sites each carries its own
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
        arm = getattr(rig, side).arm
        others = {} if arm is None else with_payloads(arm)
        slowest = _slowest(rig, side, axes)
        sides.append(
            SideLoad(
                side, axes, _weighing(rig, side),
                {payload: _chain_weighing(one) for payload, one in others.items()},
                max(1, round(TAKEN_UP_S * rig.rate_hz), slowest),
                max(1, round(UNDONE_S * rig.rate_hz), slowest),
                _felt_load(rig, axes) if side == "master" else None,
            )
        )  # fmt: skip
        seats.update({name: (sides[-1], which) for which, name in enumerate(names)})
    return sides, seats


def _weighing(rig: Rig, side: str) -> Weighing:
    """Return what weighs a side's own loads, among all axes that carry something."""
    names = carried_axes(rig, side)
    ours = own_carried(rig, side)
    own = _own_weighing(rig, side)
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


def _felt_load(rig: Rig, axes: Sequence[CarriedAxis] = ()) -> FeltLoad | None:
    """Return what the hand feels of the slave's loads, None if nothing."""
    felt = felt_axes(rig)
    if not felt:
        return None
    names, powers, places = carried_axes(rig, "master"), [], []
    for slave in own_carried(rig, "slave"):  # in the order in which they are weighed
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
    weigh, level = _own_weighing(rig, "slave"), 0.0
    if rig.operate is not None:  # in the middle: there a ramp puts nothing in, wherever the zero is
        ranges = felt_ranges(rig)
        middle = (0.5 * sum(ranges.get(name, (0.0, 0.0))) for name in own_carried(rig, "slave"))
        level = weigh(list(middle))[1]
    return FeltLoad(weigh, places, powers[0], ramp, coupled=rig.operate is None, level=level)


def _own_weighing(rig: Rig, side: str) -> Weighing:
    """Return what weighs a side's own loads."""
    names = own_carried(rig, side)
    arm = getattr(rig, side).arm
    if arm is None:
        keys = [rig.axes[name].load for name in names]
        loads = [load_params(load) for load in keys if load is not None]
        return lambda x: (
            [-load_effort(p, at) for p, at in zip(loads, x, strict=True)],
            sum(load_energy(p, at) for p, at in zip(loads, x, strict=True)),
        )
    return _chain_weighing(arm)


def _chain_weighing(keys: Chain) -> Weighing:
    chain = arm_chain(keys)

    def weigh(x: Sequence[float]) -> tuple[list[float], float]:
        held = [0.0] * len(x)
        return held, chain_gravity(chain, chain_frames(chain, x), held)

    return weigh


def payload_swing(rig: Rig, side: str) -> float:
    """Return the most that taking up one payload may give out [J], sampled; 0 without any.

    That is how far, over the range, the potentials with two payloads are apart.
    """
    return MARGIN * max((swing for _, swing in _changes(rig, side)), default=0.0)


def _slowest(rig: Rig, side: str, axes: Sequence[CarriedAxis]) -> int:
    """Return the periods that a change of payload takes at least: no effort outruns its rate."""
    shares = [
        effort / axis.step
        for efforts, _ in _changes(rig, side)
        for effort, axis in zip(efforts, axes, strict=True)
    ]
    return math.ceil(MARGIN * max(shares, default=0.0))


def _changes(rig: Rig, side: str) -> Iterator[tuple[list[float], float]]:
    """Yield, for each pair of payloads, how far apart their efforts and potentials are.

    Efforts by axis [N m or N], potentials as a swing [J]: over the range, sampled.
    """
    arm = getattr(rig, side).arm
    if arm is None or not arm.payloads:
        return
    weigh = [_chain_weighing(one) for one in each_payload(arm)]
    weights = [[one(q) for one in weigh] for q in postures(joint_ranges(rig, side, arm))]
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
    felt = _felt_load(rig)
    if felt is None or not felt.lets_go:
        return 0.0
    ranges = felt_ranges(rig)
    if rig.slave.arm is not None:
        weigh = _own_weighing(rig, "slave")
        heights = [weigh(q)[1] for q in postures(list(ranges.values()))]
        return MARGIN * (max(heights) - min(heights)) / felt.power
    energy = 0.0
    for name, (low, high) in ranges.items():
        load = rig.axes[name].load
        places = [low + (high - low) * k / SAMPLES for k in range(SAMPLES + 1)]
        heights = [load_energy(load_params(load), x) for x in places] if load else [0.0]
        energy += max(heights) - min(heights)
    return MARGIN * energy / felt.power
