"""A pair whose ends run at different rates: the exact linear motion over one common period.

Each end moves at its own period, n times that of the line; between them stand the mean of n waves
and the hold over n slots (`tautwave.laws.conversion`). The law repeats after the least common
multiple of both n: the product of all slots' state matrices decides on stability (Floquet). It is
built by driving unit vectors through the slots in the live loop's order. The linear regime is
that of `tautwave.analysis.ports.sampled_loop`.

Sources: Kranc 1957 (multi-rate loops as periodic ones); written here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tautwave.analysis.ports.loop_modes import Mode, mode_of
from tautwave.analysis.ports.sampled_loop import LinearEnd, Matrix


class RatedEnd(NamedTuple):
    """An end that moves every `divisor`-th slot of the line."""

    end: LinearEnd
    divisor: int = 1


def common_slots(master: RatedEnd, slave: RatedEnd) -> int:
    """Return the slots after which everything repeats."""
    return math.lcm(master.divisor, slave.divisor)


def merged_matrix(master: RatedEnd, slave: RatedEnd, samples: int) -> Matrix:
    """Return the state matrix over `common_slots` slots of two ends `samples` slots apart.

    States: master's, slave's, for each the wave held and the sum of the block (both 0 at the
    line's own rate), then the waves under way, of which equal ones are one state: what a slow end
    sends stays the same for as long as it is held, so one state stands for these waves and for what
    the end holds now. Of those that a slow end takes the mean of, only their mean counts. Whatever
    else the line holds is gone once it has emptied, so that only zeros among the eigenvalues are
    missing. Shape (n, n).
    """
    lines = _lines(master, slave)
    ends = (master, slave)
    merged = list(range(lines))
    for way, (sender, taker) in enumerate((ends, ends[::-1])):
        known: dict[int, int] = {}
        slots = range(samples)
        if sender.divisor >= taker.divisor:
            # The wave of slot j left in slot j - samples; the newest is what is still held.
            blocks = [(j - samples + 1) // sender.divisor for j in slots]
            if sender.divisor > 1:
                known[0] = lines - 4 + 2 * way
        else:
            blocks = [j // taker.divisor for j in slots]
        first = max(merged) + 1
        for block in blocks:
            if block not in known:
                known[block] = first
                first += 1
            merged.append(known[block])
    spread = np.eye(max(merged) + 1)[merged]
    mean: Matrix = spread.T / spread.sum(axis=0)[:, None]
    matrix: Matrix = mean @ _driven(master, slave, samples, spread)
    return matrix


def _lines(master: RatedEnd, slave: RatedEnd) -> int:
    """Return where the waves under way begin among the states."""
    return len(master.end.b) + len(slave.end.b) + 4


def _driven(master: RatedEnd, slave: RatedEnd, samples: int, x: Matrix) -> Matrix:
    """Return states, one a column, after `common_slots` slots; changes `x`."""
    sides = (master, slave)
    sizes = [len(side.end.b) for side in sides]
    begin = (0, sizes[0])
    lines = _lines(master, slave)
    extra = lines - 4
    own = [slice(begin[at], begin[at] + sizes[at]) for at in (0, 1)]
    for slot in range(common_slots(master, slave)):
        due = [slot % side.divisor == side.divisor - 1 for side in sides]
        leaving = []
        for at, side in enumerate(sides):
            if side.divisor == 1:
                leaving.append(side.end.c @ x[own[at]])
                continue
            held = extra + 2 * at
            if due[at]:
                x[held] = side.end.c @ x[own[at]]
            leaving.append(x[held].copy())
        arriving = [leaving[1], leaving[0]]
        if samples:
            # Rings: the oldest of both ways make place for what enters.
            back, there = lines + samples + slot % samples, lines + slot % samples
            arriving = [x[back].copy(), x[there].copy()]
            x[there], x[back] = leaving
        for at, side in enumerate(sides):
            wave = arriving[at]
            if side.divisor > 1:
                block = extra + 2 * at + 1
                x[block] += wave / side.divisor
                if not due[at]:
                    continue
                wave = x[block].copy()
                x[block] = 0.0
            x[own[at]] = side.end.a @ x[own[at]] + np.outer(side.end.b, wave)
    for first in (lines, lines + samples) if samples else ():
        turn = common_slots(master, slave) % samples
        x[first : first + samples] = np.roll(x[first : first + samples], -turn, axis=0)
    return x


def least_damped_rated(master: RatedEnd, slave: RatedEnd, samples: int, period: float) -> Mode:
    """Return the least damped mode; `period` [s] is that of the line.

    `radius` is per common period. `frequency` is known up to multiples of the common rate: faster
    oscillations appear aliased.
    """
    matrix = merged_matrix(master, slave, samples)
    roots = np.linalg.eigvals(matrix).astype(np.complex128)
    return mode_of(roots, common_slots(master, slave) * period)
