"""Bounds outside which an identified number cannot be of a device that a hand or a drive moves.

They are wide: from the lightest lever with an encoder to the heaviest joint of an industrial robot,
by a factor of a hundred at either end. What is outside is a wrong unit, of time (a factor of a
thousand to the power of two), of length or of effort, or a column that is something else.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple


class Bound(NamedTuple):
    """Least and greatest plausible magnitude of a quantity [SI], and its unit."""

    least: float
    greatest: float
    unit: str


BOUNDS = {
    "inertia": (Bound(1e-9, 1e4, "kg m^2"), Bound(1e-7, 1e5, "kg")),
    "damping": (Bound(0.0, 1e5, "N m s/rad"), Bound(0.0, 1e7, "N s/m")),
    "coulomb": (Bound(0.0, 1e4, "N m"), Bound(0.0, 1e5, "N")),
    "bias": (Bound(0.0, 1e5, "N m"), Bound(0.0, 1e6, "N")),
    "stiffness": (Bound(1e-5, 1e9, "N m/rad"), Bound(1e-4, 1e10, "N/m")),
    "preload": (Bound(0.0, 1e5, "N m"), Bound(0.0, 1e6, "N")),
    "offset": (Bound(0.0, 1e5, "N m"), Bound(0.0, 1e6, "N")),
    "peak_velocity": (Bound(1e-5, 1e4, "rad/s"), Bound(1e-6, 1e3, "m/s")),
    "position": (Bound(1e-7, 1e6, "rad"), Bound(1e-9, 1e3, "m")),
    "position_noise": (Bound(0.0, 0.3, "rad"), Bound(0.0, 0.01, "m")),
    "lag": (Bound(0.0, 1.0, "s"), Bound(0.0, 1.0, "s")),
    "link_mass": (Bound(0.0, 1e4, "kg"), Bound(0.0, 1e4, "kg")),
    "centre": (Bound(0.0, 10.0, "m"), Bound(0.0, 10.0, "m")),
}
"""Of a rotary and of a linear axis; `position` is the distance that was moved."""
ALIASES = {"mass": "inertia"}


def bound_of(name: str, rotary: bool | None) -> Bound | None:
    """Return the bound of a quantity; where the kind of axis is unknown, that of both together."""
    pair = BOUNDS.get(ALIASES.get(name, name))
    if pair is None:
        return None
    turns, slides = pair
    if rotary is not None:
        return turns if rotary else slides
    least, greatest = min(turns.least, slides.least), max(turns.greatest, slides.greatest)
    return Bound(least, greatest, "")


def implausible(values: Mapping[str, float], rotary: bool | None) -> list[str]:
    """Return a sentence for each value outside physics; none where all may be.

    Parameters
    ----------
    values : mapping
        Magnitudes by name [SI]; a name without a bound has none.
    rotary : bool, optional
        Kind of the axis.
    """
    sentences = []
    for name, value in values.items():
        bound = bound_of(name, rotary)
        if bound is None or bound.least <= abs(value) <= bound.greatest:
            continue
        unit = f" {bound.unit}" if bound.unit else ""
        sentences.append(
            f"Doubtful: {name.replace('_', ' ')} {value:.3g}{unit} is outside the plausible range "
            f"({bound.least:g} to {bound.greatest:g}); check the units of time (--time-unit), "
            "position and effort, and which columns were taken."
        )
    return sentences
