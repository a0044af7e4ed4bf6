"""What a port makes of a wave, exactly: polynomials with the very numbers that the laws use.

The returned wave is a Moebius map of the sampled admittance Y of the device,
S = (A Y + B) / (C Y + E), and A, B, C, E are polynomials in q = e^(-j theta) over one common
denominator, the observer's. So, times the positive |denominator|**2,

    |C Y + E|**2 - |H|**2 |A Y + B|**2 = curve |Y|**2 + 2 Re(slope Y) + rest

with sums of cosines and sines for coefficients. They are computed in rational numbers from the
floats of the port; near standstill curve and rest vanish like theta**2, and that factor is taken
out exactly, x = 1 - cos(theta):

    curve = curve_0 + x curve_x,   rest = rest_0 + x rest_x,   Im slope = sin(theta) slope_sine.

Sources: derived here; the adjugate is Faddeev and LeVerrier's, the test of roots Schur's.
"""

from __future__ import annotations

import functools
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams

Float = npt.NDArray[np.float64]
Poly = list[Fraction]
"""Coefficients of 1, q, q**2, ..., or of 1, cos, cos 2 theta, ..."""


class Reflection(NamedTuple):
    """Coefficients of the quadratic form, cosine sums, each of shape (2, m).

    First: of |C Y + E|**2 - |H|**2 |A Y + B|**2; second: of |H|**2 |A Y + B|**2 alone.
    """

    curve: Float
    slope: Float
    slope_sine: Float
    rest: Float
    curve_0: Float
    rest_0: Float
    locked: bool
    """Whether the port is stable on a lever that cannot move."""

    def at(self, theta: Float) -> list[tuple[Float, npt.NDArray[np.complex128], Float]]:
        """Return curve, slope and rest of both forms at each theta, to rounding."""
        cosines = np.cos(np.outer(theta, np.arange(self.rest.shape[1])))
        x, sine = 1.0 - np.cos(theta), np.sin(theta)
        return [
            (
                x * (cosines @ self.curve[i]) + self.curve_0[i],
                cosines @ self.slope[i] + 1j * sine * (cosines @ self.slope_sine[i]),
                x * (cosines @ self.rest[i]) + self.rest_0[i],
            )
            for i in (0, 1)
        ]


@functools.lru_cache(maxsize=256)
def reflection(p: PortParams, observer: ObserverParams, delay_periods: int) -> Reflection:
    """Return what a port makes of a wave; no length of line, no tank."""
    b, slip = Fraction(p.impedance), Fraction(p.impedance) * Fraction(p.slip)
    period, lead = Fraction(p.period), Fraction(p.lead)
    by_sample, by_effort, below = _observer(observer)
    late = [Fraction(0)] * delay_periods + [Fraction(1)]
    # predicted mean velocity of the acting period, per true velocity and per effort
    seen = _plus(by_sample[1], _times([lead * period], by_sample[2]))
    by_velocity = _times(late, _times([Fraction(0), period], _without_root_one(seen)))
    fed = _times(late, _plus(by_effort[1], _times([lead * period], by_effort[2])))
    under_way = [Fraction(1)] + [Fraction(2)] * delay_periods
    fed = _plus(fed, _times(_times([-Fraction(p.half_mobility)], under_way), below))
    sent = _times([1 / period, -1 / period], by_effort[0][1:])
    arriving_c = _times([b], by_velocity)
    arriving_e = _plus(_times([1 + slip], below), _times([-b], fed))
    a = _plus(_times([2 * b], by_sample[0]), _times([Fraction(-1)], arriving_c))
    own = _plus(_times([slip - 1], below), _times([b], fed))
    own = _plus(own, _times([-2 * b], sent))
    gain = Fraction(p.filter_gain)
    low_pass = [Fraction(1), gain - 1]
    c, e = _times(low_pass, arriving_c), _times(low_pass, arriving_e)
    a, own = _times([gain], a), _times([gain], own)
    curve = [_cosines(c, c), _cosines(a, a)]
    rest = [_cosines(e, e), _cosines(own, own)]
    slope = [_cosines(c, e), _cosines(a, own)]
    turn = [_sines(c, e), _sines(a, own)]
    for each in (curve, rest, slope, turn):
        each[0] = _plus(each[0], [-part for part in each[1]])
    size = max(len(part) for each in (curve, rest, slope, turn) for part in each)
    return Reflection(
        _floats([_over_x(each) for each in curve], size),
        _floats(slope, size),
        _floats(turn, size),
        _floats([_over_x(each) for each in rest], size),
        _floats([[sum(each, Fraction(0))] for each in curve], 1)[:, 0],
        _floats([[sum(each, Fraction(0))] for each in rest], 1)[:, 0],
        _inside(arriving_e),
    )


def _observer(o: ObserverParams) -> tuple[list[Poly], list[Poly], Poly]:
    """Return the observed state per sample and per effort, and their common denominator."""
    t, mobility = Fraction(o.period), Fraction(o.inverse_mass)
    gain = [Fraction(o.position), Fraction(o.velocity), Fraction(o.disturbance)]
    first = [Fraction(1), t, t * t / 2]
    push = [-mobility * t * t / 2, -mobility * t, Fraction(0)]
    move = [first, [Fraction(0), Fraction(1), t], [Fraction(0), Fraction(0), Fraction(1)]]
    step = [[move[i][j] - gain[i] * first[j] for j in range(3)] for i in range(3)]
    fed = [push[i] - gain[i] * push[0] for i in range(3)]
    unit = [[Fraction(int(i == j)) for j in range(3)] for i in range(3)]
    adjugate, below = [unit], [Fraction(1)]
    for at in (1, 2, 3):
        product = _matmul(step, adjugate[-1])
        below.append(-sum((product[i][i] for i in range(3)), Fraction(0)) / at)
        adjugate.append([[product[i][j] + below[-1] * unit[i][j] for j in range(3)]
                         for i in range(3)])  # fmt: skip
    parts = adjugate[:3]
    by_sample = [[sum((m[i][j] * gain[j] for j in range(3)), Fraction(0)) for m in parts]
                 for i in range(3)]  # fmt: skip
    by_effort = [[Fraction(0)] + [sum((m[i][j] * fed[j] for j in range(3)), Fraction(0))
                 for m in parts] for i in range(3)]  # fmt: skip
    if o.disturbance == 0.0:  # then the outside acceleration stays zero, a state of its own
        by_sample = [_without_root_one(each) for each in by_sample]
        by_effort = [_without_root_one(each) for each in by_effort]
        below = _without_root_one(below)
    return by_sample, by_effort, below


def _matmul(a: list[Poly], b: list[Poly]) -> list[Poly]:
    return [
        [sum((a[i][k] * b[k][j] for k in range(3)), Fraction(0)) for j in range(3)]
        for i in range(3)
    ]


def _times(a: Poly, b: Poly) -> Poly:
    product = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            product[i + j] += left * right
    return product


def _plus(a: Poly, b: Poly) -> Poly:
    size = max(len(a), len(b))
    return [(a[i] if i < len(a) else 0) + (b[i] if i < len(b) else Fraction(0))
            for i in range(size)]  # fmt: skip


def _without_root_one(a: Poly) -> Poly:
    """Return a(q) / (1 - q); a standing lever has no velocity."""
    quotient, total = [], Fraction(0)
    for each in a:
        total += each
        quotient.append(total)
    assert total == 0
    return quotient[:-1]


def _cosines(a: Poly, b: Poly) -> Poly:
    """Return Re(a conj(b)) as a sum of cosines."""
    sums = [Fraction(0)] * max(len(a), len(b))
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            sums[abs(i - j)] += left * right
    return sums


def _sines(a: Poly, b: Poly) -> Poly:
    """Return Im(a conj(b)) / sin(theta) as a sum of cosines."""
    sums = [Fraction(0)] * max(len(a), len(b))
    for i, left in enumerate(a):
        for j, right in enumerate(b):
            for k in range(abs(i - j) - 1, -1, -2):
                once = (2 if k > 0 else 1) * left * right
                sums[k] += once if j > i else -once
    return sums


def _over_x(a: Poly) -> Poly:
    """Return (a(theta) - a(0)) / (1 - cos(theta)): sums of Fejer's kernels."""
    sums = [Fraction(0)] * len(a)
    for k, each in enumerate(a):
        for j in range(k):
            sums[j] -= each * (2 * (k - j) if j > 0 else k)
    return sums


def _inside(a: Poly) -> bool:
    """Return whether z**n a(1/z) has all its zeros inside the unit circle (Schur)."""
    while len(a) > 1:
        share = a[-1] / a[0]
        if abs(share) >= 1:
            return False
        mirrored = [each - share * other for each, other in zip(a, reversed(a), strict=True)]
        a = [each / mirrored[0] for each in mirrored[:-1]]
    return True


def _floats(rows: list[Poly], size: int) -> Float:
    return np.array([[float(each) for each in row] + [0.0] * (size - len(row)) for row in rows])
