"""Proof over cells of frequency that a port returns no more of a wave than arrives.

At a frequency the port contracts on a device of sampled admittance Y if

    q(Y) = curve |Y|**2 + 2 Re(slope Y) + rest >= 0                      (`reflection`),

and Y = sum_n s_n Y_n, where Y_n = 1 / Z(w_n) is what the class allows, w_n = (theta + 2 pi n) / T.
For any D >= curve, D >= 0 and any point P, D |Y|**2 >= D (2 Re(conj(P) Y) - |P|**2), and what is
left is concave, so that the mean of it is no more than it is of the mean:

    q(Y) >= rest - D |P|**2 + sum_n s_n f(Y_n),
    f(Y) = (curve - D) |Y|**2 + 2 Re((slope + D conj(P)) Y).

With Z = R + jX, f(1 / Z) >= -g says g |Z|**2 + 2 (sr R + si X) + curve - D >= 0, over R >= d,
X >= m w - K / w. For the frequencies folded in a g is closed form; what they leave is the g_0
of the device's own, and the least value of its quadratic over that quadrant is closed form too.
With theta X for X and g_0 / theta**2 for g_0 all of this is regular down to theta = 0, light
damping or not: resonances are nowhere sharp in Z.

Each number is an enclosure over a cell (`enclosure`), so that a positive lower bound is a proof;
cells that are not proved are halved, down to a point that fails.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.wave_port.enclosure import Enclosed, angle, cosine_sums, sine_ratio
from tautwave.analysis.wave_port.reflection import Reflection

Float = npt.NDArray[np.float64]
Complex = npt.NDArray[np.complex128]

FOLDS = 3
"""Frequencies folded in on each side; the rest is bounded as one."""

CELLS = 48
HALVINGS = 24
MAX_CELLS = 200_000
FEW_TOUCHES, TOUCHES = 3, 16
"""Steps by which the point P is sought."""


class Folded(NamedTuple):
    """A device as the port sees it: theta-scaled bounds m / T, K T, d, the class' only numbers."""

    mass: float
    damping: float
    stiffness: float


class Outcome(NamedTuple):
    """Whether all cells are proved; else a theta at which the bound fails, nan if cells ran out."""

    proved: bool
    theta: float


def prove(r: Reflection, device: Folded) -> Outcome:
    """Return whether |H S| <= 1 on a class at every theta in [0, pi]."""
    if not r.locked:
        return Outcome(False, math.pi)
    edges = np.concatenate([[0.0], np.geomspace(0.01, math.pi, CELLS)])
    edges[-1] = math.pi
    low, high = edges[:-1], edges[1:]
    for _ in range(HALVINGS):
        centre, half = 0.5 * (low + high), 0.5 * (high - low) * (1.0 + 1e-12)
        point = touching(r, device, centre)
        open_ = ~(least(r, device, centre, half, point) >= 0.0)
        if not np.any(open_):
            return Outcome(True, math.nan)
        low, high, centre, point = low[open_], high[open_], centre[open_], point[open_]
        at_centre = least(r, device, centre, np.zeros_like(centre), point)
        if np.any(~(at_centre >= 0.0)):
            return Outcome(False, float(centre[np.argmin(at_centre)]))
        low, high = np.concatenate([low, centre]), np.concatenate([centre, high])
        if len(low) > MAX_CELLS:
            break
    return Outcome(False, math.nan)


def least(
    r: Reflection,
    device: Folded,
    centre: Float,
    half: Float | None,
    point: Complex,
) -> Float:
    """Return a lower bound of q over each cell; >= 0 proves that |H S| <= 1 there.

    Without cells, of `half` None, it is one at the points `centre` to rounding: a guide, no proof.

    Parameters
    ----------
    r : Reflection
        The port.
    device : Folded
        The class.
    centre, half : ndarray of shape (n,)
        Cells of theta within [0, pi]; points above 0 if `half` is None.
    point : ndarray of complex, shape (n,)
        P; any is valid, `touching` is best.
    """
    with np.errstate(invalid="ignore", over="ignore"):  # what is not known proves nothing
        return _least(r, device, centre, half, point)


def _least(
    r: Reflection, device: Folded, centre: Float, half: Float | None, point: Complex
) -> Float:
    theta = angle(centre, half)
    square = theta * theta
    size = len(r.rest[0])
    rows = np.zeros((5, max(size, 2)))
    rows[0, :2] = 1.0, -1.0
    rows[1:, :size] = r.curve[0], r.slope[0], r.slope_sine[0], r.rest[0]
    x, curve, slope, turn, rest = cosine_sums(rows, centre, half)
    curve = curve * x + r.curve_0[0]
    turn = turn * sine_ratio(centre, half)
    over = x.inverse()
    standing = float(r.rest_0[0])
    wide = np.zeros_like(centre) if half is None else half
    lowest = centre <= wide  # the cell that holds theta = 0
    point = np.where(lowest, 0.0, point)
    drop = np.maximum(curve.most, 0.0) * (1.0 + 1e-12)
    bend = curve - drop
    real = slope + drop * point.real
    imag = turn
    given = rest
    if standing != 0.0:
        top = 1.0 / (1.0 - np.cos(np.minimum(centre + wide, math.pi)))
        given = given + (over * standing).but(lowest, standing * top * (1.0 - 1e-9))
    if np.any(point != 0.0):
        imag = imag + (theta.inverse() * (-drop * point.imag)).but(lowest, 0.0 * drop)
        given = given + (over * (-drop * np.abs(point) ** 2)).but(lowest, 0.0 * drop)
    given = 0.5 * given - _folded_in(device, theta, bend, real, imag)
    return _least_of_quadrant(device, square, given, real, imag, bend)


def _folded_in(
    device: Folded, theta: Enclosed, bend: Enclosed, real: Enclosed, imag: Enclosed
) -> Enclosed:
    """Return the sum of g_n / (theta + 2 pi n)**2 over all n but 0."""
    sized, opposed = bend.size, np.maximum(-real.least, 0.0)
    turn = imag * theta
    total = 0.0 * theta
    lowest, highest = theta.value - theta.half, theta.value + theta.half
    for n in [*range(-FOLDS, 0), *range(1, FOLDS + 1)]:
        folded = theta + 2.0 * math.pi * n
        at = np.abs((highest if n < 0 else lowest) + 2.0 * math.pi * n)
        bound = _folded_bound(device, at, sized, opposed, (turn if n < 0 else -turn).most)
        weight = folded.inverse()
        total = total + weight * weight * bound
    # Beyond: |theta + 2 pi n| >= 2 pi (|n| - 1/2), and sum of 1/(n - 1/2)**2 from N + 1 < 1/(N - 0)
    at = np.full_like(sized, 2.0 * math.pi * (FOLDS + 0.5))
    bound = _folded_bound(device, at, sized, opposed, turn.size)
    return total + bound * (2.0 / (4.0 * math.pi**2 * FOLDS) * (1.0 + 1e-9))


def _folded_bound(device: Folded, at: Float, bend: Float, opposed: Float, turned: Float) -> Float:
    """Return a g with f >= -g over the class at |theta + 2 pi n| >= at."""
    reactance = device.mass * at - device.stiffness / at
    heavy = reactance > 0.0
    safe = np.where(heavy, reactance, 1.0)
    d = device.damping
    facing = np.hypot(opposed, turned) + turned
    light = bend / d**2 + 2.0 * np.hypot(opposed, turned) / d
    return np.where(heavy, bend / (d * d + safe * safe) + facing / safe, light) * (1.0 + 1e-12)


def _least_of_quadrant(
    device: Folded, square: Enclosed, given: Enclosed, real: Enclosed, imag: Enclosed,
    bend: Enclosed,
) -> Float:  # fmt: skip
    """Return a lower bound of given (theta**2 R**2 + X**2) + 2 (real R + imag X) + bend.

    Over R >= d, X >= m theta**2 / T - K T. Where the least point is on the edge, there; else the
    least over all R or X, which is never above it.
    """
    d = device.damping
    edge = square * device.mass - device.stiffness
    inverse = given.inverse()
    on_edge = (given * edge + 2.0 * imag) * edge
    anywhere = -(imag * imag) * inverse
    up = (given * edge + imag).least >= 0.0
    across = (given * square * d + 2.0 * real) * d
    free = -(real * real) * inverse * square.inverse()
    out = (given * square * d + real).least >= 0.0
    sums = [
        np.where(okx & okr, (a + b + bend).least, -np.inf)
        for a, okx in ((on_edge, up), (anywhere, True))
        for b, okr in ((across, out), (free, True))
    ]
    best = np.fmax.reduce(sums)
    return np.where(given.least >= 0.0, best, -np.inf)


def not_refused(r: Reflection, device: Folded, theta: Float) -> bool:
    """Return whether the bound holds at every theta > 0, to rounding: a guide, no proof.

    Nearly all points need no close P.
    """
    for touches in (FEW_TOUCHES, TOUCHES):
        point = touching(r, device, theta, touches)
        theta = theta[~(least(r, device, theta, None, point) >= 0.0)]
        if not len(theta):
            return True
    return False


def touching(r: Reflection, device: Folded, theta: Float, touches: int = TOUCHES) -> Complex:
    """Return the point of the sampled class at which q is least, nearly; 0 where q is concave."""
    best = np.zeros(theta.shape, dtype=complex)
    curve, slope, _ = r.at(theta)[0]
    convex = (curve > 0.0) & (theta > 0.0)
    if not np.any(convex):
        return best
    curve, slope, theta = curve[convex], slope[convex], theta[convex]
    y = np.zeros(theta.shape, dtype=complex)
    folds = _folds(device, theta)
    for _ in range(touches):
        inclined = slope.conjugate() + curve * y
        towards = _farthest(folds, -inclined) - y
        fall = -(np.conj(inclined) * towards).real
        step = np.clip(fall / (curve * np.abs(towards) ** 2 + 1e-300), 0.0, 1.0)
        y = y + step * towards
    best[convex] = y
    return best


class _Folds(NamedTuple):
    """What `_farthest` needs of the class at each theta and fold; arrays (n, folds).

    The frequencies of the first FOLDS are negative: their admittances are conjugate.
    """

    weight: Float
    damping: float
    reactance: Float
    corner: Complex
    upright: Float
    """+1 where the frequency is positive, -1 where it is negative."""


def _folds(device: Folded, theta: Float) -> _Folds:
    at = theta[:, None] + 2.0 * math.pi * np.arange(-FOLDS, FOLDS + 1)[None, :]
    weight = (np.sin(0.5 * at) / (0.5 * at)) ** 2
    upright = np.sign(at)
    at = np.abs(at)
    reactance = device.mass * at - device.stiffness / at
    with np.errstate(divide="ignore", invalid="ignore"):
        corner = np.asarray(1.0 / (device.damping + 1j * reactance), np.complex128)
    return _Folds(weight, device.damping, reactance, corner, upright)


def _farthest(folds: _Folds, direction: Complex) -> Complex:
    """Return the sampled admittance of the class that reaches farthest in a direction u.

    A fold's admittances are bounded by those of R = d, a circle about 1 / 2d, and of X = x, one
    about -j / 2x; each reaches farthest at its centre plus its radius times u, the class there or
    at the corner of both.
    """
    weight, d, x, corner, upright = folds
    u = (direction / np.maximum(np.abs(direction), 1e-300))[:, None]
    c, s = u.real, upright * u.imag
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = c * corner.real + s * corner.imag
        found_re, found_im = corner.real, corner.imag
        held = reach > 0.0
        found_re, found_im = np.where(held, found_re, 0.0), np.where(held, found_im, 0.0)
        reach = np.where(held, reach, 0.0)
        along = (1.0 + c) * (0.5 / d)
        better = (-d * s >= x * (1.0 + c)) & (along > reach)
        reach = np.where(better, along, reach)
        found_re = np.where(better, along, found_re)
        found_im = np.where(better, s * (0.5 / d), found_im)
        radius = 0.5 / x
        along = (1.0 - s) * radius
        better = (x > 0.0) & (x * c >= d * (1.0 - s)) & (along > reach)
        found_re = np.where(better, c * radius, found_re)
        found_im = np.where(better, -along, found_im)
    sampled: Complex = np.sum(weight * found_re, axis=1) + 1j * np.sum(
        weight * upright * found_im, axis=1
    )
    return sampled
