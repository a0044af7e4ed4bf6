"""Arms of a rig: the chain of a side, what it weighs in the range of its axes; SI units."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache

from tautwave.config import Rig, TrueLoad, axis_damper, local_wall
from tautwave.config.inputs.chains import chain_constants, chain_links
from tautwave.config.keys.arm import Arm, Chain, Payload, SideArm
from tautwave.errors import ConfigError
from tautwave.models.chain.gravity import chain_gravity, gravity_stiffness
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.params import ChainParams
from tautwave.models.load import LoadParams, load_effort, load_stiffness
from tautwave.rig.allowance.once import once_per_rig
from tautwave.types import Damper

MAX_SHARE = 0.8
"""Of an axis' effort limit that its load may take."""

WRONG_UNIT = 30.0
"""Load per effort limit beyond which masses or lengths are taken to be in another unit."""

MARGIN = 1.1
"""What is kept for a load, per greatest one of the sampled postures: it is clipped there."""

ROUNDING = 1e-9

SPARING = 3.0
"""Periods times the slope of a load in any of an arm's joints, beyond whose damping its bounds are
put where there is more: what carrying it takes with commands a period late."""

SAMPLES = 2000
CORNERS = 512


def arm_axes(rig: Rig, side: str) -> list[str]:
    """Return the full names of a side's axes, from base to tip."""
    return [name for name in rig.axes if name.startswith(f"{side}.")]


def joint_names(rig: Rig, side: str) -> dict[str, str]:
    """Return the joint that each axis of a side is, by its full name; {} without an arm."""
    names: dict[str, str] = {}
    for arm in rig.arms(side):
        links, _ = chain_links(arm.keys)
        joints = [link.name for link in links if link.kind != "fixed"]
        names.update(zip(arm.axes, joints, strict=True))
    return names


def bare_chain(keys: Chain, payload: Payload | None) -> Chain:
    """Return the keys of a chain alone, without what else an arm has, and with a payload."""
    own = {name: getattr(keys, name) for name in Chain.model_fields}
    return Chain.model_construct(**{**own, "payload": payload})


def arm_chain(keys: Chain) -> ChainParams:
    """Return the constants of a chain with its payload; its file is read once.

    Raises
    ------
    ConfigError
        The file cannot be read any more.
    """
    return _constants(bare_chain(keys, keys.payload))


@lru_cache(maxsize=16)
def _constants(keys: Chain) -> ChainParams:
    return chain_constants(keys)


def joint_ranges(rig: Rig, arm: SideArm) -> list[tuple[float, float]]:
    """Return where each joint may be [rad or m]: its axis' range, else the file's, else a turn."""
    _, limits = chain_links(arm.keys)
    ranges = []
    for name, limit in zip(arm.axes, limits, strict=True):
        given = rig.axes[name].position_range
        if given is None:
            turn = math.pi if rig.axes[name].kind == "rotary" else 0.0
            given = (
                limit.lower if math.isfinite(limit.lower) else -turn,
                limit.upper if math.isfinite(limit.upper) else turn,
            )
        ranges.append(given)
    return ranges


def beyond_file(rig: Rig, arm: SideArm) -> list[str]:
    """Return a sentence for each limit of an axis that is wider than its joint's in the URDF file.

    Such an axis may be driven into what the file's author keeps it from: an end stop, a gear's or
    a motor's limit.
    """
    if arm.keys.urdf is None:
        return []
    _, limits = chain_links(arm.keys)
    sentences = []
    for name, limit in zip(arm.axes, limits, strict=True):
        axis = rig.axes[name]
        place, effort = ("rad", "N m") if axis.kind == "rotary" else ("m", "N")
        low, high = axis.position_range or (-math.inf, math.inf)
        slack = 1e-3 * min(limit.upper - limit.lower, 1.0)
        if low < limit.lower - slack or high > limit.upper + slack:
            ours = f"position_range [{low:g}, {high:g}]" if axis.position_range else "no range"
            sentences.append(
                f"{name} has {ours}, joint {limit.name} {limit.lower:g} to {limit.upper:g} {place}"
            )
        for key, most, unit in (
            ("effort_limit", limit.effort, effort),
            ("velocity_limit", limit.velocity, f"{place}/s"),
        ):
            value = getattr(axis, key)
            if value is not None and value > 1.001 * most:
                sentences.append(f"{name} has {key} {value:g}, joint {limit.name} {most:g} {unit}")
    return sentences


def postures(ranges: Sequence[tuple[float, float]]) -> Iterator[tuple[float, ...]]:
    """Yield postures within ranges: corners, then a fixed random sample."""
    yield from itertools.islice(itertools.product(*ranges), CORNERS)
    rng = random.Random(0)
    for _ in range(SAMPLES):
        yield tuple(rng.uniform(low, high) for low, high in ranges)


def greatest_loads(rig: Rig, side: str) -> dict[str, float]:
    """Return the greatest effort of a side's loads on each axis [N m or N], sampled.

    What the master feels of the slave's loads counts as its own.
    """
    by_axis: dict[str, float] = {}
    for arm in rig.arms(side):
        ranges = tuple(joint_ranges(rig, arm))
        each = [greatest_weights(one, ranges) for one in each_payload(arm.keys)]
        most = [max(values) for values in zip(*each, strict=True)]
        by_axis.update(zip(arm.axes, most, strict=True))
    for name in arm_axes(rig, side):
        load = rig.axes[name].load
        if load is not None:
            by_axis[name] = greatest_load(load_params(load), rig.axes[name].position_range)
    if side == "master" and felt_axes(rig):
        theirs = _felt_loads(rig)
        for name, slave in felt_axes(rig).items():
            by_axis[name] = by_axis.get(name, 0.0) + theirs[slave] / _force_scale(rig, name)
    return by_axis


def _felt_loads(rig: Rig) -> dict[str, float]:
    """Return the greatest load that the hand may feel [N m or N], by the slave's axis."""
    ranges, alone = felt_ranges(rig), greatest_loads(rig, "slave")
    felt: dict[str, float] = {}
    for arm in felt_arms(rig):
        places = tuple(ranges[name] for name in arm.axes)
        most = greatest_weights(bare_chain(arm.keys, arm.keys.payload), places)
        felt.update({n: max(alone[n], one) for n, one in zip(arm.axes, most, strict=True)})
    for name in ranges:
        load = rig.axes[name].load
        if load is not None:
            felt[name] = greatest_load(load_params(load), ranges[name])
    return felt


def felt_arms(rig: Rig) -> tuple[SideArm, ...]:
    """Return the arms of the slave whose weight the hand may feel."""
    return tuple(a for a in rig.arms("slave") if a.keys.compensate and a.keys.reflect_load)


def felt_ranges(rig: Rig) -> dict[str, tuple[float, float]]:
    """Return the range of places whose load the hand may feel [rad or m], by the slave's axis.

    That is its own range; on an operated rig it is wider by how far the master can move on while
    the weight fades.
    """
    in_arms = {
        name: places
        for arm in felt_arms(rig)
        for name, places in zip(arm.axes, joint_ranges(rig, arm), strict=True)
    }
    by_slave = {}
    for master, slave in felt_axes(rig).items():
        given = rig.axes[slave].position_range or (-math.pi, math.pi)
        low, high = in_arms.get(slave, given)
        if rig.operate is not None:
            turn = math.pi if rig.axes[master].kind == "rotary" else 0.0
            first, last = rig.axes[master].position_range or (-turn, turn)
            more = rig.coupling.pairs[slave.partition(".")[2]].position_scale * (last - first)
            low, high = low - more, high + more
        by_slave[slave] = (low, high)
    return by_slave


def felt_axes(rig: Rig) -> dict[str, str]:
    """Return the master's axes on which the hand feels a load of the slave, with the slave's."""
    arms = {name for arm in felt_arms(rig) for name in arm.axes}
    names = []
    for name in own_carried(rig, "slave"):
        load = rig.axes[name].load
        if name in arms or (load is not None and load.reflect_load):
            names.append(name)
    return {name.replace("slave", "master", 1): name for name in names}


def _force_scale(rig: Rig, master: str) -> float:
    return rig.coupling.pairs[master.partition(".")[2]].effective_force_scale


def with_payloads(arm: Arm) -> dict[str, Chain]:
    """Return an arm's chain with each of the payloads that it may take up."""
    return {name: bare_chain(arm, payload) for name, payload in arm.payloads.items()}


def each_payload(arm: Arm) -> list[Chain]:
    """Return an arm's chain with its payload, then with each that it may take up."""
    return [bare_chain(arm, arm.payload), *with_payloads(arm).values()]


@lru_cache(maxsize=16)
def greatest_weights(keys: Chain, ranges: tuple[tuple[float, float], ...]) -> tuple[float, ...]:
    """Return the greatest effort of a chain's weight on each joint [N m or N], sampled."""
    chain = arm_chain(keys)
    most = [0.0] * len(ranges)
    weight = [0.0] * len(ranges)
    for q in postures(ranges):
        chain_gravity(chain, chain_frames(chain, q), weight)
        most = [max(a, abs(b)) for a, b in zip(most, weight, strict=True)]
    rounding = 1e-9 * max(most)
    return tuple(value if value > rounding else 0.0 for value in most)


def load_params(keys: TrueLoad) -> LoadParams:
    """Return the constants of one axis' load."""
    return LoadParams(keys.constant, keys.cosine, keys.sine)


def carried_axes(rig: Rig, side: str) -> list[str]:
    """Return the axes of a side whose loads are carried, or felt, from base to tip."""
    own = own_carried(rig, side)
    felt = felt_axes(rig) if side == "master" else {}
    return [name for name in arm_axes(rig, side) if name in own or name in felt]


def own_carried(rig: Rig, side: str) -> list[str]:
    """Return the axes of a side whose own loads are carried, from base to tip."""
    arms = {name for arm in rig.arms(side) if arm.keys.compensate for name in arm.axes}
    names = []
    for name in arm_axes(rig, side):
        load = rig.axes[name].load
        if name in arms or (load is not None and load.compensate):
            names.append(name)
    return names


def load_groups(rig: Rig, side: str) -> dict[str, list[str]]:
    """Return the axes of a side whose loads are carried, or felt, together: those of each arm.

    They are by the arm's name, or by the side's where it has none.
    """
    carried = carried_axes(rig, side)
    groups = {arm.name: arm.axes for arm in rig.arms(side)} or {side: tuple(carried)}
    each = {name: [axis for axis in carried if axis in axes] for name, axes in groups.items()}
    return {name: axes for name, axes in each.items() if axes}


def without_carrying(rig: Rig) -> Rig:
    """Return a rig whose axes get no effort for their loads."""
    sides = {}
    for name in ("master", "slave"):
        side = getattr(rig, name)
        axes = {
            key: axis
            if axis.load is None
            else axis.model_copy(
                update={"load": axis.load.model_copy(update={"compensate": False})}
            )
            for key, axis in side.axes.items()
        }
        arm = side.arm and side.arm.model_copy(update={"compensate": False})
        arms = side.arms and {
            name: one.model_copy(update={"compensate": False}) for name, one in side.arms.items()
        }
        sides[name] = side.model_copy(update={"axes": axes, "arm": arm, "arms": arms})
    return rig.model_copy(update=sides)


@once_per_rig
def load_reserves(rig: Rig) -> dict[str, float]:
    """Return of each axis whose load is carried the effort that is kept for it [N m or N].

    Raises
    ------
    ConfigError
        It leaves the coupling too little of an axis' limit.
    """
    reserves = {}
    for side in ("master", "slave"):
        carried = carried_axes(rig, side)
        most = greatest_loads(rig, side) if carried else {}
        for name in carried:
            limit = rig.axes[name].effort_limit
            if most[name] > MAX_SHARE * limit:
                place = name.replace(".", ".axes.")
                raise ConfigError(
                    f"{place}.effort_limit: its load takes up to {most[name]:.3g} of {limit:g}, "
                    f"which leaves too little for the coupling; {_lighter(most[name], limit)}"
                )
            reserves[name] = min(MARGIN * most[name], limit)
    return reserves


def shared_limits(rig: Rig, share: float) -> dict[str, float]:
    """Return effort limits with a share of what the rig's leave beside the loads [N m or N].

    They are not below what `load_reserves` takes.
    """
    reserves, limits = load_reserves(rig), {}
    for name, axis in rig.axes.items():
        load = reserves.get(name, 0.0)
        least = load / (MARGIN * MAX_SHARE) * (1.0 + ROUNDING)
        limits[name] = max(load + share * (axis.effort_limit - load), least)
    return limits


def _lighter(load: float, limit: float) -> str:
    """Say what helps against a load that is too great; one far beyond is in another unit."""
    if load > WRONG_UNIT * limit:
        return "are the masses of its arm in kg, its lengths and origins in m?"
    return (
        f"narrow its position_range, or use a stronger motor ({load / MAX_SHARE:.3g} or more), or "
        "state the base of the arm, where what it stands on is not to move"
    )


@once_per_rig
def load_stiffnesses(rig: Rig, side: str) -> dict[str, float]:
    """Return how fast each carried load changes at most [N m/rad]: bounds, in any posture."""
    loads = {name: rig.axes[name].load for name in own_carried(rig, side)}
    stiffnesses = {name: load_stiffness(load_params(load)) for name, load in loads.items() if load}
    for arm in rig.arms(side):
        if not arm.keys.compensate:
            continue
        bounds = _arm_stiffnesses(
            arm.keys, dict(zip(arm.axes, joint_ranges(rig, arm), strict=True))
        )
        has = tuple(carrying_damping(rig, name) for name in arm.axes)
        asked = SPARING * rig.period_s
        if any(asked * h > one for h, one in zip(bounds.values(), has, strict=True)):
            bounds = _spared_stiffnesses(arm.keys, bounds, has)
        stiffnesses.update(bounds)
    if side == "master" and felt_axes(rig):
        theirs, ranges = dict(load_stiffnesses(rig, "slave")), felt_ranges(rig)
        for arm in felt_arms(rig):
            theirs.update(_arm_stiffnesses(arm.keys, {name: ranges[name] for name in arm.axes}))
        pairs = rig.coupling.pairs
        widest = max(pairs[name.partition(".")[2]].position_scale for name in felt_axes(rig))
        for name, slave in felt_axes(rig).items():
            slope = theirs[slave] * widest / _force_scale(rig, name)
            stiffnesses[name] = stiffnesses.get(name, 0.0) + slope
    return stiffnesses


def _arm_stiffnesses(arm: Arm, ranges: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """Return how fast the load of each axis of an arm changes at most in these ranges."""
    bounds = [0.0] * len(ranges)
    slides = [max(abs(low), abs(high)) for low, high in ranges.values()]
    for one in each_payload(arm):
        slopes = [0.0] * len(ranges)
        gravity_stiffness(arm_chain(one), slides, slopes)
        bounds = [max(a, b) for a, b in zip(bounds, slopes, strict=True)]
    return dict(zip(ranges, bounds, strict=True))


def _spared_stiffnesses(
    arm: Arm, stretched: dict[str, float], has: tuple[float, ...]
) -> dict[str, float]:
    """Return bounds that are put where an arm has damping; the stretched ones where not."""
    # Loaded only where there is too little: most arms need no more than the closed form.
    from tautwave.analysis.carrying import weighed_slopes

    chains = [arm_chain(one) for one in each_payload(arm)]
    if min(has) <= 0.0 or not all(joint.turns for one in chains for joint in one.joints):
        return stretched
    each = [weighed_slopes(one, has) for one in chains]
    return dict(zip(stretched, (max(values) for values in zip(*each, strict=True)), strict=True))


def carries_loads(rig: Rig, axis_name: str, damper: Damper) -> bool:
    """Return whether a damper in a motor is there for loads: always, and no local wall has it."""
    return not damper.commanded and local_wall(rig, axis_name) is None


@once_per_rig
def carrying_damping(rig: Rig, axis_name: str) -> float:
    """Return the damping that an axis has for carrying its load, its own and its motor's.

    A damper in the motor lends what any sampled law finds of it.
    """
    axis = rig.axes[axis_name]
    viscous = 0.0 if axis.compensation is None else axis.compensation.viscous
    alone = (1.0 - viscous) * axis.damping.lower
    damper = axis_damper(rig, axis_name)
    if damper is None or not carries_loads(rig, axis_name, damper):
        return alone
    from tautwave.analysis.walls.in_motor import least_damping

    return max(least_damping(damper, alone, rig.axis_period_s(axis_name)), 0.0)


def greatest_load(p: LoadParams, ends: tuple[float, float] | None) -> float:
    """Return the greatest effort of one axis' load in its range [N m or N]."""
    low, high = (-math.pi, math.pi) if ends is None else ends
    places = [low, high]
    # The sine's own extrema lie half a turn apart.
    top = math.atan2(p.sine, p.cosine)
    first = math.ceil((low - top) / math.pi)
    places += [top + math.pi * n for n in range(first, first + 3) if top + math.pi * n <= high]
    return max(abs(load_effort(p, x)) for x in places)
