"""Colours, panels and PNG bytes: what every figure shares. Matplotlib's objects, never pyplot.

The colours are Okabe and Ito's, told apart with every common colour blindness; master is always
blue, slave always vermilion, and the slave's lines are dashed where both mean the same thing.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from tautwave.report.contacts import Contact, united
from tautwave.report.envelope import Trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MASTER, SLAVE = "#0072B2", "#D55E00"
WALL, LINE, FILTER, DAMPER, INK, SOFT = (
    "#009E73",
    "#AA4499",
    "#56B4E9",
    "#E69F00",
    "#222222",
    "#767676",
)
SHADE, WALL_SHADE = "#B9C4CC", "#A5D8C6"
SIDE = {"master": MASTER, "slave": SLAVE}
_ELEMENT = {
    "port": INK,
    "line": LINE,
    "filter": FILTER,
    "converter": FILTER,
    "wall": WALL,
    "damper": DAMPER,
    "coupler": LINE,
}
_RC: Any = {  # matplotlib's stubs want its own keys, spelled as literals
    "font.family": "DejaVu Sans",
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.unicode_minus": True,
    "grid.color": "#E3E6E8",
    "grid.linewidth": 0.8,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 9.0,
    "legend.handlelength": 1.8,
    "legend.borderaxespad": 0.0,
    "xtick.color": "#333333",
    "ytick.color": "#333333",
}
WIDTH = 9.8  # inches; 1000 px wide on the page


def panels(
    heights: Sequence[float], title: str, share: bool | Sequence[bool] = True
) -> tuple[Figure, list[Axes]]:
    """A figure with panels of these heights [inch] above each other, room for legends at the right.

    Parameters
    ----------
    share : which panels have the first one's horizontal axis; True means all
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shared = [share] * len(heights) if isinstance(share, bool) else list(share)
    # Under a panel whose axis is not the next one's stand its own numbers and label.
    gaps = [0.42 if here and below else 0.78 for here, below in pairwise(shared)]
    top, bottom = 0.66, 0.52
    whole = sum(heights) + sum(gaps) + top + bottom
    with matplotlib.rc_context(_RC):
        figure = Figure(figsize=(WIDTH, whole), facecolor="white")
        FigureCanvasAgg(figure)
        axes: list[Axes] = []
        edge = whole - top
        for at, height in enumerate(heights):
            box = (0.085, (edge - height) / whole, 0.72, height / whole)
            panel = figure.add_axes(box, sharex=axes[0] if shared[at] and axes else None)
            panel.margins(x=0)
            axes.append(panel)
            if at < len(gaps):
                edge -= height + gaps[at]
                panel.tick_params(labelbottom=gaps[at] > 0.5)
        figure.text(0.085, 1.0 - 0.2 / whole, plain(title), weight="bold", size=12.5, va="top")
    return figure, axes


def plain(text: str) -> str:
    """A name from a rig file or a path, safe from matplotlib's formulas and hidden labels."""
    return ("\u200b" if text.startswith("_") else "") + text.replace("$", r"\$")


def heading(axes: Axes, text: str) -> None:
    """The title of one panel, at its left end."""
    axes.set_title(text, loc="left", fontsize=10.0, color="#333333")


def draw(axes: Axes, line: Trace | None, factor: float, label: str, **style: Any) -> None:
    """One trace, multiplied by `factor`; nothing when there is no such trace.

    Noise is drawn pale behind its mean, so that it neither hides nor is hidden.
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
    """A pale ground where there was contact; one collection, however many contacts there are."""
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


def legend(axes: Axes, title: str = "") -> None:
    """The legend, outside the data at the right."""
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        key = axes.legend(
            loc="upper left",
            bbox_to_anchor=(1.015, 1.02),
            title=title or None,
            frameon=False,
            fontsize=9.0,
            alignment="left",
            handlelength=1.8,
            borderaxespad=0.0,
        )
        key.get_title().set_fontsize(9.0)


def element_style(element: str) -> dict[str, Any]:
    """Colour by what an element is, blue and vermilion for ports, dashes for the slave's side."""
    what, _, side = element.partition("_")
    colour = SIDE[side] if what == "port" and side in SIDE else _ELEMENT.get(what, SOFT)
    return {"color": colour, "linestyle": "--" if side == "slave" and what != "port" else "-"}


def label_of(element: str) -> str:
    """`wall_master` as `wall master`."""
    return element.replace("_", " ")


def png(figure: Figure, dpi: float = 115.0) -> bytes:
    """The figure as PNG with a palette: a third of the bytes of a full-colour one."""
    import matplotlib
    from PIL import Image

    figure.set_dpi(dpi)
    with matplotlib.rc_context(_RC):
        canvas: Any = figure.canvas
        canvas.draw()
    picture = Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())
    # Of Pillow's ways this one alone keeps white white and a pale green patch green.
    cut = Image.Quantize.MEDIANCUT
    small = picture.quantize(colors=256, method=cut, dither=Image.Dither.NONE)
    out = io.BytesIO()
    small.save(out, format="PNG", compress_level=7)
    return out.getvalue()
