"""Shared parts of certificate pictures: a frequency axis, and the caption of a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENE = (
    "The damping that the linear part of the scene, contacts open, needs from the device at each "
    "frequency: it is passive for any hand where the device has more. With contacts closed: "
    "see the text."
)


def decades(panel: Axes) -> None:
    """Label a logarithmic frequency axis at decades with plain numbers."""
    from matplotlib.ticker import LogLocator, NullFormatter

    panel.xaxis.set_major_locator(LogLocator(numticks=5))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
