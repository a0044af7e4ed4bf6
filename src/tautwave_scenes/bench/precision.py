"""A scene along its hand's motion, by every scheme, at steps over decades.

The ports follow the rig's hand reference, sampled in the middle of each step (the symplectic
scheme: at its begin): what a loop adds by holding them for a period is in the report of a
run. Scenes with many contacts are chaotic, so the spans are short.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.bench.precision.points import Point, Scene
from tautwave.config import Hand, Rig, load_rig
from tautwave.errors import ConfigError
from tautwave.motion import reference_positions
from tautwave_scenes.models.link_kinds import LINK_KINDS, is_linear
from tautwave_scenes.networks.network import Network, String
from tautwave_scenes.networks3d.network import Network3d
from tautwave_scenes.report.inputs import stage_of
from tautwave_scenes.rig.network import scheme_choice
from tautwave_scenes.simulation.playing import Played, play

Array = npt.NDArray[np.float64]

NAMES = {
    "exact": "exact",
    "discrete_gradient": "discrete_gradient",
    "linearly_implicit": "linearly_implicit",
    "symplectic": "symplectic_euler",
    "rk4": "rk4",
}
"""What the schemes of a scene are called in the diagrams."""

WITHIN = {"symplectic": 0.0, "rk4": 1.0}
"""Where in a step a port is seen; else in its middle. With rk4 it has moved there at its end."""

FINEST = 256
"""Steps to a period of the rig with which the oracle runs."""

FINEST_IN_SPACE = 32
"""As many in three dimensions, where plain Python takes them."""

FACTORS = {
    False: tuple(map(Fraction, ("1/8", "1/4", "1/2", "1", "2", "4", "16", "64"))),
    True: tuple(Fraction(2) ** power for power in range(-4, 8)),
}


class SceneRig(NamedTuple):
    """A rig file with a scene under its name in the tables, and the part that is compared [s]."""

    name: str
    path: Path
    begin_s: float
    span_s: float
    what: str
    changes: tuple[str, ...] = ()

    def load(self) -> Rig:
        """Return the rig."""
        return _loaded(self.path, self.changes)


@lru_cache
def _loaded(path: Path, changes: tuple[str, ...]) -> Rig:
    return load_rig(path, changes)


def schemes_of(network: Network | Network3d) -> tuple[str, ...]:
    """Return the schemes that can run a network, that of the oracle first."""
    if isinstance(network, Network3d):
        return ("discrete_gradient", "linearly_implicit", "symplectic")
    if network.strings:
        return ("discrete_gradient",)
    linear = all(is_linear(link.kind) for link in network.links)
    kutta = ("rk4",) if all(LINK_KINDS[link.kind].potential for link in network.links) else ()
    return (*(("exact",) if linear else ()), "discrete_gradient", "symplectic", *kutta)


def refined(string: String, factor: Fraction) -> String | None:
    """Return a string of the same pitch at another rate; None where its samples are not whole."""
    near, far = factor * (string.near + 1), factor * (string.far + 1)
    if near.denominator > 1 or far.denominator > 1 or min(near, far) < 2:
        return None
    kept = (1.0 - string.smoothing) ** (1.0 / float(factor))
    return string._replace(near=int(near) - 1, far=int(far) - 1, smoothing=1.0 - kept)


class Stage:
    """A scene with its inputs, to be run at any step. In three dimensions by plain Python only."""

    def __init__(self, scene: SceneRig, engine: str = "compiled") -> None:
        self.scene = scene
        self.rig = scene.load()
        self.parts = stage_of(self.rig)
        self.network = self.parts.network
        flat = isinstance(self.network, Network)
        self.engine = engine if flat else "python"
        self.finest = FINEST if flat else FINEST_IN_SPACE
        rate = self.rig.rate_hz
        self.slots = round(scene.span_s * rate / 16) * 16
        first = round(scene.begin_s * rate)
        forces = self.parts.forces(self.rig, round(self.rig.duration_s * rate))
        self.forces = [np.asarray(force)[first : first + self.slots + 1] for force in forces]
        self._fine = self._positions(first)

    def _positions(self, first: int) -> Array:
        """Return the positions of the axes at the oracle's half steps [m], shape (n, p)."""
        assert self.rig.simulation is not None
        rate = 2 * self.finest * self.rig.rate_hz
        begin, last = (2 * self.finest * at for at in (first, first + self.slots))
        columns = []
        parts = self.parts
        for name, scale, offset in zip(parts.names, parts.scales, parts.offsets, strict=True):
            hand = self.rig.simulation.hand.get(name)
            places = np.zeros(last - begin + 1)
            if isinstance(hand, Hand):
                reference = hand.reference.model_dump()
                places = reference_positions(reference, rate, last, Path())[begin:]
            columns.append(scale * places + offset)
        return np.stack(columns, axis=1)

    @property
    def span_s(self) -> float:
        """Simulated time [s]."""
        return self.slots * self.rig.period_s

    def ports(self, factor: Fraction, within: float) -> Array:
        """Return the positions of the ports at each step [m], shape (steps, p)."""
        every = int(2 * self.finest / factor)
        return self._fine[round(within * every) :: every][: int(self.slots * factor)]

    def pushes(self, factor: Fraction, within: float) -> Array:
        """Return the external forces at each step [N], linear between slots."""
        steps = int(self.slots * factor)
        slot = (np.arange(steps) + within) / float(factor)
        pushes = np.zeros((steps, len(self.forces)))
        for at, force in enumerate(self.forces):
            pushes[:, at] = np.interp(slot, np.arange(len(force)), force)
        return pushes

    def moment(self, time_s: float) -> tuple[Array, Array, Array]:
        """Return position and speed of the ports and the external forces at any time."""
        at = time_s * self.rig.rate_hz * 2 * self.finest
        low = min(max(int(at), 0), len(self._fine) - 2)
        rise = self._fine[low + 1] - self._fine[low]
        slot = min(time_s * self.rig.rate_hz, float(self.slots))
        one = min(int(slot), self.slots - 1)
        share = slot - one
        push = [(1.0 - share) * force[one] + share * force[one + 1] for force in self.forces]
        speed = rise * (self.rig.rate_hz * 2 * self.finest)
        return self._fine[low] + (at - low) * rise, speed, np.array(push)

    def run(self, scheme: str, factor: Fraction) -> Played | None:
        """Return the scene with `factor` steps to a period of the rig; None where it cannot.

        Rows are slots of the rig, or steps if those are longer.
        """
        strings = [refined(string, factor) for string in self.parts.strings]
        if None in strings or (self.slots * factor).denominator > 1 or factor > self.finest:
            return None
        parts = self.parts
        if strings and isinstance(self.network, Network):
            finer = tuple(string for string in strings if string is not None)
            parts = parts._replace(network=self.network._replace(strings=finer))
        within = WITHIN.get(scheme, 0.5)
        model = parts.model(scheme, float(self.rig.period_s / factor))
        model.reset(self._fine[0].tolist())
        given = self.ports(factor, within), self.pushes(factor, min(within, 0.5))
        return play(model, *given, engine=self.engine, stride=max(1, int(factor)))

    def error(self, places: Array, oracle: Played) -> float:
        """Return the rms distance of the nodes from the oracle's, over their greatest travel."""
        every = self.slots // len(places)
        gap = places - oracle.places[every - 1 :: every]
        if not np.isfinite(gap).all():
            return math.inf
        travel = float(np.ptp(oracle.places, axis=0).max())
        return max(float(np.sqrt(np.mean(gap * gap))) / travel, 1e-17)

    def energy_error(self, played: Played, oracle: Played) -> float:
        """Return the energy that the scheme created or lost, over the energy through the ports."""
        ledger = played.ledger
        made = abs(ledger.numeric) + abs(ledger.residual(played.start))
        places = self.ports(Fraction(1), 0.0)
        moved = np.abs(np.diff(places, axis=0) * oracle.efforts[:-1]).sum()
        whole = float(moved) + oracle.ledger.lost + oracle.ledger.energy
        return max(made / whole, 1e-17) if math.isfinite(made) else math.inf


Peers = Callable[[Stage, Played], Iterable[Point]]


def no_peers(_stage: Stage, _oracle: Played) -> Iterable[Point]:
    """Yield nothing."""
    return ()


def scheme_points(
    stage: Stage, oracle: Played, factors: Sequence[Fraction], rounds: int
) -> Iterable[Point]:
    """Yield every scheme of tautwave at every step, except the oracle itself."""
    for scheme in schemes_of(stage.network):
        for factor in factors:
            if 4 * factor > stage.finest:
                continue  # too close to the oracle to be compared with it
            timing = timed(stage, scheme, factor, oracle, rounds)
            if timing is not None:
                yield timing


def timed(stage: Stage, scheme: str, factor: Fraction, oracle: Played, rounds: int) -> Point | None:
    """Return one scheme at one step; the best of some runs counts."""
    played = stage.run(scheme, factor)
    if played is None:
        return None
    spent = played.cpu_s
    for _ in range(rounds if spent < 0.2 else 1):
        again = stage.run(scheme, factor)
        assert again is not None
        spent = min(spent, again.cpu_s)
    return Point(
        stage.scene.name,
        NAMES[scheme],
        float(stage.rig.period_s / factor),
        stage.error(played.places, oracle),
        stage.energy_error(played, oracle),
        spent / stage.span_s,
    )


def network_scene(
    scene: SceneRig, full: bool, max_error: float, rounds: int, peers: Peers = no_peers
) -> Scene:
    """Return all schemes on a scene.

    Parameters
    ----------
    full : bool
        More steps over more decades.
    max_error : float
        What the chosen point is held against: what `scheme: auto` takes at the rig's own rate
        (in three dimensions, where there is no such choice, the rig's scheme).
    rounds : int
        Timings of each run.
    peers : callable
        Yields points of other software from the stage and its oracle.
    """
    stage = Stage(scene)
    oracle = stage.run(schemes_of(stage.network)[0], Fraction(stage.finest))
    assert oracle is not None
    if not float(np.ptp(oracle.places, axis=0).max()) > 0.0:
        raise ConfigError(
            f"{scene.path}: nothing moves from {scene.begin_s:g} s on for {scene.span_s:g} s, so "
            "there is no error to compare; choose another part with --begin"
        )
    points = list(scheme_points(stage, oracle, FACTORS[full], rounds))
    points += peers(stage, oracle)
    own = stage.parts.scheme
    label = "the rig"
    why = f"{own} at {stage.rig.rate_hz:g} Hz is what the rig runs"
    if isinstance(stage.network, Network):
        choice = scheme_choice(stage.rig)
        why += f"; auto takes {choice.why}"
        own, label = choice.scheme, "auto"
    chosen = timed(stage, own, Fraction(1), oracle, rounds)
    assert chosen is not None
    best = min(
        (p for p in points if not p.peer and p.error <= max_error),
        key=lambda p: p.cpu_s,
        default=None,
    )
    if best is not None:
        why += f"; cheapest for {max_error:g}: {best.method} at {1.0 / best.step_s:.4g} Hz"
    rate = f"{stage.rig.rate_hz / 1e3:.4g} kHz"
    what = (
        f"{scene.what} ({scene.path.name}, {scene.span_s:g} s from {scene.begin_s:g} s on); error: "
        "rms distance of all nodes over their travel from "
        f"{schemes_of(stage.network)[0]} with {stage.finest} steps a period, ports moving in them"
    )
    return Scene(scene.name, what, tuple(points), chosen, why, _notes(stage), f"{label} at {rate}")


def _notes(stage: Stage) -> tuple[str, ...]:
    notes = []
    if stage.engine == "python":
        notes.append("times are those of plain Python: nothing else steps a scene in space")
    if stage.parts.strings:
        notes.append(
            "a string's samples are whole, so coarser steps would be another pitch; its point has "
            "no mass, and where the bow lets go is found to a sample: first order"
        )
    if any(LINK_KINDS[link.kind].one_way for link in stage.network.links):
        notes.append("scenes with contacts are chaotic: over longer spans any two steps diverge")
    return tuple(notes)
