"""Work-precision diagrams of shipped scenes: every scheme at every step, SciPy beside."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction

from tautwave.bench.peers.network import scipy_network
from tautwave.bench.workprecision.points import Point, Scene
from tautwave.bench.workprecision.scenes import FACTORS, NAMES, SceneRig, Stage, schemes_of
from tautwave.rig.scene.network import scheme_choice
from tautwave.scene.network import Network
from tautwave.simulation.scene.playing import Played


def scheme_points(
    stage: Stage, oracle: Played, factors: Sequence[Fraction], rounds: int
) -> Iterable[Point]:
    """Yield every scheme of tautwave at every step, except the oracle itself."""
    for scheme in schemes_of(stage.network):
        for factor in factors:
            if 4 * factor > stage.finest:
                continue  # too close to the oracle to be compared with it
            found = timed(stage, scheme, factor, oracle, rounds)
            if found is not None:
                yield found


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
    scene: SceneRig, full: bool, max_error: float, rounds: int, tolerances: Sequence[float]
) -> Scene:
    """Return all schemes on a shipped scene, and SciPy's where it is installed.

    Parameters
    ----------
    full : bool
        More steps over more decades.
    max_error : float
        What the chosen point is held against: what `scheme: auto` takes at the rig's own rate
        (in three dimensions, where there is no such choice, the rig's scheme).
    rounds : int
        Timings of each run.
    tolerances : sequence of float
        Of SciPy.
    """
    stage = Stage(scene)
    oracle = stage.run(schemes_of(stage.network)[0], Fraction(stage.finest))
    assert oracle is not None
    points = list(scheme_points(stage, oracle, FACTORS[full], rounds))
    points += scipy_network(stage, oracle, tolerances)
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
        f"{scene.what} ({scene.shipped}, {scene.span_s:g} s from {scene.begin_s:g} s on); error: "
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
    if any(link.kind == "contact" for link in stage.network.links):
        notes.append("scenes with contacts are chaotic: over longer spans any two steps diverge")
    return tuple(notes)
