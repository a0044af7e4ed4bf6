"""Where a loop loses its stability, by its eigenvalues."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple


class Crossing(NamedTuple):
    """The first number of samples whose verdict differs from the one before, and that verdict."""

    samples: int
    stable: bool


def stability_crossings(
    radius_at: Callable[[int], float], values: Sequence[int], tolerance: float = 1e-9
) -> list[Crossing]:
    """Return every change of the verdict radius <= 1 + tolerance over rising numbers of samples.

    Neighbours of `values` with different verdicts are bisected down to one sample; two changes
    between neighbours are not seen, so give as many values as modes demand.

    Parameters
    ----------
    radius_at : callable
        Spectral radius [1] at a delay in samples.
    values : sequence of int
        Rising delays [samples] to begin with.
    """
    found: list[Crossing] = []
    verdicts = [radius_at(value) <= 1.0 + tolerance for value in values]
    for at in range(1, len(values)):
        if verdicts[at] == verdicts[at - 1]:
            continue
        low, high = values[at - 1], values[at]
        while high - low > 1:
            middle = (low + high) // 2
            if (radius_at(middle) <= 1.0 + tolerance) == verdicts[at]:
                high = middle
            else:
                low = middle
        found.append(Crossing(high, verdicts[at]))
    return found


def stability_boundary(
    radius_at: Callable[[int], float], values: Sequence[int], tolerance: float = 1e-9
) -> int | None:
    """Return the first delay [samples] that is unstable, None if none is; see above."""
    if radius_at(values[0]) > 1.0 + tolerance:
        return values[0]
    for crossing in stability_crossings(radius_at, values, tolerance):
        if not crossing.stable:
            return crossing.samples
    return None
