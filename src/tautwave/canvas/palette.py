"""The colours of every figure, on light and dark backgrounds.

The categorical colours are Okabe and Ito's, distinguishable with every common colour blindness:
master is always blue, slave always vermilion, walls green. Contacts have a separate colour ramp, so
that none is mistaken for a device or a wall. A figure uses only these colours: `DARK` has the
counterpart of each, and a page swaps them without redrawing.
"""

from __future__ import annotations

from typing import Any

PAPER, INK, SOFT, EDGE, GRID = "#ffffff", "#1b1f23", "#6a737b", "#555c63", "#e3e6e8"
MASTER, SLAVE, WALL = "#0072b2", "#d55e00", "#009e73"
LINE, FILTER, DAMPER, LIMIT = "#aa4499", "#56b4e9", "#e69f00", "#8c1d40"
SHADE, WALL_SHADE, BAND = "#b9c4cc", "#a5d8c6", "#9aa5ad"
PASSIVE, STABLE = "#cde8de", "#dde9f3"
CONTACTS = ("#c49be8", "#a374d6", "#8150bd", "#61339c", "#421c74", "#220a44")
"""Six contacts in order of time, later ones with more contrast to the background."""

DARK = {
    PAPER: "#14181d",
    INK: "#e6e9ec",
    SOFT: "#9aa4ad",
    EDGE: "#98a2ab",
    GRID: "#2b323a",
    MASTER: "#3d9be9",
    SLAVE: "#ff8a3d",
    WALL: "#2fc795",
    LINE: "#dd77cc",
    FILTER: "#a5dcfa",
    DAMPER: "#f2c14e",
    LIMIT: "#ff7a90",
    SHADE: "#56626c",
    WALL_SHADE: "#2f6e5b",
    BAND: "#6f7b84",
    PASSIVE: "#1f4d40",
    STABLE: "#24405a",
    CONTACTS[0]: "#6f4fb3",
    CONTACTS[1]: "#8a6ccb",
    CONTACTS[2]: "#a58ade",
    CONTACTS[3]: "#c0aaec",
    CONTACTS[4]: "#dacbf5",
    CONTACTS[5]: "#f4eefd",
}
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


def element_style(element: str) -> dict[str, Any]:
    """Colour by what an element is, blue and vermilion for ports, dashes for the slave's side."""
    what, _, side = element.partition("_")
    colour = SIDE[side] if what == "port" and side in SIDE else _ELEMENT.get(what, SOFT)
    return {"color": colour, "linestyle": "--" if side == "slave" and what != "port" else "-"}


def dark_rules(scope: str = "svg") -> str:
    """CSS that maps every colour of a figure to its dark counterpart.

    A figure's SVG has its colours as attributes: a rule overrides them, and a program without CSS
    ignores the rule. A marker is a path that is used many times: in its copies a browser sees no
    ancestor, so paths are named without the scope.
    """
    return "\n".join(
        f'{scope} [{what}="{light}"], path[{what}="{light}"] {{ {what}: {dark}; }}'
        for light, dark in DARK.items()
        for what in ("fill", "stroke")
    )
