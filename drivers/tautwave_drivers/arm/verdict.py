"""What an arm under the tip's axes takes of its joints, and whether the axes believe what it is.

Three things. The joints' efforts J^T F, weight and posture are held as they will be half-way
through a period, wrong by no more than their slope h times what the joint moves: of its damping
that takes h T (1 + 2 d), as a load does (`certificate.beside.loads`). The ports believe of each
coordinate a least inertia m_i and damping b_i; the arm has them in every direction at once where
the greatest eigenvalue of D J M^-1 J^T D, D the roots of the m_i, is at most 1. And no joint may be
asked for more than its limit. All three are sampled over the joints' ranges.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from tautwave.contracts import BusSpec
from tautwave.models.chain.gravity import gravity_stiffness
from tautwave.models.chain.inertia import BASE, chain_screws, mass_matrix
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.task import COORDINATES, task_place
from tautwave.types import BusElement
from tautwave_drivers.arm.options import NAMES, ArmOptions, coordinates, follows
from tautwave_drivers.arm.walls import ArmWall

POSTURES = 300
MARGIN = 1.2
"""Factor on sampled slopes, efforts and speeds, for what lies between the samples."""

STEP = 1e-4


class Sampled(NamedTuple):
    """Over the postures: slopes of the joints' efforts by axis, greatest efforts, eigenvalues.

    `slope` and `effort` are (joints,), `reach` the greatest of what each joint moves the tip.
    """

    slope: Any
    effort: Any
    inertia: float
    damping: float
    reach: Any


def arm_elements(
    options: ArmOptions, bus: BusSpec, axes: Mapping[str, Any], late: float
) -> Sequence[BusElement]:
    """Return the verdicts on an arm.

    Parameters
    ----------
    options, bus
        The arm.
    axes : mapping
        What the rig believes of each coordinate, by full name.
    late : float
        Command delay in periods.
    """
    if follows(bus):
        return [_following(options, bus)]
    which = coordinates(bus)
    period = 1.0 / bus.rate_hz
    believed = [axes[axis.name] for axis in bus.axes]
    spent = period * (1.0 + 2.0 * late)
    sampled = _sample(options, bus, which, believed, spent)
    elements = [*_joints(options, bus, sampled, spent)]
    elements.append(_tip(options, bus, which, sampled))
    elements += [_wall(name, bus, wall, options, sampled) for name, wall in options.walls.items()]
    return elements


def _sample(
    options: ArmOptions,
    bus: BusSpec,
    which: Sequence[int],
    believed: Sequence[Any],
    spent: float,
) -> Sampled:
    """Return what is sampled; a slope h takes h `spent` [s] of a joint's damping."""
    task, chain = options.task(), options.believed()
    joints = list(options.joints.values())
    count = len(joints)
    force = np.zeros(COORDINATES)
    for k, axis in zip(which, bus.axes, strict=True):
        force[k] = axis.effort_limit
    masses = np.sqrt([axis.inertia.lower for axis in believed])
    damped = np.sqrt([axis.damping.lower for axis in believed])
    moved = []
    slope, effort = np.zeros(count), np.zeros(count)
    reach = np.zeros(count)
    inertia = 0.0
    rng = random.Random(0)
    ranges = [joint.position_range for joint in joints]
    for number in range(POSTURES):
        q = [rng.uniform(*ends) for ends in ranges]
        if number == 0:
            q = list(options.at_home)
        place, jacobian = _place(task, q)
        if math.sqrt(sum(turn * turn for turn in place[3:])) > 2.9:
            continue  # beyond what the rotations' ranges allow
        used = jacobian[list(which)]
        frames = chain_frames(chain, q)
        weight, rows = [0.0] * count, [0.0] * (count * count)
        mass_matrix(chain, q, frames, chain_screws(frames), BASE, rows, weight)
        matrix = np.array(rows).reshape(count, count)
        matrix += np.diag([joint.inertia_lower for joint in joints])
        soft = used @ np.linalg.solve(matrix, used.T)
        inertia = max(inertia, _greatest(masses[:, None] * soft * masses))
        moved.append(damped[:, None] * used)
        walls = sum(wall.force_limit for wall in options.walls.values())
        asked = force @ np.abs(jacobian) + walls * np.linalg.norm(jacobian[:3], axis=0)
        carried = np.abs(weight) if options.carry else 0.0
        off = np.abs(np.array(q) - options.at_home)
        effort = np.maximum(effort, asked + carried + options.posture * off)
        reach = np.maximum(reach, np.linalg.norm(jacobian[:3], axis=0))
        if number % 3 == 0:
            slope = np.maximum(slope, _bent(task, q, jacobian, force))
    held = [0.0] * count
    if options.carry:
        gravity_stiffness(chain, [max(map(abs, ends)) for ends in ranges], held)
    slope = MARGIN * slope + np.array(held) + options.posture
    left = np.array([joint.damping_lower for joint in joints]) - spent * slope
    loose = 1.0 / np.sqrt(np.maximum(left, 1e-12))
    damping = max((float(np.linalg.norm(one * loose, 2)) ** 2 for one in moved), default=0.0)
    return Sampled(slope, effort, inertia, damping, reach)


def _following(options: ArmOptions, bus: BusSpec) -> BusElement:
    """Return the verdict on an arm whose joints follow velocities."""
    names = ", ".join(NAMES[k] for k in coordinates(bus))
    sentence = (
        f"tip of bus {bus.name} ({names}): in directions with a lever arm below "
        f"{options.least_lever:g} m it lags, and may supply {options.reserve:.3g} J beyond what "
        "its ports account for; a command that would supply more is limited, and beyond twice "
        "that the run stops. After a device reset it may supply as much again."
    )
    conditions = (
        f"the joints of bus {bus.name} reach their commanded velocities and measure the external "
        "effort on them" + (", with their weight subtracted" if options.carry else ""),
    )
    numbers = {"least_lever": options.least_lever, "reserve_j": options.reserve}
    return BusElement(
        f"tip of {bus.name}", "tip", bus.axes[0].name, True, sentence, conditions, numbers
    )


def _place(task: Any, q: Sequence[float]) -> tuple[Sequence[float], Any]:
    jacobian = [0.0] * (COORDINATES * len(q))
    place = task_place(task, q, jacobian)
    return place, np.array(jacobian).reshape(len(q), COORDINATES).T


def _bent(task: Any, q: Sequence[float], jacobian: Any, force: Any) -> Any:
    """Return of each joint how fast its effort for the greatest `force` changes with all joints."""
    slope = np.zeros(len(q))
    for k in range(len(q)):
        moved = [at + (STEP if j == k else 0.0) for j, at in enumerate(q)]
        slope += force @ (np.abs(_place(task, moved)[1] - jacobian) / STEP)
    return slope


def _greatest(matrix: Any) -> float:
    return float(np.linalg.eigvalsh(matrix)[-1])


def _joints(
    options: ArmOptions, bus: BusSpec, sampled: Sampled, spent: float
) -> Sequence[BusElement]:
    elements = []
    kinds = options.kinds()
    for j, (name, joint) in enumerate(options.joints.items()):
        rotary = kinds[j] == "rotary"
        unit, effort = ("N m s/rad", "N m") if rotary else ("N s/m", "N")
        needed = float(sampled.slope[j]) * spent
        asked = float(sampled.effort[j])
        place = f"joint {name} of bus {bus.name}"
        passed = needed <= joint.damping_lower and asked <= joint.effort_limit
        sentence = (
            f"{place}: mapping the tip's efforts, weight and posture to joint efforts takes "
            f"{needed:.3g} {unit} of its damping of {joint.damping_lower:g}, and up to "
            f"{asked:.3g} of its {joint.effort_limit:g} {effort}"
        )
        if needed > joint.damping_lower:
            sentence += "; raise rate_hz, lower the effort_limit of the axes, or add friction"
        elif asked > joint.effort_limit:
            sentence += "; lower the effort_limit of the axes, or narrow the joints' ranges"
        elements.append(
            BusElement(
                f"joint {name} of {bus.name}",
                "joint",
                bus.axes[0].name,
                passed,
                f"{sentence}.",
                (),
                {"needed_damping": needed, "greatest_effort": asked},
                joint.damping_lower - needed,
            )
        )
    return elements


def _tip(options: ArmOptions, bus: BusSpec, which: Sequence[int], sampled: Sampled) -> BusElement:
    names = ", ".join(NAMES[k] for k in which)
    numbers = {"inertia_share": sampled.inertia, "damping_share": sampled.damping}
    wrong = []
    if sampled.inertia > 1.0:
        wrong.append(("inertia.lower", 1.0 / sampled.inertia))
    if sampled.damping > 1.0:
        wrong.append(("damping.lower", 1.0 / sampled.damping))
    if wrong:
        what = " and ".join(f"{key} to {share:.2g} times what it is" for key, share in wrong)
        sentence = (
            f"tip of bus {bus.name} ({names}): in some postures the arm has less than its axes "
            f"state; lower {what}, or narrow the joint ranges."
        )
        return BusElement(
            f"tip of {bus.name}", "tip", bus.axes[0].name, False, sentence, (), numbers
        )
    sentence = (
        f"tip of bus {bus.name} ({names}): an arm whose mobility is at most {sampled.inertia:.3g} "
        "of what its axes state everywhere, and whose damping is at least "
        f"{1.0 / max(sampled.damping, 1e-9):.3g} times."
    )
    conditions = (
        f"the coordinates of bus {bus.name}, which are coupled through the arm, together return "
        "no more of a wave than each alone (proved for each alone; for all together, only the "
        "tanks' output is bounded)",
    )
    return BusElement(
        f"tip of {bus.name}", "tip", bus.axes[0].name, True, sentence, conditions, numbers
    )


def _wall(
    name: str, bus: BusSpec, wall: ArmWall, options: ArmOptions, sampled: Sampled
) -> BusElement:
    variance = fastest = 0.0
    for reach, joint in zip(sampled.reach, options.joints.values(), strict=True):
        variance += reach**2 * (joint.position_noise**2 + joint.encoder_quantum**2 / 12.0)
        fastest += reach * joint.velocity_limit
    power = wall.stiffness * variance * bus.rate_hz
    stalled = MARGIN * wall.force_limit * fastest / bus.rate_hz
    sentence = (
        f"wall {name} of bus {bus.name}: returns no more than it absorbed in the same contact, by "
        f"its energy account, plus {power:.3g} W for encoder noise while in contact. A "
        f"host that stalls holds its force for longer: each period that it skips may supply "
        f"up to {stalled:.3g} J at the joints' velocity limits, which the next contacts take back."
    )
    return BusElement(
        f"wall {name} of {bus.name}",
        "space wall",
        bus.axes[0].name,
        True,
        sentence,
        (),
        {"noise_w": power, "stalled_j": stalled},
    )
