"""The shipped scenes that are measured, and SciPy beside them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

from tautwave.bench.precision.points import Scene
from tautwave.config.shipped import find_example
from tautwave_scenes.bench.precision import SceneRig, network_scene
from tests.lab.peers.network import scipy_network


def _shipped(name: str, begin_s: float, span_s: float, what: str) -> SceneRig:
    return SceneRig(name, find_example(f"{name}.yaml").path, begin_s, span_s, what)


RESONATOR = _shipped("scene-resonator", 0.2, 0.2, "the resonator pushed and let go")
GRANULAR = _shipped("scene-granular", 0.0, 0.1, "ten grains fall, bounce and meet the bar")
STRING = _shipped("scene-string", 0.0, 0.1, "the bow catches the string and lets it go")
DRUM = _shipped("scene-drum", 0.13, 0.07, "a stroke on the drum and its ringing")
NET = _shipped("scene-net", 0.1, 0.04, "a ball pressed into the net in space")
SCENES = (RESONATOR, GRANULAR, STRING, DRUM, NET)


def scene_with_peers(
    scene: SceneRig, full: bool, max_error: float, rounds: int, tolerances: Sequence[float]
) -> Scene:
    """Return all schemes on a scene, and SciPy's at these tolerances where it is installed."""
    peers = partial(scipy_network, tolerances=tolerances)
    return network_scene(scene, full, max_error, rounds, peers)
