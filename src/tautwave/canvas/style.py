"""Size and font of figures, and the matplotlib settings for them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, NamedTuple

from tautwave.canvas.palette import EDGE, GRID, INK
from tautwave.errors import ConfigError

FONT = "DejaVu Sans"


class Style(NamedTuple):
    """Size and font of a figure.

    Attributes
    ----------
    width : float
        [inch]
    size : float
        Font size [pt].
    family : str
        Font family.
    titled : bool
        Whether the figure carries its own title; a paper has a caption instead.
    """

    width: float = 6.8
    size: float = 9.5
    family: str = FONT
    titled: bool = True

    @property
    def stroke(self) -> float:
        """Scale of lines and marks relative to a page's; the same as that of the text."""
        return self.size / 9.5

    @property
    def narrow(self) -> bool:
        """Whether two panels beside each other have too little room for their words."""
        return self.width < 0.7 * PAGE.width * self.stroke

    @property
    def height(self) -> float:
        """Scale of panel heights relative to a page's."""
        return min(max(self.width / 6.8, 0.6), 1.3)


PAGE = Style()
_current: ContextVar[Style] = ContextVar("style", default=PAGE)


@contextmanager
def styled(style: Style) -> Iterator[None]:
    """Give every figure begun inside the block this style."""
    token = _current.set(style)
    try:
        yield
    finally:
        _current.reset(token)


def find_font(name: str) -> str:
    """Return an installed font family, by its name.

    Raises
    ------
    ConfigError
        There is no such font; the message lists the nearest ones.
    """
    from difflib import get_close_matches

    from matplotlib.font_manager import fontManager

    known = {family.lower(): family for family in fontManager.get_font_names()}
    if name.lower() in known:
        return known[name.lower()]
    near = get_close_matches(name.lower(), known, 3, 0.5) or sorted(known)[:3]
    similar = ", ".join(known[one] for one in near)
    raise ConfigError(f"--font {name}: no such font is installed here; there are {similar}")


def current() -> Style:
    """Return the style of figures begun now."""
    return _current.get()


def settings(style: Style) -> Any:
    """Return a style's matplotlib settings, with literal keys for its stubs."""
    return {
        "font.family": [style.family, FONT],
        "font.size": style.size,
        "axes.linewidth": 0.8 * style.stroke,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.edgecolor": EDGE,
        "axes.facecolor": "none",
        "axes.labelcolor": INK,
        "axes.labelsize": 0.95 * style.size,
        "axes.grid": True,
        "axes.axisbelow": True,
        "axes.formatter.useoffset": False,
        "axes.unicode_minus": True,
        "grid.color": GRID,
        "grid.linewidth": 0.8 * style.stroke,
        "lines.linewidth": 1.4,
        "text.color": INK,
        "legend.labelcolor": INK,
        "xtick.color": EDGE,
        "ytick.color": EDGE,
        "xtick.labelcolor": INK,
        "ytick.labelcolor": INK,
        "xtick.labelsize": 0.93 * style.size,
        "ytick.labelsize": 0.93 * style.size,
        **{
            f"{axis}tick.{which}.{what}": size * style.stroke
            for axis in "xy"
            for which, what, size in (
                ("major", "size", 3.5),
                ("major", "width", 0.8),
                ("minor", "size", 2.0),
                ("minor", "width", 0.6),
            )
        },
        "path.simplify_threshold": 0.25,
        "pdf.fonttype": 42,
    }
