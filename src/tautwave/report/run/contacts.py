"""Contacts of the slave with its environment, and with virtual walls: when, how long, how hard."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from tautwave.report.figures.envelope import Floats

MERGE_S = 0.01  # shorter gaps count as one contact: a person cannot feel them as two


class Contact(NamedTuple):
    """One contact. Times in s, `peak_effort` in N m or N, `peak_depth` in rad or m (NaN unknown).

    `first` and `last` are the rows of its ends, both in contact.
    """

    start_s: float
    duration_s: float
    peak_effort: float
    peak_depth: float
    first: int
    last: int


def find_contacts(
    time: Floats, effort: Floats, depth: Floats | None = None, merge_s: float = MERGE_S
) -> list[Contact]:
    """Intervals in which a unilateral element pushes, in order of time.

    Parameters
    ----------
    time : shape (n,) [s]
    effort : shape (n,), force of the wall [N m or N], exactly zero outside of it
    depth : shape (n,), penetration [rad or m], positive inside
    merge_s : contacts closer than this [s] count as one

    Returns
    -------
    list[Contact]
        A contact already present in the first row begins there; the last row ends every contact.
    """
    touching = np.isfinite(effort) & (effort != 0.0)
    if not touching.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], touching, [False]]).astype(np.int8)))
    firsts, lasts = edges[0::2], edges[1::2] - 1
    apart = time[firsts[1:]] - time[lasts[:-1]] > merge_s
    firsts = np.concatenate([firsts[:1], firsts[1:][apart]])
    lasts = np.concatenate([lasts[:-1][apart], lasts[-1:]])
    period = float(np.median(np.diff(time[:1000]))) if len(time) > 1 else 0.0
    contacts = []
    for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
        inside = slice(first, last + 1)
        deepest = float("nan")
        if depth is not None and np.isfinite(depth[inside]).any():
            deepest = float(np.nanmax(depth[inside]))
        hardest = float(np.nanmax(np.abs(effort[inside])))
        lasted = float(time[last] - time[first]) + period
        contacts.append(Contact(float(time[first]), lasted, hardest, deepest, first, last))
    return contacts


def united(contacts: Sequence[Contact]) -> list[tuple[float, float]]:
    """Start and end [s] of every stretch of time that some contact covers."""
    stretches: list[tuple[float, float]] = []
    for start, end in sorted((c.start_s, c.start_s + c.duration_s) for c in contacts):
        if stretches and start <= stretches[-1][1]:
            stretches[-1] = (stretches[-1][0], max(end, stretches[-1][1]))
        else:
            stretches.append((start, end))
    return stretches
