"""Enclosures of functions of theta over cells: what is surely true between two frequencies.

Over a cell theta = centre + t, |t| <= half, a function is kept as

    u(theta) = value + slope t + error,   |error| <= rest,

and every operation adds to `rest` what it neglects, rounding included: `PAD` times the greatest
size of what went in, some ten units in the last place. All arrays are of shape (n,), one entry per
cell, so that a proof costs a few operations per cell. Where a guide is enough, the same operations
on `AtPoints` keep values alone.

Sources: Taylor models of first order (Makino & Berz); the padding is for IEEE doubles.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]

PAD = 4e-15
ORDER = 6
"""Derivatives of a cosine sum that are taken at the centre; the rest is bounded everywhere."""


class Enclosed:
    """A function over each of n cells; `half` is shared by all that are combined."""

    __array_ufunc__ = None  # an array times an enclosure is the enclosure's business

    def __init__(self, half: Float, value: Float, slope: Float, rest: Float) -> None:
        self.half, self.value, self.slope, self.rest = half, value, slope, rest
        # How far the slope alone leads over half a cell; bounds of |u - value| and |u|. Nearly all
        # of them are asked for.
        self.reach = np.abs(slope) * half
        self.spread = (self.reach + rest) * (1.0 + PAD)
        self.size = self.spread + np.abs(value)

    @property
    def least(self) -> Float:
        """Return a lower bound of u over each cell."""
        return self.value - self.spread - PAD * self.size

    @property
    def most(self) -> Float:
        """Return an upper bound of u over each cell."""
        return self.value + self.spread + PAD * self.size

    def __add__(self, other: Enclosed | Float | float) -> Enclosed:
        if not isinstance(other, Enclosed):
            rest = self.rest + PAD * (self.size + np.abs(other))
            return Enclosed(self.half, self.value + other, self.slope, rest)
        rest = self.rest + other.rest + PAD * (self.size + other.size)
        return Enclosed(self.half, self.value + other.value, self.slope + other.slope, rest)

    __radd__ = __add__

    def __neg__(self) -> Enclosed:
        return Enclosed(self.half, -self.value, -self.slope, self.rest)

    def __sub__(self, other: Enclosed | Float | float) -> Enclosed:
        return self + -other

    def __mul__(self, other: Enclosed | Float | float) -> Enclosed:
        if not isinstance(other, Enclosed):
            rest = np.abs(other) * (self.rest + PAD * self.size)
            return Enclosed(self.half, self.value * other, self.slope * other, rest)
        b, reach, far = other, self.reach, other.reach
        rest = (np.abs(self.value) + reach) * b.rest + (np.abs(b.value) + far) * self.rest
        rest = rest + self.rest * b.rest + reach * far + PAD * self.size * b.size
        slope = self.value * b.slope + self.slope * b.value
        return Enclosed(self.half, self.value * b.value, slope, rest)

    __rmul__ = __mul__

    def inverse(self) -> Enclosed:
        """Return 1 / u; nothing is known (an infinite rest) where u may be zero."""
        nearest = np.abs(self.value) * (1.0 - 4.0 * PAD) - self.spread
        known = nearest > 0.0
        nearest = np.where(known, nearest, 1.0)
        value = 1.0 / np.where(known, self.value, 1.0)
        square = value * value
        rest = square * (self.rest + self.spread * self.spread / nearest) * (1.0 + 8.0 * PAD)
        rest = rest + PAD * (np.abs(value) + square * self.reach)
        return Enclosed(self.half, value, -square * self.slope, np.where(known, rest, np.inf))

    def but(self, where: npt.NDArray[np.bool_], given: Float) -> Enclosed:
        """Return it with these numbers, exact ones, in the cells where it says so."""
        return Enclosed(
            self.half,
            np.where(where, given, self.value),
            np.where(where, 0.0, self.slope),
            np.where(where, 0.0, self.rest),
        )


class AtPoints(Enclosed):
    """A function at n points, to rounding: nothing is enclosed, so that it proves nothing."""

    half = np.zeros(())

    def __init__(self, value: Float) -> None:
        self.value = value
        self.size = np.abs(value)

    @property
    def least(self) -> Float:
        """Return u itself."""
        return self.value

    most = least

    def __add__(self, other: Enclosed | Float | float) -> Enclosed:
        return AtPoints(self.value + (other.value if isinstance(other, Enclosed) else other))

    __radd__ = __add__

    def __neg__(self) -> Enclosed:
        return AtPoints(-self.value)

    def __mul__(self, other: Enclosed | Float | float) -> Enclosed:
        return AtPoints(self.value * (other.value if isinstance(other, Enclosed) else other))

    __rmul__ = __mul__

    def inverse(self) -> Enclosed:
        """Return 1 / u."""
        return AtPoints(1.0 / self.value)

    def but(self, where: npt.NDArray[np.bool_], given: Float) -> Enclosed:
        """Return it with these values where it says so."""
        return AtPoints(np.where(where, given, self.value))


def angle(centre: Float, half: Float | None) -> Enclosed:
    """Return theta itself; `half` None: at the points `centre`."""
    if half is None:
        return AtPoints(centre)
    zero = np.zeros_like(centre)
    return Enclosed(half, centre, np.ones_like(centre), zero)


def cosine_sums(rows: Float, centre: Float, half: Float | None) -> list[Enclosed]:
    """Return sum_k c_k cos(k theta) for each row of coefficients, of shape (rows, m)."""
    k = np.arange(rows.shape[1], dtype=float)
    if half is None:
        return [AtPoints(each) for each in rows @ np.cos(np.outer(k, centre))]
    derived = (rows * (1j * k) ** np.arange(ORDER)[:, None, None]).reshape(-1, len(k))
    values = (derived @ np.exp(1j * np.outer(k, centre))).real.reshape(ORDER, len(rows), -1)
    sizes = np.abs(rows)
    # Rounding of k theta grows with k; the same share is lost in each derivative.
    lost = 4.0 * PAD * np.sum(sizes * (1.0 + k), axis=1)[:, None]
    rest = np.zeros_like(values[0])
    step = half
    for at in range(2, ORDER):
        step = step * half / at
        most = (sizes @ k**at)[:, None] * (4.0 * PAD * len(k))
        rest = rest + step * (np.abs(values[at]) + most)
    rest = rest + step * half / ORDER * (sizes @ k**ORDER)[:, None]
    rest = rest * (1.0 + PAD) + lost * (1.0 + half)
    return [Enclosed(half, *each) for each in zip(values[0], values[1], rest, strict=True)]


def sine_ratio(centre: Float, half: Float | None) -> Enclosed:
    """Return sin(theta) / theta; its second derivative is nowhere larger than 1/3."""
    safe = np.maximum(centre, 0.1)
    value = np.where(centre > 0.1, np.sin(safe) / safe, 0.0)
    slope = np.where(centre > 0.1, (np.cos(safe) - value) / safe, 0.0)
    s = centre * centre
    near = 1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0)))
    near_slope = -centre / 3.0 * (1.0 - s / 10.0 * (1.0 - s / 28.0 * (1.0 - s / 54.0)))
    value, slope = np.where(centre > 0.1, value, near), np.where(centre > 0.1, slope, near_slope)
    if half is None:
        return AtPoints(value)
    return Enclosed(half, value, slope, half * half / 6.0 + 40.0 * PAD)
