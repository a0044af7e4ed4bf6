"""Rigs with a spring between two ends, drawn from a seed, and what an adversary suspects of them.

Delays, command delays, dampers, scales, unequal motors, walls, loads, compensated friction and
effort steps; damping about what the spring needs, on both sides of it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from tautwave.certificate import certify
from tautwave.config import Rig
from tests.certificate.cycles import Friction, Suspected, drawn_motions, greedy_gain, lap_of
from tests.rigs.running import Tree, rig_of

SIDES = (("master", "hand"), ("slave", "arm"))
ROUNDING = 1e-9
"""Of the gross flow: what a sum of some thousand terms is wrong by."""


def with_damping(tree: Tree, side: str, damping: float) -> Tree:
    """Return a rig with another damping at one side."""
    return {**tree, side: {"axes": {"a": {**tree[side]["axes"]["a"], "damping": damping}}}}


class Drawn(NamedTuple):
    """A rig as a tree, and what there is to know of it, in the units of the master."""

    tree: Tree
    law: str
    stiffness: float
    memory: int
    bare: bool
    gentle: bool = False
    """Certified as long as it is not clipped."""

    @property
    def rig(self) -> Rig:
        """The rig."""
        return rig_of(self.tree)

    def times(self, factor: float) -> Drawn:
        """Return the rig with so much of its damping."""
        out = self.tree
        for side, _ in SIDES:
            out = with_damping(out, side, factor * out[side]["axes"]["a"]["damping"])
        return self._replace(tree=out)


def drawn(seed: int, *, bare: bool = False) -> Drawn:
    """Return the rig of a seed; `bare`: a spring alone, between motors that do not matter."""
    draw = np.random.default_rng(seed)
    rate = float(draw.choice([500.0, 1000.0, 2000.0, 4096.0]))
    stiffness = float(10.0 ** draw.uniform(1.0, 4.0))
    line = int(draw.choice([0, 1, 2, 5, 20, 60, 300]))
    late = [int(draw.integers(0, 3)) for _ in SIDES]
    late = late if draw.random() < 0.5 else [late[0]] * 2
    scale, force = (10.0 ** draw.uniform(-0.5, 0.5, 2)) if draw.random() < 0.5 else (1.0, 1.0)
    damper = 0.0 if bare or draw.random() < 0.5 else stiffness / rate * draw.uniform(0.1, 2.0)
    law = "pd_damping" if not bare and draw.random() < 0.3 else "position"
    pair: Tree = {
        "stiffness": stiffness,
        "damping": float(damper),
        "position_scale": float(scale),
        "force_scale": float(force),
        "sign": int(draw.choice([-1, 1])),
    }
    if law == "pd_damping":
        pair["injection"] = float(stiffness / rate * draw.uniform(0.0, 2.0))
    motors = 10.0 ** draw.uniform(0.5, 2.0, 2) if draw.random() < 0.7 else np.full(2, 50.0)
    need = stiffness / rate * (1.0 + line + sum(late)) + 2.0 * damper + pair.get("injection", 0.0)
    out: Tree = {
        "name": f"spring-{seed}",
        "rate_hz": rate,
        "duration_s": 100.0,
        "require": "passive",
        "seed": 1,
        "buses": {},
        "coupling": {
            "law": law,
            "delay_s": line / rate,
            "engage_ramp_s": 0.0,
            "release_ramp_s": 0.0,
            "pairs": {"a": pair},
        },
        "simulation": {},
    }
    for end, (side, bus) in enumerate(SIDES):
        unit = 1.0 if end == 0 else force / scale
        motor = 1e9 if bare else float(motors[end] * (1.0 if end == 0 else force))
        axis: Tree = {
            "bus": bus,
            "id": 1,
            "kind": "linear",
            "inertia": {"value": 0.5, "lower": 0.5, "source": "drawn"},
            "damping": float(need * unit * 10.0 ** draw.uniform(-0.3, 0.7)),
            "effort_limit": motor,
        }
        if not bare:
            _add(draw, axis, pair, side, stiffness * unit, motor)
        out["buses"][bus] = {"driver": "loopback"}
        if late[end] > 0:
            out["buses"][bus]["options"] = {"command_delay_s": late[end] / rate}
        out[side] = {"axes": {"a": axis}}
    return Drawn(out, law, stiffness, line + max(late) + 2, bare)


def _add(
    draw: np.random.Generator, axis: Tree, pair: Tree, side: str, stiffness: float, motor: float
) -> None:
    """Add what an axis may have beside the spring, each on some."""
    if draw.random() < 0.3:
        pair[f"wall_{side}"] = {
            "position": 0.0,
            "stiffness": float(stiffness * draw.uniform(0.1, 2.0)),
        }
        axis["damping"] += pair[f"wall_{side}"]["stiffness"] * 2e-3
    if draw.random() < 0.2:
        axis["load"] = {"constant": float(motor * draw.uniform(-0.5, 0.5))}
    if draw.random() < 0.2:
        axis["coulomb"] = float(0.05 * motor * draw.uniform())
        axis["compensation"] = {
            "coulomb": float(draw.uniform(0.0, 0.7)),
            "viscous": float(draw.uniform(0.0, 0.3)),
        }
    if draw.random() < 0.2:
        axis["effort_quantum"] = float(motor * 10.0 ** draw.uniform(-4.0, -2.0))
        axis["coulomb"] = axis.get("coulomb", 0.0) + 3.4 * axis["effort_quantum"]


def is_certified(drawn: Drawn) -> bool:
    """Return whether the rig is passive as it was drawn."""
    return certify(drawn.rig).verdicts["passive"].passed


def edge_of(drawn: Drawn) -> Drawn | None:
    """Return the rig at the edge of its certificate: what both devices can spare is taken away."""
    rig = rig_of(drawn.tree)
    certificate = certify(rig)
    if not certificate.verdicts["passive"].passed:
        return None
    [coupling] = [one for one in certificate.elements if one.kind == "coupling"]
    numbers = coupling.numbers
    gentle = numbers["clipped_short"] > 0.0
    spare = -numbers["short" if gentle else "clipped_short"] - 1e-9 * max(numbers["damping_left"])
    out = drawn.tree
    for side, _ in SIDES:
        axis, pair = rig.axes[f"{side}.a"], rig.coupling.pairs["a"]
        own = 0.0 if axis.compensation is None else axis.compensation.viscous
        less = pair.in_device_units(side, spare) / (1.0 - own)
        out = with_damping(out, side, axis.damping.lower - less)
    return drawn._replace(tree=out, gentle=gentle)


class Attack(NamedTuple):
    """The best that adversaries got: on the product, as a share of the gross flow, and how."""

    share: float
    motions: int


def friction_of(rig: Rig) -> Friction:
    """Return what both devices have for certain, and how a scaled pair counts their energies."""
    axes, pair = [rig.axes[f"{side}.a"] for side, _ in SIDES], rig.coupling.pairs["a"]
    return Friction(
        (axes[0].damping.lower, axes[1].damping.lower),
        (axes[0].coulomb.lower, axes[1].coulomb.lower),
        (1.0, 1.0 / (pair.effective_force_scale * pair.position_scale)),
    )


def suspected(drawn: Drawn, rig: Rig, *, alike: bool) -> Suspected:
    """Return the spring as suspected, in device units; `alike`: both ends are clipped alike."""
    pair: Any = rig.coupling.pairs["a"]
    force, ratio = pair.effective_force_scale, pair.sign * pair.position_scale
    period, line = rig.period_s, rig.delay_samples
    injection = float(getattr(pair, "injection", 0.0))
    taps = []
    clips, walls = [], []
    for end, (side, bus) in enumerate(SIDES):
        late = round(
            drawn.tree["buses"][bus].get("options", {}).get("command_delay_s", 0.0) / period
        )
        back = (1.0, 1.0 / ratio) if end == 0 else (ratio, 1.0)
        unit = 1.0 if end == 0 else force / pair.position_scale
        for of in (0, 1):
            lag = late + (line if of != end else 0)
            sign = unit * back[of] * (1.0 if of == end else -1.0)
            taps.append((end, of, lag, sign * (pair.stiffness + pair.damping / period)))
            taps.append((end, of, lag + 1, -sign * pair.damping / period))
            if of == end:
                taps.append((end, of, lag, unit * injection / period))
                taps.append((end, of, lag + 1, -unit * injection / period))
        axis = rig.axes[f"{side}.a"]
        load = 0.0 if axis.load is None else 1.1 * abs(axis.load.constant)
        wall = pair.wall_master if end == 0 else pair.wall_slave
        share = axis.effort_limit - load
        clips.append(share if wall is None else 0.5 * share)
        walls.append(
            (0.0, 0.0, 0.0) if wall is None else (wall.stiffness, wall.position, 0.5 * share)
        )
    if alike:
        least = min(clips[0], clips[1] / force)
        clips = [least, least * force]
    return Suspected(taps, (clips[0], clips[1]), (walls[0], walls[1]), friction_of(rig), period)


def attack(drawn: Drawn, seed: int, *, tries: int = 60, climbed: int = 2) -> Attack:
    """Move both ends of a rig in every way that may pay, and return what paid best."""
    rig = drawn.rig
    draw = np.random.default_rng(seed)
    pair: Any = rig.coupling.pairs["a"]
    found, motions = -1.0, 0
    for alike in (True, False):
        model = suspected(drawn, rig, alike=alike)
        stretch = min(model.clips[0] / drawn.stiffness, 1.0)
        units = np.array([[1.0], [pair.sign * pair.position_scale]])
        starts = [motion * units for motion in drawn_motions(draw, stretch, drawn.memory)]
        starts.sort(key=lambda motion: -model.lap(motion).share)
        for start in starts[:climbed]:
            best, _ = model.climb(draw, start, tries)
            if drawn.gentle:
                best = best * min(1.0, 0.9 / max(model.pressed(best), 0.1))
            gain = lap_of(rig, best, model.friction, drawn.memory)
            found, motions = max(found, gain.share), motions + 1
    if not drawn.gentle and rig.axes["master.a"].load is None and rig.axes["slave.a"].load is None:
        kick = 0.3 * stretch * draw.normal(size=2)
        gain = greedy_gain(rig, model.friction, kick, 400)
        found, motions = max(found, gain.share), motions + 1
    return Attack(found, motions)
