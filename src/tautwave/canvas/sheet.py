"""Panels, headings and legends: the layout of every figure of a report, a certificate or a bench.

A figure is as wide as a page's column, with text that is readable at half that size. Legends stand
above their panel, under its heading, in as many columns as fit, so that they take no width.
Matplotlib's objects, never pyplot.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from tautwave.canvas.palette import INK, PAPER, SOFT
from tautwave.canvas.style import FONT, Style, current, settings

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.font_manager import FontProperties


MIN_LINE = 1.4
"""Text size in a page's legend [pt]."""


@dataclass
class _Panel:
    heading: str = ""
    entries: list[tuple[Any, str]] = field(default_factory=list)
    lines: list[tuple[str, str]] | None = None
    legend: bool = False
    ahead: str = ""


@dataclass
class _Sheet:
    style: Style
    title: str
    rows: list[list[Axes]]
    heights: list[float]
    panels: dict[Axes, _Panel]
    key: bool = False
    arranged: bool = False


_sheets: WeakKeyDictionary[Figure, _Sheet] = WeakKeyDictionary()


def style_of(figure: Figure) -> Style:
    """Return the style of a figure."""
    return _sheets[figure].style


def panels(
    heights: Sequence[float], title: str, share: bool | Sequence[bool] = True, columns: int = 1
) -> tuple[Figure, list[Axes]]:
    """Return a figure with panels below each other, and its panels in reading order.

    Parameters
    ----------
    heights : row heights [inch] at the page's width, without headings, legends and numbers
    share : which panels use the first one's horizontal axis; True means all
    columns : panels in each row; on a narrow page they are below each other
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    style = current()
    count = len(heights) * columns
    if style.narrow:
        heights, columns = [height for height in heights for _ in range(columns)], 1
    shared = [share] * count if isinstance(share, bool) else list(share)
    with matplotlib.rc_context(settings(style)):
        figure = Figure(figsize=(style.width, 1.0), facecolor=PAPER, edgecolor=PAPER)
        FigureCanvasAgg(figure)
        axes: list[Axes] = []
        for at in range(count):
            first = axes[0] if shared[at] and axes else None
            # The panels are placed by `arrange`, once everything is known.
            panel = figure.add_axes((0.1, 0.1, 0.8, 0.8), label=str(at), sharex=first)
            panel.margins(x=0)
            axes.append(panel)
        for at in range(count - columns):
            # A panel above one with the same axis needs no numbers.
            if shared[at] and shared[at + columns]:
                axes[at].tick_params(labelbottom=False)
    rows = [axes[at : at + columns] for at in range(0, count, columns)]
    entries = {panel: _Panel() for panel in axes}
    _sheets[figure] = _Sheet(style, plain(title), rows, list(heights), entries)
    return figure, axes


def plain(text: str) -> str:
    """A name from a rig file or a path, escaped from matplotlib's formulas and hidden labels."""
    return ("\u200b" if text.startswith("_") else "") + text.replace("$", r"\$")


def heading(axes: Axes, text: str) -> None:
    """Give one panel its title, left-aligned."""
    _panel(axes).heading = text


def legend(axes: Axes, title: str = "") -> None:
    """Give a panel its legend, above the data; `title` precedes the first entry."""
    panel = _panel(axes)
    panel.legend, panel.ahead = True, title.replace("\n", " ")


def key(figure: Figure) -> None:
    """Give a figure one legend for all of its panels, under its title."""
    _sheets[figure].key = True


def text_panel(axes: Axes, lines: Sequence[tuple[str, str]]) -> None:
    """Fill a panel with sentences: colour and text of each, wrapped where needed."""
    axes.set_axis_off()
    _panel(axes).lines = list(lines)


def note(axes: Axes, text: str) -> None:
    """Say in a panel why it is empty."""
    axes.set_axis_off()
    axes.text(0.0, 0.5, plain(text), color=SOFT, va="center", transform=axes.transAxes, wrap=True)


def _panel(axes: Axes) -> _Panel:
    figure = axes.get_figure(root=True)
    assert figure is not None
    return _sheets[figure].panels[axes]


def _letters(style: Style, share: float, weight: str = "normal") -> FontProperties:
    from matplotlib.font_manager import FontProperties

    return FontProperties(family=[style.family, FONT], size=share * style.size, weight=weight)


def _width(figure: Figure, text: str, letters: FontProperties) -> float:
    """Return the width of a text [inch]."""
    renderer: Any = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    return float(renderer.get_text_width_height_descent(text, letters, False)[0]) / figure.dpi


LEAST_LINE = 12
"""Letters of the shortest line that a text is wrapped into."""


def _wrapped(figure: Figure, text: str, letters: FontProperties, room: float) -> list[str]:
    whole = _width(figure, text, letters)
    if whole <= room or not text:
        return [text]
    letters_a_line = max(LEAST_LINE, int(len(text) * room / whole))
    while True:
        lines = textwrap.wrap(text, letters_a_line)
        if letters_a_line <= LEAST_LINE or max(_width(figure, s, letters) for s in lines) <= room:
            return lines
        letters_a_line -= 1


def _columns(figure: Figure, labels: Sequence[str], room: float, style: Style) -> int:
    """Return in how many columns a legend fits into `room` [inch]; matplotlib fills them down."""
    letters = _letters(style, 0.9)
    em = style.size * 0.9 / 72.0
    each = [_width(figure, label, letters) + 2.3 * em for label in labels]
    for columns in range(len(each), 1, -1):
        tall, rest = divmod(len(each), columns)
        ends, at = [], 0
        for column in range(columns):
            count = tall + (column < rest)
            ends.append(max(each[at : at + count]))
            at += count
        if sum(ends) + 1.2 * em * (columns - 1) <= room:
            return columns
    return 1


def _entries(panel: Axes, settings: _Panel) -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    handles, labels = panel.get_legend_handles_labels()
    labels = [label.replace("\n", " ") for label in labels]
    if settings.ahead and handles:
        handles, labels = [Line2D([], [], linestyle=" "), *handles], [settings.ahead, *labels]
    return list(handles), labels


def _draw_legend(
    panel: Any, handles: list[Any], labels: list[str], columns: int, style: Style, **where: Any
) -> None:
    made = panel.legend(
        handles,
        labels,
        ncols=columns,
        frameon=False,
        prop=_letters(style, 0.9),
        handlelength=1.5,
        handletextpad=0.5,
        columnspacing=1.2,
        labelspacing=0.25,
        borderaxespad=0.0,
        borderpad=0.0,
        alignment="left",
        **where,
    )
    for line in made.get_lines():  # a single thin line looks paler than many
        line.set_linewidth(max(line.get_linewidth(), MIN_LINE * style.stroke))


def arrange(figure: Figure) -> None:
    """Place every panel, with headings and legends; called before painting."""
    import matplotlib

    sheet = _sheets[figure]
    if sheet.arranged:
        return
    sheet.arranged = True
    with matplotlib.rc_context(settings(sheet.style)):
        _thicken(sheet)
        for panel in sheet.panels:
            for text in panel.texts:  # created in matplotlib's own default font
                text.set_fontproperties(_letters(sheet.style, 0.9))
        _Layout(figure, sheet).run()


def _thicken(sheet: _Sheet) -> None:
    """Scale lines and marks with the text size; drawings keep those of a page."""
    share = sheet.style.stroke
    if share == 1.0:
        return
    for panel in sheet.panels:
        for line in panel.lines:
            line.set_linewidth(share * line.get_linewidth())
            line.set_markersize(share * line.get_markersize())
            line.set_markeredgewidth(share * line.get_markeredgewidth())
        for patch in panel.patches:
            patch.set_linewidth(share * patch.get_linewidth())
        for many in panel.collections:
            many.set_linewidth((share * np.atleast_1d(many.get_linewidth())).tolist())


class _Layout:
    """Computes the places of one sheet's panels, from the top down [inch]."""

    def __init__(self, figure: Figure, sheet: _Sheet) -> None:
        self.figure, self.sheet, self.style = figure, sheet, sheet.style
        self.em = sheet.style.size / 72.0
        self.texts: list[tuple[str, float, dict[str, Any]]] = []
        self.boxes: list[tuple[Axes, float, float, float, float]] = []
        self._sized()
        renderer: Any = figure.canvas.get_renderer()  # type: ignore[attr-defined]
        columns = len(sheet.rows[0])
        self.left = [
            max(_left_of(row[at], renderer) for row in sheet.rows) for at in range(columns)
        ]
        self.right = [
            max(1.1 * self.em, *(_right_of(row[at], renderer) for row in sheet.rows))
            for at in range(columns)
        ]
        self.room = (self.style.width - sum(self.left) - sum(self.right)) / columns
        self.top = 0.5 * self.em

    def _sized(self) -> None:
        """Give every panel its approximate size, so that it gets its final tick labels."""
        width, columns = self.style.width, len(self.sheet.rows[0])
        whole = self.style.height * sum(self.sheet.heights)
        self.figure.set_size_inches(width, whole)
        for row, height in zip(self.sheet.rows, self.sheet.heights, strict=True):
            tall = height * self.style.height / whole
            for panel in row:
                panel.set_position((0.1, 0.0, 1.0 / columns - 0.12, tall))

    def run(self) -> None:
        """Lay out title, common legend and rows, then place them."""
        figure, em, width = self.figure, self.em, self.style.width
        if self.style.titled and self.sheet.title:
            letters = _letters(self.style, 1.2, "bold")
            lines = _wrapped(figure, self.sheet.title, letters, width - em)
            text_style = {"fontproperties": letters}
            self.texts.append(("\n".join(lines), self.top, text_style))
            self.top += 1.7 * em * len(lines)
        common = self._common() if self.sheet.key else None
        key_top = self.top
        if common is not None:
            self.top += 1.2 * em * -(-len(common[1]) // common[2]) + 0.4 * em
        for row, height in zip(self.sheet.rows, self.sheet.heights, strict=True):
            if self.sheet.panels[row[0]].lines is None:
                self._row(row, height)
            else:
                self._draw_text(row[0])
        whole = self.top + 0.2 * em
        figure.set_size_inches(width, whole)
        for panel, x, y, wide, tall in self.boxes:
            panel.set_position((x / width, 1.0 - (y + tall) / whole, wide / width, tall / whole))
        edge = 0.6 * em / width
        for text, y, style in self.texts:
            figure.text(edge, 1.0 - y / whole, text, va="top", **style)
        if common is not None:
            anchor = (edge, 1.0 - key_top / whole)
            _draw_legend(figure, *common, self.style, loc="upper left", bbox_to_anchor=anchor)

    def _common(self) -> tuple[list[Any], list[str], int]:
        """Return the common legend of all panels, without duplicates."""
        handles: list[Any] = []
        labels: list[str] = []
        for panel in self.sheet.panels:
            for handle, label in zip(*_entries(panel, _Panel()), strict=True):
                if label not in labels:
                    handles.append(handle)
                    labels.append(label)
        room = self.style.width - self.em
        return handles, labels, _columns(self.figure, labels, room, self.style)

    def _row(self, row: list[Axes], height: float) -> None:
        em, style = self.em, self.style
        letters = _letters(style, 1.0)
        heads, keys, deep = [], [], []
        for panel in row:
            settings = self.sheet.panels[panel]
            heads.append(_wrapped(self.figure, settings.heading, letters, self.room))
            handles, labels = _entries(panel, settings) if settings.legend else ([], [])
            ways = _columns(self.figure, labels, self.room, style) if labels else 1
            keys.append((handles, labels, ways))
            deep.append(-(-len(labels) // ways))
        lines = max(len(head) if head[0] else 0 for head in heads)
        self.top += 1.35 * em * lines + 1.25 * em * max(deep) + 0.75 * em
        tall, x = height * style.height, 0.0
        for at, panel in enumerate(row):
            self.boxes.append((panel, x + self.left[at], self.top, self.room, tall))
            x += self.left[at] + self.room + self.right[at]
            if keys[at][1]:
                anchor = (0.0, 1.0 + 0.3 * em / tall)
                _draw_legend(panel, *keys[at], style, loc="lower left", bbox_to_anchor=anchor)
            above = style.size * (0.45 + 1.3 * max(deep))
            title = "\n".join(heads[at])
            # With a height given, matplotlib does not lay all numbers out again to look for some
            # above the panel.
            panel.set_title(title, loc="left", y=1.0, color=INK, fontsize=style.size, pad=above)
        self.top += tall + max(_below(panel, em) for panel in row)

    def _draw_text(self, panel: Axes) -> None:
        letters, room = _letters(self.style, 0.9), self.style.width - 1.5 * self.em
        self.top += 0.2 * self.em
        for colour, text in self.sheet.panels[panel].lines or ():
            for part in _wrapped(self.figure, plain(text), letters, room):
                self.texts.append((part, self.top, {"color": colour, "fontproperties": letters}))
                self.top += 1.3 * self.em
        self.boxes.append((panel, 0.1, self.top, 0.1, 0.1))
        self.top += 0.3 * self.em


def _left_of(panel: Axes, renderer: Any) -> float:
    """Return the width of the numbers and the label left of a panel [inch]."""
    if not panel.axison:
        return 0.1
    box = panel.yaxis.get_tightbbox(renderer)
    dpi = float(renderer.dpi)
    return 0.12 if box is None else (float(panel.bbox.x0) - float(box.x0)) / dpi + 0.08


def _right_of(panel: Axes, renderer: Any) -> float:
    """Return how far the last number below a panel extends past its right edge [inch]."""
    box = None
    if panel.axison and _is_numbered(panel):
        box = panel.xaxis.get_tightbbox(renderer)
    if box is None:
        return 0.0
    return (float(box.x1) - float(panel.bbox.x1)) / float(renderer.dpi) + 0.04


def _below(panel: Axes, em: float) -> float:
    """Return the height of the numbers and the label below a panel [inch]."""
    if not panel.axison:
        return 0.6 * em
    numbers = 1.7 * em if _is_numbered(panel) else 0.6 * em
    return numbers + (1.5 * em if panel.get_xlabel() else 0.0) + 0.4 * em


def _is_numbered(panel: Axes) -> bool:
    """Return whether there are numbers below a panel."""
    return bool(panel.xaxis.get_tick_params().get("labelbottom", True))
