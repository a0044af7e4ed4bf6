"""Modes of two ends and a line: growth, frequency, and the delay at which stability is lost.

With the line's samples as states the matrix of a long line is large; `loop_roots` finds the same
eigenvalues from the ends' transfers. Sources: Aberth, Math. Comp. 27(122), 1973 (all zeros of a
polynomial at once); its form for a delayed loop is written here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.sampled_loop import LinearEnd, close_loop


class Mode(NamedTuple):
    """The least damped mode of a sampled loop: |z|, growth ln|z| / T [1/s] and frequency [Hz]."""

    radius: float
    growth: float
    frequency: float


OFFSET = 1e-7
"""Eigenvalues this near to 1 are positions that nothing holds, not motion."""


def mode_of(roots: npt.NDArray[np.complex128], period: float) -> Mode:
    """Return the mode of the largest root that is not a resting offset; `period` in s."""
    moving = roots[np.abs(roots - 1.0) > OFFSET]
    if moving.size == 0:
        return Mode(1.0, 0.0, 0.0)
    radius = float(np.abs(moving).max())
    if radius == 0.0:
        return Mode(0.0, -math.inf, 0.0)
    worst = moving[np.argmax(np.abs(moving))]
    turn = abs(math.atan2(worst.imag, worst.real))
    return Mode(radius, math.log(radius) / period, turn / (2.0 * math.pi * period))


def least_damped(master: LinearEnd, slave: LinearEnd, samples: int, period: float) -> Mode:
    """Return the least damped mode of two ends `samples` slots apart; `period` in s.

    Up to `DENSE` states by the eigenvalues of the state matrix, above by `loop_roots`.
    """
    if len(master.b) + len(slave.b) + 2 * samples <= DENSE:
        matrix = close_loop(master, slave, samples)
        return mode_of(np.linalg.eigvals(matrix).astype(np.complex128), period)
    return mode_of(loop_roots(master, slave, samples), period)


DENSE = 120
"""States up to which the eigenvalues of the whole matrix are taken; it grows cubed."""


def transfer(
    end: LinearEnd, z: npt.NDArray[np.complex128]
) -> tuple[npt.NDArray[np.complex128], npt.NDArray[np.complex128]]:
    """Return leaving per arriving of one end at the points `z`, and its derivative; shape (n,)."""
    shifted = z[:, None, None] * np.eye(len(end.b)) - end.a
    forth = np.linalg.solve(shifted, np.broadcast_to(end.b[:, None], (len(z), len(end.b), 1)))
    again = np.linalg.solve(shifted, forth)
    return (forth[:, :, 0] @ end.c, -(again[:, :, 0] @ end.c))


def loop_roots(master: LinearEnd, slave: LinearEnd, samples: int) -> npt.NDArray[np.complex128]:
    """Return all eigenvalues of `close_loop` without building it; shape (n,).

    They are the zeros of chi(z) (1 - w), w = L(z) z**(-2 M), with L the product of both ends'
    transfers and chi the ends' own characteristic polynomial. Ehrlich and Aberth's iteration
    moves all of them at once, each repelled by the others, so that none is found twice. Cost
    grows with M**2, not M**3, and in one thread.
    """
    own = np.concatenate([np.linalg.eigvals(end.a) for end in (master, slave)])
    turns = 2 * samples
    circle = np.exp(2j * np.pi * (np.arange(turns) + 0.3) / turns)
    apart = np.exp(1j * (1.0 + 2.4 * np.arange(len(own))))
    begin = np.where(np.abs(own) > 0.1, 0.9999 * own + 1e-4 * apart, 0.5 * apart)
    z = np.concatenate([0.999 * circle, begin]).astype(np.complex128)
    moving = np.arange(len(z))
    for turn in range(ROUNDS):
        moving = moving[np.abs(z[moving]) > DEAD]
        # Beside the point, never twice on the same side: some roots are poles of an end, too.
        beside = 2e-14 * np.exp(2.4j * turn)
        step = _newton(master, slave, turns, own, z[moving] + beside)
        for first in range(0, len(moving), 512):
            part = slice(first, first + 512)
            between = z[moving[part], None] - z[None, :]
            between[between == 0.0] = np.inf
            step[part] = step[part] / (1.0 - step[part] * (1.0 / between).sum(axis=1))
        # A step beyond the neighbours only confuses them.
        step *= np.minimum(1.0, 0.2 / np.maximum(np.abs(step), 1e-300))
        z[moving] -= step
        # Most arrive in some ten rounds and stay, a few need many more.
        moving = moving[~(np.abs(step) < ARRIVED)]  # NaN has not
        if not np.any(np.abs(z[moving]) > 0.9 * np.abs(z).max()):
            break
    return z


DEAD = 1e-3
"""Roots this small are left where they are: gone within a few periods, often many in one place."""

ARRIVED = 2e-13
"""A step this small is the last one of its root."""

ROUNDS = 200
"""Rounds after which `loop_roots` gives up; it needs some 10 to 30."""


def _newton(
    master: LinearEnd,
    slave: LinearEnd,
    turns: int,
    own: npt.NDArray[np.complex128],
    z: npt.NDArray[np.complex128],
) -> npt.NDArray[np.complex128]:
    """Return Newton's step P / P' of the characteristic polynomial at the points `z`."""
    one, one_slope = transfer(master, z)
    two, two_slope = transfer(slave, z)
    with np.errstate(all="ignore"):
        less = turns / z - one_slope / one - two_slope / two
        inverse = np.exp(turns * np.log(z) - np.log(one) - np.log(two))  # 1 / w, any size
        share = np.where(np.isfinite(inverse), less / (inverse - 1.0), 0.0)
        slope = turns / z + (1.0 / (z[:, None] - own[None, :])).sum(axis=1) + share
        step = 1.0 / slope
    return np.where(np.isfinite(step), step, 0.0)
