"""The two papers this project started from: their figures, and numbers beside the published ones.

Colgate & Schenkel 1997 with its slides (a sampled virtual wall), and Berdahl, Smith & Niemeyer (a
resonator and grains behind a coupling spring). Each chapter is a module of this folder that names
figures and rows; it is imported on demand.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from tautwave.errors import ConfigError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CHAPTERS = {
    "resonator": "a resonator behind a coupling spring: Bode and Nyquist plots, poles",
    "coupling": "how stiff the coupling spring may be (critical k_c), by scheme and period",
    "positive-real": "which controllers are positive real, and the effect of a digital delay",
    "hand": "the hand that drives a delayed controller unstable, constructed and simulated",
    "wall": "the damping that a sampled wall needs, and the stiffness that stays stable",
    "limit-cycle": "the bounce of a device pressed against a sampled wall",
    "granular": "ten grains between floor and bar: granular synthesis",
}


class Row(NamedTuple):
    """One number, as obtained here and as published.

    Attributes
    ----------
    what, unit : str
    obtained, reference : float
        In `unit`.
    tolerance : float
        Greatest difference allowed by the published digits, in `unit`.
    source : str
        Source of the reference: a paper; `recomputed` if a paper gives the formula and the digits
        were computed independently of this code; `predicted` by theory, while a simulation obtained
        the number.
    """

    what: str
    unit: str
    obtained: float
    reference: float
    tolerance: float
    source: str

    @property
    def agrees(self) -> bool:
        """Whether both agree within the tolerance; false for NaN."""
        return bool(abs(self.obtained - self.reference) <= self.tolerance * (1.0 + 1e-9))


class Chapter(NamedTuple):
    """What a chapter module declares.

    `rows` computes the numbers; `figures` maps file names without suffix to the functions that draw
    them.
    """

    rows: Callable[[], list[Row]]
    figures: Mapping[str, Callable[[], Figure]]


def chapter(name: str) -> Chapter:
    """Return a chapter by its name.

    Raises
    ------
    ConfigError
        There is no such chapter; the message lists them.
    """
    if name not in CHAPTERS:
        near = get_close_matches(name, CHAPTERS, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(CHAPTERS)}"
        raise ConfigError(f"nothing to reproduce is called {name!r}; {hint}")
    module = importlib.import_module(f"tests.lab.papers.{name.replace('-', '_')}")
    found: Chapter = module.CHAPTER
    return found


def draw_chapter(name: str, directory: Path) -> list[Path]:
    """Write the pictures of a chapter into a directory, created if needed, and return their paths.

    Each is an SVG that follows dark mode, and a PNG.

    Raises
    ------
    WritingError
        The directory or a file in it cannot be written.
    """
    from tautwave.canvas import alone, png, svg
    from tautwave.files import make_directory, write_bytes

    make_directory(directory)
    drawn = []
    for file, make in chapter(name).figures.items():
        figure = make()
        for ending, content in (
            ("svg", alone(svg(figure, file)).encode()),
            ("png", png(figure)),
        ):
            path = directory / f"{file}.{ending}"
            write_bytes(path, content)
            drawn.append(path)
    return drawn


def relative(
    what: str, unit: str, obtained: float, reference: float, share: float, source: str
) -> Row:
    """Return a row whose tolerance is a share of the reference."""
    return Row(what, unit, obtained, reference, share * math.fabs(reference), source)
