"""Sampled position-position pair: the damping (b_m, b_s) both devices need, holds included.

The controller takes positions at samples and holds efforts, so its energy over a period is
F[k] (x[k+1] - x[k]) at each end, while dampers take at least b times the squared mean motion
between samples. At one frequency that is a Hermitian form in the two positions (for a delay with
a fraction of a period: in two functionals of each motion), and the pair of devices is passive for
any masses, hands and environments exactly if

    diag(b_m, b_s) - (T/2) Herm{(1 - 1/z) E(z)} / (1 - cos theta) >= 0   for all 0 < theta <= pi,

with E the matrix of efforts per position. This is Colgate and Schenkel's condition with two
velocities. For a spring K and M samples each way it needs K T (1 + M) at equal ends: the delay of
both ways halved, and a whole period for the holds and samplers. Continuous analysis sees K T M.

Sources: Colgate & Schenkel 1997 (one velocity); Nuno et al., Automatica 47, 2011 (continuous,
b_m b_s >= (K tau)**2); the two-velocity form is written here. Units: master's SI; a scaled slave
is to be brought into them first.
"""

from __future__ import annotations

import math
from fractions import Fraction
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.bounds import common_integers
from tautwave.analysis.walls.passivity import LeakForm, leak_form
from tautwave.analysis.walls.sampled import (
    SampledWall,
    check_wall,
    split_delay,
    velocity_gain,
    wall_transfer,
)
from tautwave.errors import ConfigError

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


class PairLaw(NamedTuple):
    """A position coupling with its delays and, if any, a local wall at each end.

    Attributes
    ----------
    coupler : SampledWall
        K, B, period and velocity filter of the coupling; its delay is that of the commands of
        both ends, in periods.
    to_slave, to_master : int
        One-way delays [samples].
    wall_master, wall_slave : SampledWall, optional
        Pressed local walls, with the same period and command delay.
    """

    coupler: SampledWall
    to_slave: int = 0
    to_master: int = 0
    wall_master: SampledWall | None = None
    wall_slave: SampledWall | None = None


class PairNeed(NamedTuple):
    """Damping that makes a pair passive.

    Attributes
    ----------
    master, slave : float
        b of the devices [N s/m or N m s/rad]; slave is the least beside master, inf if none is.
    theta : float
        w T at which it is needed, in [0, pi]; 0 is the limit of low frequencies.
    proved : bool
        Whether by algebra (whole periods of delay, equal ways); else by a refined search.
    """

    master: float
    slave: float
    theta: float
    proved: bool


def needed_slave_damping(law: PairLaw, master_damping: float) -> PairNeed:
    """Return the least damping of the slave beside that of the master; see `PairNeed`."""
    _check(law)
    if not (math.isfinite(master_damping) and master_damping >= 0.0):
        raise ConfigError(f"master damping: must be finite, not negative (got {master_damping})")
    if _is_exact(law):
        return _proved(law, master_damping)
    return _searched(law, master_damping)


def needed_equal_damping(law: PairLaw) -> PairNeed:
    """Return the least damping that, the same at both ends, makes the pair passive."""
    _check(law)
    whole, rest = split_delay(law.coupler.delay)
    if _is_exact(law) and law.wall_master is None and law.wall_slave is None:
        own, cross = _exact_forms(law.coupler, law.to_slave)
        # Equal ends move together or against each other: two scalar conditions.
        found = [_sum_form(own, cross, sign).greatest() for sign in (1, -1)]
        value, _, theta = max(found)
        least = max(0.5 * law.coupler.period * value, 0.0)
        return PairNeed(least, least, theta, proved=True)
    span = 2.0 + whole + rest + law.to_slave + law.to_master
    high = span * law.coupler.period * law.coupler.stiffness + 4.0 * abs(law.coupler.damping)
    for wall in (law.wall_master, law.wall_slave):
        if wall is not None:
            high += wall.stiffness * wall.period * (1.0 + wall.delay) + 4.0 * abs(wall.damping)
    low = 0.0
    need = needed_slave_damping(law, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        tried = needed_slave_damping(law, middle)
        if tried.slave <= middle:
            high, need = middle, tried
        else:
            low = middle
        if high - low <= 1e-10 * high:
            break
    return need._replace(master=high, slave=high)


def is_pair_passive(law: PairLaw, master_damping: float, slave_damping: float) -> bool:
    """Return whether the pair is passive on devices of so much viscous damping."""
    return needed_slave_damping(law, master_damping).slave <= slave_damping * (1.0 + 1e-9)


def spring_pair_damping(stiffness: float, period: float, samples: int) -> float:
    """Return K T (1 + M) [N s/m or N m s/rad]: what a spring coupling needs at each equal end."""
    return stiffness * period * (1.0 + samples)


def damping_curve(law: PairLaw, master: Floats) -> Floats:
    """Return the slave's needed damping along that of the master, for a picture; shape (n,)."""
    return np.array([needed_slave_damping(law, float(value)).slave for value in master])


# -- whole periods: algebra ------------------------------------------------------------------------


def _is_exact(law: PairLaw) -> bool:
    return split_delay(law.coupler.delay)[1] == 0.0 and law.to_slave == law.to_master


def _forms_of(law: PairLaw) -> tuple[LeakForm, LeakForm, LeakForm]:
    """Return what master, slave and the coupling of both need, as y q - p each."""
    own, cross = _exact_forms(law.coupler, law.to_slave)
    master, slave = (
        own if wall is None else _sum_form(own, _form(wall, 0), 1)
        for wall in (law.wall_master, law.wall_slave)
    )
    return master, slave, cross


def _exact_forms(coupler: SampledWall, samples: int) -> tuple[LeakForm, LeakForm]:
    return _form(coupler, 0), _form(coupler, samples)


def _form(wall: SampledWall, later: int) -> LeakForm:
    whole, _ = split_delay(wall.delay)
    transfer = wall_transfer(wall)
    top, bottom = ([Fraction(value) for value in part] for part in transfer)
    return leak_form(top, bottom, float(whole + later))


def _sum_form(one: LeakForm, two: LeakForm, sign: int) -> LeakForm:
    """Return the form of y1 + sign y2."""
    p = _added(_times(one.p, two.q), _times(two.p, one.q), sign)
    return LeakForm(p, _times(one.q, two.q), [0])


def _proved(law: PairLaw, master_damping: float) -> PairNeed:
    """Return (y_s - y22)(y_m - y11) >= y12**2 solved for y_s, by the wall's algebra."""
    master, slave, cross = _forms_of(law)
    half = 0.5 * law.coupler.period
    alone, _, theta = master.greatest()
    if half * alone > master_damping:
        return PairNeed(master_damping, math.inf, theta, proved=True)
    y = Fraction(master_damping) / Fraction(half)
    # y11 = p1/q1 and so on; what is left of the master's damping is r / (q1 d).
    rest = _added([y.numerator * v for v in master.q], master.p, -1, y.denominator)
    if not any(rest):
        if any(cross.p):
            return PairNeed(master_damping, math.inf, theta, proved=True)
        value, _, theta = slave.greatest()
        return PairNeed(master_damping, max(half * value, 0.0), theta, proved=True)
    crossed = [y.denominator * v for v in _times(_times(cross.p, cross.p), master.q)]
    below = _times(rest, _times(cross.q, cross.q))
    p = _added(_times(slave.p, below), _times(crossed, slave.q), 1)
    q = _times(slave.q, below)
    if sum(rest) <= 0 or half * alone >= master_damping * (1.0 - 1e-12):
        # The master alone just passes: no finite damping of the slave makes up for a coupling.
        return PairNeed(master_damping, math.inf, theta, proved=True)
    p, q = common_integers(p, q)
    value, _, theta = LeakForm(p, q, [0]).greatest()
    return PairNeed(master_damping, max(half * value, 0.0), theta, proved=True)


def _times(one: list[int], two: list[int]) -> list[int]:
    """Return the product of two Chebyshev series, doubled."""
    out = [0] * (len(one) + len(two) - 1)
    for i, a in enumerate(one):
        for j, b in enumerate(two):
            out[i + j] += a * b
            out[abs(i - j)] += a * b
    return out


def _added(one: list[int], two: list[int], sign: int, factor: int = 1) -> list[int]:
    length = max(len(one), len(two))
    padded = one + [0] * (length - len(one))
    for at, value in enumerate(two):
        padded[at] += sign * factor * value
    return padded


# -- any delay: the form itself, searched ----------------------------------------------------------


def needed_matrix(law: PairLaw, theta: Floats) -> Complexes:
    """Return N(theta) with diag(b_m, b_m, b_s, b_s) >= N; shape (n, 4, 4), theta > 0.

    Two functionals of each motion: the sampled position, and what of the late held effort's
    motion is independent of it (nothing, where the command delay is whole).
    """
    period = law.coupler.period
    whole, rest = split_delay(law.coupler.delay)
    z = np.exp(1j * theta)
    part = np.exp(-1j * whole * theta) * ((1.0 - rest) + rest / z)
    # sqrt(1 - |part|**2), without the difference.
    apart = 2.0 * math.sqrt(rest * (1.0 - rest)) * np.sin(0.5 * theta)
    effort = _impedance(law.coupler, z)
    e = np.zeros((len(theta), 2, 2), np.complex128)
    e[:, 0, 0] = effort + (0.0 if law.wall_master is None else _impedance(law.wall_master, z))
    e[:, 1, 1] = effort + (0.0 if law.wall_slave is None else _impedance(law.wall_slave, z))
    e[:, 0, 1] = -effort * z ** (-law.to_master)
    e[:, 1, 0] = -effort * z ** (-law.to_slave)
    below = 2.0 * np.sin(0.5 * theta) ** 2  # 1 - cos, with all its digits
    scale = 0.5 * period * (1.0 + 1j * np.sin(theta) / below)  # T/2 (1 - 1/z) / (1 - cos)
    held = scale[:, None, None] * e
    out = np.zeros((len(theta), 4, 4), np.complex128)
    out[:, 0::2, 0::2] = part[:, None, None] * held
    out[:, 1::2, 0::2] = apart[:, None, None] * held
    return np.asarray(0.5 * (out + out.conj().transpose(0, 2, 1)))


def _impedance(wall: SampledWall, z: Complexes) -> Complexes:
    gain = velocity_gain(wall)
    slope = gain * (z - 1.0) / (wall.period * (z - 1.0 + gain))
    return np.asarray(wall.stiffness + wall.damping * slope)


def _needed_at(law: PairLaw, master_damping: float, theta: Floats) -> Floats:
    """Return the slave's needed damping at angles; inf where the master alone needs more."""
    form = needed_matrix(law, theta)
    rest = master_damping * np.eye(2) - form[:, :2, :2]
    least = np.linalg.eigvalsh(rest)[:, 0]
    safe = np.where((least > 0.0)[:, None, None], rest, np.eye(2))
    schur = form[:, 2:, 2:] + form[:, 2:, :2] @ np.linalg.solve(safe, form[:, :2, 2:])
    return np.where(least > 0.0, np.linalg.eigvalsh(schur)[:, -1], np.inf)


def _searched(law: PairLaw, master_damping: float) -> PairNeed:
    turns = 4 + law.to_slave + law.to_master + math.ceil(law.coupler.delay)
    low = np.geomspace(1e-4, 0.05, 200)
    theta = np.unique(np.concatenate([low, np.linspace(0.01, math.pi, 64 * turns)]))
    best, value = 0.0, -math.inf
    values = _needed_at(law, master_damping, theta)
    peaks = np.flatnonzero(
        (values >= np.concatenate([[-np.inf], values[:-1]]))
        & (values >= np.concatenate([values[1:], [-np.inf]]))
    )
    for peak in peaks[np.argsort(-values[peaks])][:12]:
        at = int(peak)
        grid, found = theta, values
        for _ in range(8):
            grid = np.linspace(grid[max(at - 1, 0)], grid[min(at + 1, len(grid) - 1)], 17)
            found = _needed_at(law, master_damping, grid)
            at = int(np.argmax(found))
        if found[at] > value:
            value, best = float(found[at]), float(grid[at])
    if best <= 2e-4:
        best = 0.0
    return PairNeed(master_damping, max(value, 0.0), best, proved=False)


# -- in the time domain ----------------------------------------------------------------------------


def lifted_need(law: PairLaw, samples: int, pieces: int) -> float:
    """Return the equal damping that motions of finite length need: a bound from below.

    Velocities are constant over each of `pieces` parts of a period, for `samples` periods, then
    zero; the greatest eigenvalue of the negated energy per integral of v**2. It rises to that of
    `needed_equal_damping` with length and pieces. Whole delays, no filter, no walls.
    """
    period, width = law.coupler.period, law.coupler.period / pieces
    whole, _ = split_delay(law.coupler.delay)
    count = samples * pieces
    # Position at sample k, per velocity of a piece.
    position = np.zeros((samples + 1, count))
    for at in range(1, samples + 1):
        position[at, : at * pieces] = width

    def sampled(at: int) -> Floats:
        return position[min(at, samples)] if at > 0 else np.zeros(count)

    def law_of(at: int, own: int) -> Floats:
        """Return K x + B v at sample `at` over both velocities."""
        x, before = sampled(at), sampled(at - 1)
        out = np.zeros(2 * count)
        out[own * count : (own + 1) * count] = law.coupler.stiffness * x
        out[own * count : (own + 1) * count] += law.coupler.damping * (x - before) / period
        return out

    energy = np.zeros((2 * count, 2 * count))
    for at in range(samples):
        for own, delay in ((0, law.to_master), (1, law.to_slave)):
            when = at - whole
            effort = law_of(when, own) - law_of(when - delay, 1 - own)
            moved = np.zeros(2 * count)
            moved[own * count + at * pieces : own * count + (at + 1) * pieces] = width
            energy += np.outer(moved, effort)
    return float(np.linalg.eigvalsh(-0.5 * (energy + energy.T) / width)[-1])


def _check(law: PairLaw) -> None:
    problems = []
    for name, wall in (("wall_master", law.wall_master), ("wall_slave", law.wall_slave)):
        if wall is not None:
            check_wall(wall)
            if (wall.period, wall.delay) != (law.coupler.period, law.coupler.delay):
                problems.append(f"{name}: period and delay must be those of the coupling")
    check_wall(law.coupler)
    for name, value in (("to_slave", law.to_slave), ("to_master", law.to_master)):
        if value < 0:
            problems.append(f"{name}: must not be negative (got {value})")
    if problems:
        raise ConfigError(problems)
