"""The certificate of a scene: what `tautwave.certificate.hooks` asks for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from tautwave.certificate.data import Certificate
from tautwave.config import Rig
from tautwave.types import CommandDelay
from tautwave_scenes.certificate.caption import SCENE
from tautwave_scenes.config.keys3d import Scene3d

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def certificate(
    rig: Rig, delays: Mapping[str, CommandDelay], passes: Mapping[str, str]
) -> Certificate:
    """Return the certificate of a rig with a scene."""
    if isinstance(rig.scene, Scene3d):
        from tautwave_scenes.certificate3d.verdict import scene3d_certificate

        return scene3d_certificate(rig, delays, passes)
    from tautwave_scenes.certificate.verdict import scene_certificate

    return scene_certificate(rig, delays, passes)


def figure(rig: Rig, delays: Mapping[str, CommandDelay]) -> Figure:
    """Return the picture of the certificate."""
    if isinstance(rig.scene, Scene3d):
        from tautwave_scenes.certificate3d.picture import scene3d_certificate

        return scene3d_certificate(rig, delays)
    from tautwave_scenes.certificate.picture import scene_certificate

    return scene_certificate(rig, delays)


def caption() -> str:
    """Return the caption of the picture."""
    return SCENE
