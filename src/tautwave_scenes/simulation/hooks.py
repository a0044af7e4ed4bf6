"""Simulation of scenes: what `tautwave.simulation.hooks` asks for."""

from __future__ import annotations

from tautwave.config import Rig
from tautwave_scenes.config.keys3d import Scene3d
from tautwave_scenes.simulation.live import simulate_scene as simulate
from tautwave_scenes.simulation.playing import is_kept

__all__ = ["is_compiled", "simulate"]


def is_compiled(rig: Rig) -> bool:
    """Return whether what a compiled scene runs is in the cache."""
    return is_kept(scene3d=isinstance(rig.scene, Scene3d))
