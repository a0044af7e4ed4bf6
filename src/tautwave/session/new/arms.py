"""Arms of URDF files as parts of a first rig: what the file says, and `TODO` where it does not.

What the file lacks is guessed from what it has, so that the rig can be simulated at once: a drive
that reaches its effort limit at `STRENGTH`, a friction that brakes it within a third of a second.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from tautwave.config.checks.arms import KINDS
from tautwave.config.inputs.urdf import JointLimits, read_urdf
from tautwave.config.text.resolved import flow_yaml
from tautwave.errors import ConfigError
from tautwave.models.chain.build import build_chain
from tautwave.models.chain.inertia import BASE, chain_screws, mass_matrix
from tautwave.models.chain.kinematics import chain_frames, chain_jacobian
from tautwave.rig.arms import postures
from tautwave.types import FoundBus, FoundDevice, Setting

GRAVITY = (0.0, 0.0, -9.80665)
STRENGTH = {"rotary": 300.0, "linear": 100.0}
"""[rad/s^2 | m/s^2] Acceleration of a drive without its load, at its effort limit: a guess."""
BRAKED = 3.0
"""[1/s] Viscous friction per inertia of a drive: a guess."""
HELD_S = 0.02
"""[s] Viscous friction per load: what carrying a weight at 1 kHz takes, twice."""
RISE_S = 0.002
"""[s] In which a drive reaches its effort limit: a guess."""
STEP = {"rotary": 2.4e-5, "linear": 2.4e-6}
"""[rad | m] Of an encoder of 18 bits: a guess."""
SPEED = {"rotary": 3.0, "linear": 0.3}
LIFT = 3.0
"""Effort limit of a joint that the file gives none, per greatest load: a guess."""
TURN = {"rotary": math.pi, "linear": 0.1}
"""Half a range, where the file gives none."""
AMPLITUDE = {"rotary": 0.2, "linear": 0.02}
WAVE_HZ = 0.25
"""Of the motion of the simulated hand: each joint, around the middle of its range."""
LEVER_M = (0.05, 0.5)
GRIP = 538.0
"""[N/m] Stiffness of the default grip."""
OVERCOME = 8.0
"""Effort of the grip across the hand's motion, per dry friction of both joints."""


class Arm(NamedTuple):
    """An arm of a file: its joints from base to tip, what was odd, and whether it has masses."""

    file: Path
    tip: str | None
    base: str | None
    joints: tuple[Joint, ...]
    notes: tuple[str, ...]
    heavy: bool


class Joint(NamedTuple):
    """A joint: what the file says of it, and what its chain does to it over postures of its range.

    `load` [N m or N] and `inertia` [kg m^2 or kg] are the greatest load and the mean inertia of the
    chain alone, `carried` the greatest load of the joint and those that it carries; `reach` [m] is
    how far the tip moves per unit of the joint in mid-range.
    """

    limits: JointLimits
    kind: str
    low: float
    high: float
    load: float
    carried: float
    inertia: float
    reach: float

    @property
    def middle(self) -> float:
        """Where it stands at first: at 0, or in the middle of a range that 0 is at the end of."""
        room = 0.25 * (self.high - self.low)
        inside = self.low + room <= 0.0 <= self.high - room
        return 0.0 if inside else rounded(0.5 * (self.low + self.high), 3)

    @property
    def effort(self) -> float:
        """The file's effort limit, or a guess [N m or N]."""
        least = 1.0 if self.kind == "rotary" else 10.0
        known = math.isfinite(self.limits.effort)
        return (
            self.limits.effort
            if known
            else rounded(max(LIFT * self.load, 0.5 * self.carried, least))
        )

    @property
    def speed(self) -> float:
        """The file's velocity limit, or a guess [rad/s or m/s]."""
        known = math.isfinite(self.limits.velocity)
        return self.limits.velocity if known else SPEED[self.kind]

    @property
    def drive(self) -> float:
        """A guess of the inertia of the drive alone, behind its gear [kg m^2 or kg]."""
        return rounded(self.effort / STRENGTH[self.kind])

    @property
    def damping(self) -> tuple[float, str]:
        """Viscous friction [N m s/rad or N s/m], and where it is from.

        Simulators' files have a thousandth of a motor's: with that no weight could be carried.
        """
        guess = rounded(max(BRAKED * self.drive, HELD_S * self.carried))
        given = self.limits.damping
        if given >= 0.5 * guess:
            return given, "from the file, half of it taken as certain"
        reason = (
            f"the file's {given:g} would carry no weight" if given > 0.0 else "the file has none"
        )
        return guess, f"{reason}, a guess: TODO `tautwave identify`"

    def axis(self) -> dict[str, Setting]:
        """Return the keys of a simulated axis; `TODO` at what the file does not have."""
        limits, kind = self.limits, self.kind
        place, unit = ("rad", "N m") if kind == "rotary" else ("m", "N")
        guess = "the file has none, a guess: TODO"
        ranged = math.isfinite(limits.lower) and math.isfinite(limits.upper)
        damping, damped = self.damping
        low, high = (rounded(end, 6) for end in (self.low, self.high))
        return {
            "kind": Setting(kind),
            "effort_limit": Setting(
                self.effort, f"[{unit}]" + ("" if math.isfinite(limits.effort) else f" {guess}")
            ),
            "velocity_limit": Setting(
                self.speed,
                f"[{place}/s]" + ("" if math.isfinite(limits.velocity) else f" {guess}"),
            ),
            "position_range": Setting([low, high], f"[{place}]" + ("" if ranged else f" {guess}")),
            "effort_rate_limit": Setting(
                rounded(self.effort / RISE_S),
                f"[{unit}/s] {guess} how fast the drive's effort rises",
            ),
            "stall_energy_j": Setting("auto"),
            "encoder_quantum": Setting(STEP[kind], f"[{place}] {guess} the encoder's data sheet"),
            "inertia": Setting(
                {
                    "value": rounded(self.drive + self.inertia),
                    "lower": self.drive,
                    "source": "assumed",
                },
                f"lower is the drive alone, {guess} `tautwave identify`",
            ),
            "damping": Setting(
                {"value": damping, "lower": rounded(0.5 * damping), "source": "assumed"},
                damped,
            ),
        }


def rounded(value: float, digits: int = 2) -> float:
    """Return a value rounded to this many significant digits, in its own unit."""
    return float(f"{value:.{digits}g}")


def read_arm(file: Path, tip: str | None, base: str | None) -> Arm:
    """Return the arm of a URDF file.

    Raises
    ------
    ConfigError
        It cannot be read, or is not a serial chain; the message names a tip that would do.
    """
    try:
        urdf = read_urdf(file, tip, base)
    except ConfigError as err:
        raise ConfigError(re.sub(r"`(tip|base):\s*([^`]*)`", r"`--\1 \2`", str(err))) from err
    chain = build_chain(urdf.links, GRAVITY)
    moving = [link for link in urdf.links if link.kind != "fixed"]
    kinds = [KINDS[link.kind] for link in moving]
    ranges = [
        (
            limit.lower if math.isfinite(limit.lower) else -TURN[kind],
            limit.upper if math.isfinite(limit.upper) else TURN[kind],
        )
        for limit, kind in zip(urdf.limits, kinds, strict=True)
    ]
    count = len(ranges)
    load, inertia = [0.0] * count, [0.0] * count
    number = 0
    for place in postures(ranges):
        number += 1
        frames = chain_frames(chain, list(place))
        weight, matrix = [0.0] * count, [0.0] * (count * count)
        mass_matrix(chain, list(place), frames, chain_screws(frames), BASE, matrix, weight)
        for joint in range(count):
            load[joint] = max(load[joint], abs(weight[joint]))
            inertia[joint] += matrix[joint * (count + 1)]
    out = [0.0] * (6 * count)
    chain_jacobian(chain, [0.5 * (low + high) for low, high in ranges], out)
    joints = tuple(
        Joint(
            limit, kinds[i], *ranges[i], load[i], max(load[i:]), inertia[i] / number,
            math.hypot(*out[6 * i : 6 * i + 3]),
        )
        for i, limit in enumerate(urdf.limits)
    )  # fmt: skip
    heavy = any(link.body.mass > 0.0 for link in urdf.links)
    return Arm(file, tip, base, joints, urdf.notes, heavy)


def arm_bus(name: str, arm: Arm) -> FoundBus:
    """Return a simulated bus with an axis for each joint of an arm."""
    devices = [
        FoundDevice(number, joint.limits.name, {}, joint.axis())
        for number, joint in enumerate(arm.joints, start=1)
    ]
    return FoundBus(name, "loopback", {}, "", devices)


def limited(device: FoundDevice, joint: Joint) -> FoundDevice:
    """Return a device that was found, within what the file says of its joint."""
    axis = dict(device.axis)
    limits = joint.limits
    if math.isfinite(limits.lower) and math.isfinite(limits.upper):
        axis["position_range"] = Setting([limits.lower, limits.upper], "of the URDF file")
    for key, most in (("effort_limit", limits.effort), ("velocity_limit", limits.velocity)):
        if key in axis and most < axis[key].value:
            axis[key] = Setting(most, "of the URDF file")
    return device._replace(axis=axis)


def pair_names(master: Arm, slave: Arm) -> list[str]:
    """Return a name for each pair: that of the slave's joint, in letters that a name may have.

    Raises
    ------
    ConfigError
        The arms have different numbers of joints, or of kinds that no pair couples.
    """
    ours, theirs = len(master.joints), len(slave.joints)
    if ours != theirs:
        raise ConfigError(
            f"new: the leader has {ours} joints and the follower {theirs}: they can be coupled at "
            "their tips only, see configs/arms/six-seven.yaml (`tautwave new RIG --from "
            "six-seven`); for joints, choose tips with as many"
        )
    names = []
    for one, other in zip(master.joints, slave.joints, strict=True):
        if one.kind != other.kind:
            raise ConfigError(
                f"new: joint {one.limits.name!r} of the leader is {one.kind}, "
                f"{other.limits.name!r} of the follower {other.kind}; choose other tips"
            )
        name = re.sub(r"[^A-Za-z0-9_-]+", "_", other.limits.name).strip("_-") or "joint"
        name = name if name[0].isalpha() or name[0] == "_" else f"j{name}"
        while name in names:
            name += "_"
        names.append(name)
    return names


def arm_lines(arm: Arm, rig: Path) -> Iterator[str]:
    """Yield the lines of a side's arm; its file relative to the rig's folder where that is near."""
    file = os.path.relpath(arm.file.resolve(), rig.resolve().parent)
    keys: dict[str, Any] = {
        "urdf": file if not file.startswith("../../..") else str(arm.file.resolve())
    }
    keys |= {key: value for key, value in (("tip", arm.tip), ("base", arm.base)) if value}
    if arm.heavy:
        yield f"  arm: {flow_yaml(keys)}"
    else:
        keys["compensate"] = False
        yield f"  arm: {flow_yaml(keys)}   # TODO masses: the file has none, so none are carried"
    for note in arm.notes:
        yield f"  # {note}"


def simulated_lines(names: Sequence[str], arms: Mapping[str, Arm]) -> Iterator[str]:
    """Yield the lines of the simulation: where each axis begins, and a hand that moves each."""
    yield "simulation:"
    leader, follower = arms["master"].joints, arms["slave"].joints
    entries = [
        *_entries("master", names, leader, follower),
        *_entries("slave", names, follower, leader),
    ]
    if entries:
        yield "  axes:"
        yield from entries
    yield "  hand:                          # each joint around where it begins: yours to change"
    for number, name in enumerate(names):
        one, its = leader[number], follower[number]
        middle, reach = _start(one, its), _amplitude(one, its)
        sine = [WAVE_HZ, reach, rounded(math.pi * (number % 2), 6)]
        keys: dict[str, Any] = {
            "reference": {"type": "multisine", "offset": middle, "components": [sine]}
        }
        if one.kind == "rotary":
            keys = {"lever_arm": _lever(one, its, reach), **keys}
        yield f"    {name}: {flow_yaml(keys)}"


def _entries(
    side: str, names: Sequence[str], joints: Sequence[Joint], others: Sequence[Joint]
) -> Iterator[str]:
    """Yield the lines of simulated axes that begin elsewhere than at 0, or have dry friction."""
    for name, joint, other in zip(names, joints, others, strict=True):
        keys: dict[str, float] = {}
        middle = _start(joint, other)
        if middle != 0.0:
            keys["start_position"] = middle
        if joint.limits.friction > 0.0:
            keys["coulomb"] = joint.limits.friction
        if keys:
            yield f"    {side}.{name}: {flow_yaml(keys)}"


def _lever(one: Joint, its: Joint, reach: float) -> float:
    """Return the lever arm [m] of a grip at the tip that overcomes the friction of both joints."""
    dry = one.limits.friction + its.limits.friction
    lever = min(max(one.reach, LEVER_M[0]), LEVER_M[1])
    return rounded(max(lever, math.sqrt(OVERCOME * dry / (GRIP * reach)) if reach > 0.0 else 0.0))


def _start(one: Joint, other: Joint) -> float:
    """Return where both joints of a pair begin: inside both ranges."""
    low, high = max(one.low, other.low), min(one.high, other.high)
    if low < high:
        return one._replace(low=low, high=high).middle
    return one.middle


def _amplitude(one: Joint, other: Joint) -> float:
    """Return how far the hand moves a joint [rad or m]: well inside both ranges and speeds."""
    width = min(one.high, other.high) - max(one.low, other.low)
    speed = 0.2 * min(one.speed, other.speed) / (2.0 * math.pi * WAVE_HZ)
    return rounded(min(AMPLITUDE[one.kind], 0.15 * max(width, 0.0), speed))
