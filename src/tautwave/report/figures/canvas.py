"""Traces, contacts and elements on the panels of `tautwave.canvas`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.canvas import LIMIT, SHADE, plain
from tautwave.report.figures.envelope import Trace
from tautwave.report.run.contacts import Contact, united
from tautwave.report.run.stop import Stop

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw(axes: Axes, line: Trace | None, factor: float, label: str, **style: Any) -> None:
    """Draw one trace, multiplied by `factor`, if it exists.

    Noise is drawn pale behind its mean, so that both stay visible.
    """
    if line is None or not line.time.size:
        return
    shown = line.times(factor)
    if shown.middle_time is not None and shown.middle is not None and line.is_rough():
        axes.plot(shown.time, shown.value, color=style.get("color"), alpha=0.3, linewidth=0.5)
        axes.plot(shown.middle_time, shown.middle, label=label, **style)
    else:
        axes.plot(shown.time, shown.value, label=label, **style)


def shade(axes: Axes, contacts: Sequence[Contact], label: str = "", colour: str = SHADE) -> None:
    """Shade the times of contact; one collection, however many contacts there are."""
    if not contacts:
        return
    from matplotlib.collections import PolyCollection

    low, high = np.array(united(contacts)).T
    corners = np.stack(
        [
            np.stack([low, np.zeros_like(low)], axis=1),
            np.stack([low, np.ones_like(low)], axis=1),
            np.stack([high, np.ones_like(low)], axis=1),
            np.stack([high, np.zeros_like(low)], axis=1),
        ],
        axis=1,
    )
    # An edge keeps contacts of a millisecond visible on a plot of an hour.
    boxes = PolyCollection(
        list(corners),
        facecolor=colour,
        edgecolor=colour,
        linewidth=0.4,
        alpha=0.45,
        transform=axes.get_xaxis_transform(),
        zorder=0.5,
        label=label,
    )
    axes.add_collection(boxes, autolim=False)


def mark_stop(
    axes: Axes, stop: Stop | None, *, labelled: bool = True, reason: bool = False
) -> None:
    """Draw a line across the panel where the run was stopped, and the reason."""
    if stop is not None:
        label = plain(stop.label(reason=reason)) if labelled else "_"
        axes.axvline(stop.at_s, color=LIMIT, linewidth=1.6, label=label)


def label_of(element: str) -> str:
    """`wall_master` as `wall master`."""
    return element.replace("_", " ")
