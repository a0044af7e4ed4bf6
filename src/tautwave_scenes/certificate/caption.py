"""The caption of a scene's certificate."""

from __future__ import annotations

SCENE = (
    "The damping that the linear part of the scene, contacts open, needs from the device at each "
    "frequency: it is passive for any hand where the device has more. With contacts closed: "
    "see the text."
)
