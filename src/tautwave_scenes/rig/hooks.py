"""A scene as the controller of its axes: what `tautwave.rig.hooks` asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tautwave.config import Rig
from tautwave.runtime.control import Control
from tautwave.types import CommandDelay
from tautwave_scenes.config.keys3d import Scene3d
from tautwave_scenes.rig.network import build_scene
from tautwave_scenes.runtime.axes import SceneControl


def build(rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> SceneControl:
    """Return the controller of a rig with a scene; a one-dimensional one loads no 3D code."""
    if not isinstance(rig.scene, Scene3d):
        return build_scene(rig, delays, cycles)
    from tautwave_scenes.rig.network3d import build_network3d

    return build_network3d(rig, delays, cycles)


def order(control: Control) -> Sequence[int]:
    """Return the axes of the ports."""
    assert isinstance(control, SceneControl)
    return control.ports
