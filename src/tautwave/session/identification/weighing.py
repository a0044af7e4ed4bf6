"""`identify RIG --load`: move the joints of a side slowly, and find what weighs on them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from tautwave.config import Rig
from tautwave.config.inputs.chains import chain_links, held_at_tip
from tautwave.config.keys.arm import Arm, SideArm
from tautwave.errors import ConfigError, RecordingError, SafetyStop
from tautwave.files import write_text
from tautwave.models.chain.build import Body, Link, build_chain
from tautwave.models.chain.gravity import chain_gravity
from tautwave.models.chain.inertia import (
    BASE,
    chain_bodies,
    chain_coriolis,
    chain_screws,
    mass_matrix,
)
from tautwave.models.chain.kinematics import chain_frames
from tautwave.models.chain.params import ChainParams
from tautwave.rig.arms import load_params
from tautwave.session.identification.exciting import ShakenParams
from tautwave.session.identification.identifying import record_excitation
from tautwave.session.identification.slots import axis_slots

if TYPE_CHECKING:
    from tautwave.analysis.identification.load_model import Moved, WeightFit
    from tautwave.analysis.identification.regression import Estimate

SPRING_HZ, SPRING_DAMPING = 4.0, 0.7
CUTOFF_HZ = 4.0
FADE_S = 2.0
ROOM_SHARE = 0.8
PASSES = 2
MIN_MASS = 0.02
ARM_LENGTH = 0.1
"""What a centre of mass may be believed wrong by [m], for a link lighter than MIN_MASS too."""


class SlowMotion:
    """Two slow sines around the place where a joint stands, through a spring that carries it.

    Parameters
    ----------
    rig : Rig
        The rig.
    axis_name : str
        Full name.
    number : int
        Of the axis: each has frequencies of its own.
    duration_s : float
        Of the motion [s].
    reach : float, optional
        How far from the start [rad or m]; a quarter of the range if not given.
    """

    def __init__(
        self, rig: Rig, axis_name: str, number: int, duration_s: float, reach: float | None
    ) -> None:
        axis = rig.axes[axis_name]
        if axis.inertia is None or axis.position_range is None:
            raise ConfigError(
                f"{axis_name} has no position_range, which this motion requires; add it"
            )
        self._name = axis_name
        self._low, self._high = axis.position_range
        self._reach = 0.25 * (self._high - self._low) if reach is None else reach
        self._period = rig.period_s
        self._slot = 0
        self._turns = (2.0 + 0.43 * number) / duration_s
        pulse = 2.0 * math.pi * SPRING_HZ
        inertia = axis.inertia.value
        self.spring = ShakenParams(inertia * pulse * pulse, 2.0 * SPRING_DAMPING * inertia * pulse)
        self._centre = 0.0

    def start(self, position: float) -> None:
        """Begin around the joint's position, within the room that there is.

        Raises
        ------
        SafetyStop
            It is too close to an end of its range.
        """
        room = min(position - self._low, self._high - position)
        if room < 0.1 * (self._high - self._low):
            raise SafetyStop(
                f"{self._name} is at {position:.4g}, at the end of its range [{self._low:g}, "
                f"{self._high:g}]; move it towards the middle"
            )
        self._centre = position
        self._reach = min(self._reach, ROOM_SHARE * room)

    def pass_slots(self, count: int) -> None:
        """Skip slots."""
        self._slot += count

    def far(self, position: float, velocity: float) -> float:
        """Return where the spring's far end is [rad or m]."""
        time = self._slot * self._period
        angle = 2.0 * math.pi * self._turns * time
        wave = 0.8 * math.sin(angle) + 0.2 * math.sin(2.3 * angle)
        return self._centre + min(time / FADE_S, 1.0) * self._reach * wave


class Weight(NamedTuple):
    """One number of a joint's load: `constant`, `mass`, `centre x`."""

    joint: str
    name: str
    believed: float
    estimate: Estimate


class LoadResult(NamedTuple):
    """Identified loads of a side, or of one axis."""

    axes: tuple[str, ...]
    weights: tuple[Weight, ...]
    fit: WeightFit
    snippet: str
    duration_s: float
    notes: list[str]
    directory: Path

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        fit = self.fit
        return {
            "kind": "load",
            "axes": list(self.axes),
            "duration_s": self.duration_s,
            "parameters": [
                {
                    "joint": weight.joint,
                    "name": weight.name,
                    "believed": weight.believed,
                    "found": weight.estimate._asdict(),
                }
                for weight in self.weights
            ],
            "coulomb": {n: e._asdict() for n, e in zip(self.axes, fit.coulomb, strict=True)},
            "damping": {n: e._asdict() for n, e in zip(self.axes, fit.damping, strict=True)},
            "residual_rms": dict(zip(self.axes, fit.after, strict=True)),
            "residual_rms_as_believed": dict(zip(self.axes, fit.before, strict=True)),
            "snippet": self.snippet,
            "notes": self.notes,
            "directory": str(self.directory),
        }


def identify_load(
    rig: Rig,
    *,
    axis: str | None,
    out: Path,
    duration_s: float,
    reach: float | None,
    progress: Callable[[float, str], None] | None = None,
    **ways: Any,
) -> LoadResult:
    """Move all joints of an arm slowly, or one axis, and fit masses and centres, or its load.

    Parameters are those of `identify_device`; with an arm `axis` is any of its joints.

    Raises
    ------
    TautwaveError
        The rig is refused, the run ended in a fault or a stop, or a joint did not move enough.
    """
    weighed = arm_to_weigh(rig, axis)
    arm = None if weighed is None else weighed.keys
    names = (str(axis),) if weighed is None else weighed.axes
    movers = {
        name: SlowMotion(rig, name, number, duration_s, reach) for number, name in enumerate(names)
    }
    run = record_excitation(
        rig, names[0], movers, out=out, duration_s=duration_s, progress=progress, **ways
    )
    if progress is not None:
        progress(1.0, "fitting")
    with run.heard.raised():
        late = run.delay.periods + run.delay.remainder_s / rig.period_s
        weights, fit = fit_loads(out / "recording.mcap", run.rig, arm, names, late)
    rotary = arm is not None or rig.axes[names[0]].kind == "rotary"
    doubts = implausible_weights(weights, rotary)
    if doubts:
        snippet = f"# {', '.join(names)}: nothing here is credible, see the notes"
    else:
        snippet = load_snippet(arm, weights) if arm is not None else axis_snippet(weights)
    notes = [*run.notes, *doubts]
    result = LoadResult(names, weights, fit, snippet, run.seconds, notes, out)
    text = json.dumps(result.as_dict(), indent=2, ensure_ascii=False)
    write_text(out / "identification.json", text + "\n")
    return result


def implausible_weights(weights: Sequence[Weight], rotary: bool) -> list[str]:
    """Return a sentence for each mass, centre or load that no link or axis has."""
    from tautwave.analysis.identification.plausible import implausible

    sentences = []
    for weight in weights:
        value = weight.estimate.value
        if weight.name == "mass":
            doubts = implausible({"link_mass": value}, rotary)
            if weight.estimate.upper < 0.0:
                doubts = [f"Doubtful: a mass of {value:.3g} kg is impossible; its effort has the "
                          "other sign, or something else carries the link."]  # fmt: skip
        elif weight.name.startswith("centre"):
            known = not weight.estimate.lower <= 0.0 <= weight.estimate.upper
            doubts = implausible({"centre": value}, rotary) if known else []
        else:
            doubts = implausible({"bias": value}, rotary)
        sentences += [f"{weight.joint}: {doubt}" for doubt in doubts]
    return sentences


def arm_to_weigh(rig: Rig, axis: str | None) -> SideArm | None:
    """Return the arm whose joints are to be moved, None where it is the axis alone."""
    arms = [arm for side in ("master", "slave") for arm in rig.arms(side)]
    if axis is None:
        if len(arms) == 1:
            return arms[0]
        raise ConfigError(
            f"{rig.name}: choose an axis, or one of an arm's, with --axis: {', '.join(rig.axes)}"
        )
    if axis not in rig.axes:
        raise ConfigError(f"{rig.name}: there is no axis {axis!r}; there are {', '.join(rig.axes)}")
    if rig.axes[axis].causality != "impedance":
        raise ConfigError(
            f"{axis} is an admittance axis: its drive compensates for the load itself"
        )
    return rig.arm_of(axis)


def fit_loads(
    path: Path, rig: Rig, arm: Arm | None, names: Sequence[str], late: float
) -> tuple[tuple[Weight, ...], WeightFit]:
    """Fit the loads of axes to the recording of their slow motion.

    Raises
    ------
    RecordingError
        A joint hardly moved.
    """
    from tautwave.analysis.identification.load_model import fit_weights, moved

    joints: list[Moved] = []
    for name in names:
        seen = axis_slots(path, name, rig)
        cutoff = min(CUTOFF_HZ, rig.rate_hz / 25.0)
        try:
            joints.append(moved(seen.position, seen.effort, seen.known, rig.period_s, late, cutoff))
        except ValueError as err:
            raise RecordingError(f"{path}: {name}: {err}") from err
    every = np.flatnonzero(np.any([joint.rows > 0.5 for joint in joints], axis=0))
    positions = np.stack([joint.position[every] for joint in joints], axis=1)
    if arm is None:
        return _fit_axis(rig, names[0], joints, every, positions[:, 0], fit_weights)
    links, _ = chain_links(arm)
    at = bodies_of(links)
    speeds = np.stack([joint.velocity[every] for joint in joints], axis=1)
    rates = np.stack([joint.acceleration[every] for joint in joints], axis=1)
    columns = np.empty((len(every), len(names), 4 * len(at)))
    for number, index in enumerate(at):
        units = [_weights(_alone(links, index, arm, centre), positions) for centre in CENTRES]
        columns[:, :, 4 * number] = units[0]
        for axis in range(3):
            columns[:, :, 4 * number + 1 + axis] = units[1 + axis] - units[0]
    masses = [max(links[index].body.mass, MIN_MASS) for index in at]
    scales = [scale for mass in masses for scale in (mass, *([ARM_LENGTH * mass] * 3))]
    start = links
    for _ in range(PASSES):  # what accelerates is taken as found the time before
        chain = build_chain(links, arm.gravity, held_at_tip(arm))
        believed = np.array(
            [needed(chain, *row) for row in zip(positions, speeds, rates, strict=True)]
        )
        fit = fit_weights(joints, every, believed, columns, scales)
        weights = _arm_weights(start, links, at, fit)
        links = _with_found(links, at, weights)
    first = build_chain(start, arm.gravity, held_at_tip(arm))
    asked = np.array([needed(first, *row) for row in zip(positions, speeds, rates, strict=True)])
    plain = fit_weights(joints, every, asked, columns[:, :, :0], ())
    return tuple(weights), fit._replace(before=plain.after)


CENTRES = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _fit_axis(
    rig: Rig,
    name: str,
    joints: Sequence[Any],
    every: Any,
    position: Any,
    fit_weights: Callable[..., WeightFit],
) -> tuple[tuple[Weight, ...], WeightFit]:
    """Fit a constant and a sine; what carries is the load's opposite."""
    keys = rig.axes[name].load
    known = (0.0, 0.0, 0.0) if keys is None else tuple(load_params(keys))
    parts = np.stack([np.ones_like(position), np.cos(position), np.sin(position)], axis=1)
    if rig.axes[name].kind == "linear":
        parts, known = parts[:, :1], known[:1]
    believed = -(parts @ np.array(known))[:, None]
    scales = [1.0] * len(known)
    fit = fit_weights(joints, every, believed, -parts[:, None, :], scales)
    weights = []
    words = ("constant", "cosine", "sine")
    for word, value, change in zip(words, known, fit.found, strict=False):
        weights.append(Weight(name, word, value, _moved_by(change, value)))
    return tuple(weights), fit


def _moved_by(change: Estimate, value: float, scale: float = 1.0) -> Estimate:
    return type(change)(
        scale * (value + change.value),
        scale * (value + change.lower),
        scale * (value + change.upper),
    )


def bodies_of(links: Sequence[Link]) -> list[int]:
    """Return for each moving joint the link that holds its body: itself, or the next, fixed one."""
    carriers = []
    for number, link in enumerate(links):
        if link.kind == "fixed":
            continue
        last = number
        following = links[number + 1 : number + 2]
        if link.body.mass == 0.0 and following and following[0].kind == "fixed":
            last = number + 1
        carriers.append(last)
    return carriers


def _alone(
    links: Sequence[Link], index: int, arm: Arm, centre: tuple[float, float, float]
) -> ChainParams:
    """Return the chain with 1 kg at one place of one link and nothing else."""
    bare = [link._replace(body=Body()) for link in links]
    bare[index] = bare[index]._replace(body=Body(1.0, centre))
    return build_chain(tuple(bare), arm.gravity)


def _weights(chain: ChainParams, positions: Any) -> Any:
    efforts = np.empty_like(positions)
    weight = [0.0] * positions.shape[1]
    for number, q in enumerate(positions.tolist()):
        chain_gravity(chain, chain_frames(chain, q), weight)
        efforts[number] = weight
    return efforts


def needed(chain: ChainParams, q: Any, v: Any, a: Any) -> list[float]:
    """Return what holds and moves a chain as believed, but for the joints' own inertia."""
    count = len(q)
    frames = chain_frames(chain, q.tolist())
    bodies, screws = chain_bodies(chain, frames), chain_screws(frames)
    weight, swung, matrix = [0.0] * count, [0.0] * count, [0.0] * (count * count)
    chain_coriolis(bodies, screws, v.tolist(), swung)
    mass_matrix(chain, q.tolist(), frames, screws, BASE, matrix, weight)
    pushed = np.array(matrix).reshape(count, count) @ a
    return [w + s + float(p) for w, s, p in zip(weight, swung, pushed, strict=True)]


def _arm_weights(
    start: Sequence[Link], links: Sequence[Link], at: Sequence[int], fit: WeightFit
) -> list[Weight]:
    """Return masses and centres from changes of `links`, beside what was believed at the start."""
    weights = []
    moving = [link.name for link in links if link.kind != "fixed"]
    for number, index in enumerate(at):
        body, old = links[index].body, start[index].body
        changes = fit.found[4 * number : 4 * number + 4]
        shifted = _moved_by(changes[0], body.mass)
        mass = max(shifted.value, 1e-6)
        weights.append(Weight(moving[number], "mass", old.mass, shifted))
        for axis, change in enumerate(changes[1:]):
            place = _moved_by(change, body.mass * body.centre[axis], 1.0 / mass)
            name = f"centre {'xyz'[axis]}"
            weights.append(Weight(moving[number], name, old.centre[axis], place))
    return weights


def _with_found(
    links: Sequence[Link], at: Sequence[int], weights: Sequence[Weight]
) -> tuple[Link, ...]:
    changed = list(links)
    for number, index in enumerate(at):
        mass, x, y, z = (w.estimate.value for w in weights[4 * number : 4 * number + 4])
        body = changed[index].body._replace(mass=max(mass, 0.0), centre=(x, y, z))
        changed[index] = changed[index]._replace(body=body)
    return tuple(changed)


def load_snippet(arm: Arm, weights: Sequence[Weight]) -> str:
    """Return masses and centres as lines for the rig's rows, or for the URDF's links."""
    lines = []
    for number in range(0, len(weights), 4):
        mass, x, y, z = (f"{w.estimate.value:.5g}" for w in weights[number : number + 4])
        joint = weights[number].joint
        if arm.urdf is None:
            lines.append(f"{joint}: mass: {mass}, centre: [{x}, {y}, {z}]")
        else:
            lines.append(f'{joint}: <origin xyz="{x} {y} {z}"/><mass value="{mass}"/>')
    return "\n".join(lines)


def axis_snippet(weights: Sequence[Weight]) -> str:
    """Return the load of one axis as a line for the rig file."""
    parts = [f"{weight.name}: {weight.estimate.value:.5g}" for weight in weights]
    return f"load: {{{', '.join(parts)}}}"
