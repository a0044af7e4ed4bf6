"""A spring between two devices that sampling, delays and dampers make active, clipped or not.

A law of positions answers samples with efforts that act later: a[j], 2 x 2, are the efforts at both
ends j periods after a sample of either was off by 1, in the units of one side. With S = sum a[j],
c[i] = sum of a[j] over j >= i and u[k] = x[k+1] - x[k] the effort that acts in period k is

    f[k] = S x[k] - sum over i >= 1 of c[i] u[k-i],

since x[k-j] = x[k] - u[k-1] - ... - u[k-j]. Let S = s [[1, -1], [-1, 1]], s >= 0: a spring.

**Clipped.** Let both ends send phi(asked), phi odd, not decreasing, no steeper than 1, and the same
at both ends at any time: a clip, or none. With e = x1 - x2 the effort phi(s e) has a potential P
with P'' <= s, so holding it over a period costs at most s (u1 - u2)^2 / 2 more than P changes, and
phi(s e + r) is off from phi(s e) by at most |r|, which is a sum of |c[i] u[k-i]|. Each device's
damping d takes d u^2 / T at least of a motion between two samples. Summed over a run, with U the
root sums of squares of u1 and u2 and N = sum |c[i]| (Cauchy and Schwarz), both take

    U' (diag(d) - n) U / T + P(end) - P(start)  or more,
    n = T [s/2 [[1, 1], [1, 1]] + (N + N') / 2].

So the pair is passive for any hand, environment, delay and clip if

    d1 >= n11,  d2 >= n22,  (d1 - n11) (d2 - n22) >= n12^2.

A clip that sinks in a run lowers P; one that rises while |s e| is below it leaves P as it is.

A bare spring K with n periods between the ends and L until a command acts needs K T (n + 1 + 2 L)
of two equal devices, which is what slow motion needs without any clip: it is exact. A damper counts
as its size at both ends, also one to ground, whatever its phase.

**Clipped, phases kept.** phi(s e + r) - phi(s e) = g r with a g from 0 to 1, so with y = sum of
c[i] u[k-i] an end loses g y u by it, and for any weight t > 0

    g y u <= max(0, y u) <= (u + t y)^2 / 4 t,

the second since (u + t y)^2 - 4 t y u = (u - t y)^2. The right side is a square of what is linear
in u: summed over all time, with u = 0 after the run, it is a form on the unit circle (Parseval),
and the pair is passive as above if for one t1, t2 and all z there

    diag(d)/T - s/2 [[1, -1], [-1, 1]] - (C + C*)/4 - (1/t + C* t C)/4 >= 0,  C = sum c[i] z^-i.

Of a bare spring that is the same number; of dampers that act early against the lag of a line it is
near what no clip needs. It is convex in t, and any t is a proof: the best of a search is taken, and
of both bounds the lesser. Whole periods only.

**A fraction f of a period** until a command acts, of end i: for that share the effort before acts,
with displacements u' and u'' in both parts, u = u' + u''. The effort before has the tails S, c[1],
c[2], ..., so N is larger by s in row i, and with u' = f u + y the damping takes y^2 d / (T f (1-f))
more while the larger N costs s (|u1| + |u2|) |y|. So n grows by

    f T s in row i, half of it in column i, and all of it by T^2 f (1 - f) s^2 / (4 d_i).

**Never clipped.** The energy taken is then a sum of squares if the Hermitian part of
diag(d)/T - S/2 - sum c[i] z^-i is >= 0 on the unit circle: a trigonometric polynomial of degree L,
without a pole at z = 1. Necessary, too, for one who moves both ends. It is evaluated at N points;
at its greatest need, at most pi / N from one of them, the form of that eigenvector has slope 0 and
a second derivative of at most sum i^2 |c[i]|, or L^2 / 2 times its range (Bernstein), so the need
is at most (pi / N)^2 / 2 times that more than what was found.

**Answers that never end.** Where a law's velocities are filtered with poles p1, p2 and predicted
from the efforts that were sent, a = a0 + b * a with answers a0 to a sample and b to an effort that
was sent, each known to its end: a geometric one. With R(h) = sum r^j |h[j]| for an r > 1 and
R(b) < 1, R(a) <= R(a0) / (1 - R(b)), so |a[j]| <= R(a) r^-j: what a cut at J leaves out changes the
sum of all tails by at most sum over j > J of j |a[j]| <= (J + 1) r^-(J + 1) R(a), if J + 1 is at
least 1 / ln r. What is clipped then also tells on what is asked: the theorem above does not cover
that, only a law that never clips, and beside which nothing else is sent.

Sources: Colgate & Schenkel 1997 (the condition of one port), Bernstein's inequality; the rest is
derived here. SI.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]

ALIKE = 1e-9
"""Relative: what rounding may leave of S beside a spring."""

POINTS = 32
"""Points on the unit circle per degree of the polynomial: 0.5 % of its range is between them."""

NEAR = 0.005
"""Relative: a closed form so near to what no clip needs is not improved."""

SPARSE, CUTS, REACH = 8, 16, 2.0
"""Weights t are searched at every so many points, by so many cuts each, within e^REACH."""

REST = 1e-9
"""Of the greatest answer, what a cut may leave out."""


LOUDEST = 1e100
"""Beyond it an answer runs away."""

RATES = 8
LOUD = 0.9
"""How many r are tried, each nearer to 1, until R(b) is below this."""

LONGEST = 10000
"""Periods beyond eight of its memories after which an answer is given up."""


class Spring(NamedTuple):
    """Answers of a law of positions, as far as energy asks for them; in the units of one side.

    stiffness s [N m/rad or N/m]; tails c[1], c[2], ... of shape (L, 2, 2); period T [s]; late: the
    fraction f of a period for which either end's last command still acts; rest: what all tails that
    are left out sum up to at most [N m/rad or N/m].
    """

    stiffness: float
    tails: Floats
    period: float
    late: tuple[float, float] = (0.0, 0.0)
    rest: float = 0.0


def spring_of(
    answers: Floats, period: float, late: tuple[float, float] = (0.0, 0.0), rest: float = 0.0
) -> Spring | None:
    """Return the spring in a law's answers a[j], of shape (n, 2, 2); None if there is none."""
    total = answers.sum(axis=0)
    size = float(np.max(np.sum(np.abs(answers), axis=0)))
    stiffness = 0.25 * float(total[0, 0] + total[1, 1] - total[0, 1] - total[1, 0])
    off = total - stiffness * np.array([[1.0, -1.0], [-1.0, 1.0]])
    allowed = ALIKE * size + 2.0 * rest
    if not np.all(np.abs(off) <= allowed) or stiffness < -allowed:
        return None
    tails = np.cumsum(answers[::-1], axis=0)[::-1][1:]
    return Spring(max(stiffness, 0.0), tails, period, late, rest)


class Needs(NamedTuple):
    """What a spring needs of both devices' damping d, however it is clipped.

    one, two, both: n11, n22, n12 [N m s/rad or N s/m]; spread: what fractions of a period add to
    each of them per 1 / d, by end [(N m s/rad)^2 or (N s/m)^2].
    """

    one: float
    two: float
    both: float
    spread: tuple[float, float] = (0.0, 0.0)

    def covered(self, one: float, two: float) -> bool:
        """Return whether devices with these dampings cover it [N m s/rad or N s/m]."""
        more = 0.0
        for spread, damping in zip(self.spread, (one, two), strict=True):
            if spread > 0.0:
                more += spread / damping if damping > 0.0 else math.inf
        spare, other = one - self.one - more, two - self.two - more
        return spare >= 0.0 and other >= 0.0 and spare * other >= (self.both + more) ** 2

    def lack(self, one: float, two: float) -> float:
        """Return what both lack alike [N m s/rad or N s/m]; 0 or less where it is covered."""
        middle = 0.5 * (one + two - self.one - self.two)
        differ = 0.5 * (one - two - self.one + self.two)
        lack = math.hypot(differ, self.both) - middle
        if not any(self.spread):
            return lack
        low, high = lack, lack + 4.0 * math.sqrt(sum(self.spread))
        for _ in range(80):
            middle = 0.5 * (low + high)
            if self.covered(one + middle, two + middle):
                high = middle
            else:
                low = middle
        return high


def clipped_needs(spring: Spring) -> Needs:
    """Return what a spring needs of both devices, clipped anyhow; its answers have an end."""
    sums = np.abs(spring.tails).sum(axis=0)
    sums += spring.stiffness * np.array(spring.late)[:, None]
    shared = 0.5 * (sums + sums.T) + 0.5 * spring.stiffness
    step = spring.period * spring.stiffness
    one, two = (0.25 * f * (1.0 - f) * step * step for f in spring.late)
    needs = spring.period * shared
    return Needs(float(needs[0, 0]), float(needs[1, 1]), float(needs[0, 1]), (one, two))


class Lack(NamedTuple):
    """What both devices lack alike [N m s/rad or N s/m], at an angle per period [rad]."""

    damping: float
    angle: float


class _Form(NamedTuple):
    """Hermitian 2 x 2 forms at points of the unit circle: what both devices need, and beside."""

    one: Floats
    two: Floats
    cross: Complexes

    def greatest(self) -> tuple[float, int, float]:
        """Return the greatest need, where it is, and the range of all eigenvalues."""
        mean = 0.5 * (self.one + self.two)
        radius = np.hypot(0.5 * (self.one - self.two), np.abs(self.cross))
        worst = int(np.argmax(mean + radius))
        most = float(mean[worst] + radius[worst])
        return most, worst, most - float(np.min(mean - radius))


def _answers_at(spring: Spring) -> tuple[Complexes, int]:
    """Return sum c[i] z^-i at points of the upper half circle, (n, 2, 2), and how many in all."""
    points = 1 << max(8, (POINTS * (len(spring.tails) + 1) - 1).bit_length())
    tails = np.concatenate([np.zeros((1, 2, 2)), spring.tails])
    return np.fft.rfft(tails, points, axis=0), points


def _never_clipped(spring: Spring, answers: Complexes, damping: tuple[float, float]) -> _Form:
    half = 0.5 * spring.stiffness
    cross = 0.5 * (answers[:, 0, 1] + answers[:, 1, 0].conj()) - half
    one, two = (answers[:, end, end].real + half for end in (0, 1))
    step = spring.period
    return _Form(step * one - damping[0], step * two - damping[1], step * cross)


def _between(degree: int, points: int, spread: float, bent: float = math.inf) -> float:
    """Return what a form may exceed its values at the points by; `bent`: its greatest curvature."""
    between = 0.5 * (math.pi / points) ** 2
    # the range at N points, and what lies between them of it, at most
    return between * min(bent, 0.5 * degree**2 * spread / (1.0 - between * degree**2))


def linear_lack(spring: Spring, damping: tuple[float, float] = (0.0, 0.0)) -> Lack:
    """Return what devices lack for a spring that is never clipped; whole periods only."""
    answers, points = _answers_at(spring)
    lack, worst, spread = _never_clipped(spring, answers, damping).greatest()
    degree = len(spring.tails)
    slots = np.arange(1.0, degree + 1.0)
    sizes = np.linalg.norm(spring.tails, axis=(1, 2))
    bent = spring.period * float(np.sum(slots * slots * sizes))
    more = _between(degree, points, spread, bent) + 2.0 * spring.period * spring.rest
    return Lack(lack + more, 2.0 * math.pi * worst / points)


def clipped_lack(spring: Spring, damping: tuple[float, float] = (0.0, 0.0)) -> float:
    """Return what devices lack for a spring, clipped anyhow [N m s/rad or N s/m].

    The lesser of both bounds; infinite damping is left out. Its answers have an end.
    """
    needs = clipped_needs(spring)
    closed = needs.lack(*damping)
    if any(spring.late) or len(spring.tails) == 0:
        return closed
    answers, points = _answers_at(spring)
    least, _, _ = _never_clipped(spring, answers, damping).greatest()
    if closed - least <= NEAR * needs.lack(0.0, 0.0):
        return closed
    whole = _phased(spring, answers, damping)
    few = _phased(spring, answers[::SPARSE], damping)

    def of_one(one: float) -> tuple[float, float]:
        return _lowest(lambda two: few.form(one, two).greatest()[0])

    _, one = _lowest(lambda one: of_one(one)[0])
    _, two = of_one(one)
    lack, _, spread = whole.form(one, two).greatest()
    return min(closed, lack + _between(len(spring.tails), points, spread))


class _Phased(NamedTuple):
    """What a clipped spring needs where phases are kept, but for its weights t.

    fixed: without them; sizes: of the answers at either end, the greatest; squares: C* C by the end
    that answers.
    """

    fixed: _Form
    quarter: float
    sizes: Floats
    squares: tuple[_Form, _Form]

    def form(self, one: float, two: float) -> _Form:
        """Return the form where t is e^-one and e^-two over the sizes; none of what is 0."""
        scale = self.sizes * np.exp([one, two])
        weights = self.quarter / np.where(scale > 0.0, scale, math.inf)
        first, second = self.squares
        return _Form(
            self.fixed.one + weights[0] * first.one + weights[1] * second.one
            + self.quarter * scale[0],
            self.fixed.two + weights[0] * first.two + weights[1] * second.two
            + self.quarter * scale[1],
            self.fixed.cross + weights[0] * first.cross + weights[1] * second.cross,
        )  # fmt: skip


def _phased(spring: Spring, answers: Complexes, damping: tuple[float, float]) -> _Phased:
    own = _never_clipped(spring, answers, (0.0, 0.0))
    step = 0.5 * spring.period * spring.stiffness
    fixed = _Form(
        0.5 * (own.one + step) - damping[0],
        0.5 * (own.two + step) - damping[1],
        0.5 * (own.cross - step),
    )
    sizes = np.max(np.linalg.norm(answers, axis=2), axis=0)
    first, second = (
        _Form(np.abs(row[:, 0]) ** 2, np.abs(row[:, 1]) ** 2, row[:, 0].conj() * row[:, 1])
        for row in (answers[:, 0], answers[:, 1])
    )
    return _Phased(fixed, 0.25 * spring.period, sizes, (first, second))


def _lowest(function: Callable[[float], float]) -> tuple[float, float]:
    """Return the lowest value of a function with one valley, and where, by golden sections."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    low, high = -REACH, REACH
    left, right = high - golden * (high - low), low + golden * (high - low)
    at_left, at_right = function(left), function(right)
    for _ in range(CUTS):
        if at_left <= at_right:
            high, right, at_right = right, left, at_left
            left = high - golden * (high - low)
            at_left = function(left)
        else:
            low, left, at_left = left, right, at_right
            right = low + golden * (high - low)
            at_right = function(right)
    return (at_left, left) if at_left <= at_right else (at_right, right)


class Asked(NamedTuple):
    """What a law asks for: answers to a sample and to an effort that was sent, each (n, 2, 2).

    poles: of the velocities' filters, by the end that was off [1]; what follows the last answers
    decays by them.
    """

    to_sample: Floats
    to_effort: Floats
    poles: tuple[float, float]


def closed_answers(asked: Asked) -> tuple[Floats, float] | None:
    """Return answers of a law that hears what it sent, and what they leave out in all tails.

    None where the bound of what is left out is none.
    """
    pole = max(asked.poles)
    memory = max(len(asked.to_sample), len(asked.to_effort))
    if pole == 0.0:
        # both have an end; so has what is made of them where one end hears the other alone
        answers = _closed(asked, 4 * memory)
        quiet = ALIKE * float(np.max(np.abs(asked.to_sample)))
        if answers is None or np.any(np.abs(answers[-memory:]) > quiet):
            return None
        return answers, 0.0
    rate = min(-0.5 * math.log(pole), 40.0 / memory)
    for _ in range(RATES):
        loud = _weighed(asked.to_effort, rate, pole)
        if loud < LOUD:
            break
        rate *= 0.5
    if not loud < 1.0:
        return None
    whole = _weighed(asked.to_sample, rate, pole) / (1.0 - loud)
    limit = REST * float(np.max(np.abs(asked.to_sample)))
    length = max(memory, math.ceil(1.0 / rate))
    while (length + 1) * math.exp(-rate * (length + 1)) * whole > limit:
        length = math.ceil(1.1 * length)
        if length > 8 * memory + LONGEST:
            return None
    answers = _closed(asked, length)
    assert answers is not None
    rounding = 2.0**-52 * float(np.max(np.abs(answers))) * length**2
    return answers, (length + 1) * math.exp(-rate * (length + 1)) * whole + rounding


def _closed(asked: Asked, length: int) -> Floats | None:
    """Return a = a0 + b * a up to a[length], None where it runs away.

    It is (1 + b) (1 + b^2) (1 + b^4) ... a0, as b[0] is 0.
    """
    answers, heard = (np.zeros((length + 1, 2, 2)) for _ in range(2))
    answers[: len(asked.to_sample)] = asked.to_sample
    heard[: len(asked.to_effort)] = asked.to_effort
    reach = 1
    while reach <= length:
        answers = answers + _after(heard, answers)
        heard = _after(heard, heard)
        reach *= 2
        if not max(np.max(np.abs(answers)), np.max(np.abs(heard))) < LOUDEST:
            return None
    return answers


def _after(first: Floats, then: Floats) -> Floats:
    """Return the convolution of two series of matrices, as long as they are."""
    size = 2 * len(first)
    product = np.fft.rfft(first, size, axis=0) @ np.fft.rfft(then, size, axis=0)
    return np.fft.irfft(product, size, axis=0)[: len(first)]


def _weighed(answers: Floats, rate: float, pole: float) -> float:
    """Return sum of r^j |h[j]| with r = e^rate, and with what follows by the pole."""
    sizes = np.linalg.norm(answers, axis=(1, 2))
    slots = np.arange(len(sizes))
    follows = sizes[-1] * math.exp(rate * slots[-1]) / (math.exp(-rate) / pole - 1.0)
    return float(np.sum(np.exp(rate * slots) * sizes) + follows)
