"""A scene as the controller of its axes: what `tautwave.rig.hooks` asks for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tautwave.config import Rig
from tautwave.config.keys.scene3d import Scene3d
from tautwave.rig.scene.network import build_scene
from tautwave.runtime.control import Control
from tautwave.runtime.scene.axes import SceneControl
from tautwave.types import CommandDelay


def build(rig: Rig, delays: Mapping[str, CommandDelay], cycles: int) -> SceneControl:
    """Return the controller of a rig with a scene; a one-dimensional one loads no 3D code."""
    if not isinstance(rig.scene, Scene3d):
        return build_scene(rig, delays, cycles)
    from tautwave.rig.scene.network3d import build_network3d

    return build_network3d(rig, delays, cycles)


def order(control: Control) -> Sequence[int]:
    """Return the axes of the ports."""
    assert isinstance(control, SceneControl)
    return control.ports
