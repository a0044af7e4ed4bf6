"""What the pictures of certificates share: an axis of frequencies, and words under a scene."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCENE = (
    "The damping that the linear part of the scene, contacts open, needs from the device at each "
    "frequency: it is passive for any hand where the device has more."
)


def decades(panel: Axes) -> None:
    """Number a logarithmic frequency axis at decades, plainly."""
    from matplotlib.ticker import LogLocator, NullFormatter

    panel.xaxis.set_major_locator(LogLocator(numticks=5))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
