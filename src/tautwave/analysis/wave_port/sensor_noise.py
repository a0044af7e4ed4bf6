"""What sensor noise takes from a port's tank, and what it can feign, in watts known beforehand.

A sample that is off by n enters the effort of the port and the next displacement: the tank books
F (n[k+1] - n[k]), which is not work, and the port sends waves that answer to nothing. With the
spectrum S of the noise (mean: its variance) the tank changes per period by the mean over theta of

    S Q_tot,   Q_tot = Q + T/2 (|A|**2 - |U|**2),   Q = Re(conj(G) (e^(j theta) - 1)),

G the effort, A and U the arriving and leaving wave per unit of noise, the lever at rest and every
reflection included. A and U belong together by what stands at the far end: anything passive
behind any line answers with a wave not larger than the one that left, of any phase.

The drain -min Q_tot is what a leak has to give, whatever the colour of the noise; max Q is what an
encoder can make the tank believe. Both are in units of variance. A declared autocorrelation takes
the mean over its spectrum instead of the worst frequency, and a margin: `identify` tapers the lags
that it measures, which widens a narrow band by 1/17 of the rate and lessens its drain by up to a
fifth (at pole 0.3 with two periods of delay by up to 30 %).

What quantisation takes is not noise: a held contact limit-cycles within a step or two and passes
real energy on. `QUANTUM_DRAIN` is above what a search over held contacts found, in units of
b q**2 / T**2 [W]; elsewhere the worst colour of a bounded error of q/2 counts, the sure bound.

Sources: derived here.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.laws.observer import ObserverParams
from tautwave.laws.port import PortParams
from tautwave.models.noise_colour import spectrum

Complex = npt.NDArray[np.complex128]

FREQUENCIES = 160
PHASES = 12
MARGIN = 1.25
"""On drain and gain of a declared spectrum, so that the tank stays full."""

QUANTUM_DRAIN = ((0.5, (0.25, 0.12, 0.12)), (0.3, (0.5, 0.25, 0.2)))
"""Least pole, and above the greatest drain of a quantum found there: by command delay 0, 1, 2."""

SEARCHED = 0.6
"""Greatest pole of that search."""


class NoiseBounds(NamedTuple):
    """Per variance of the noise [J per period and rad**2 or m**2]: taken at most, feigned most."""

    drain: float
    feigned: float


class NoisePower(NamedTuple):
    """Watts that a port's leak has to give (`lost`), and that noise can feign (`gained`)."""

    lost: float
    gained: float


class Responses(NamedTuple):
    """Answers of a port with its lever at rest, per unit of noise, each of shape (n,).

    effort [N m/rad or N/m]; arriving and leaving waves [W**0.5 per rad or m].
    """

    effort: Complex
    arriving: Complex
    leaving: Complex


def observer_response(p: ObserverParams, theta: npt.NDArray[np.float64]) -> tuple[Complex, Complex]:
    """Return the observed state per sample and per effort, each of shape (3, n), at e^(j theta)."""
    back = np.exp(-1j * theta)
    period = p.period
    move = np.array([[1.0, period, 0.5 * period**2], [0.0, 1.0, period], [0.0, 0.0, 1.0]])
    push = -p.inverse_mass * np.array([0.5 * period**2, period, 0.0])
    gain = np.array([p.position, p.velocity, p.disturbance])
    keep = np.eye(3) - np.outer(gain, (1.0, 0.0, 0.0))
    matrix = np.eye(3)[None] - (keep @ move)[None] * back[:, None, None]
    sides = np.empty((len(theta), 3, 2), dtype=complex)
    sides[:, :, 0] = gain
    sides[:, :, 1] = (keep @ push)[None] * back[:, None]
    solved = np.linalg.solve(matrix, sides)
    return solved[:, :, 0].T, solved[:, :, 1].T


def noise_responses(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    theta: npt.NDArray[np.float64],
    far: Complex,
) -> Responses:
    """Return what a unit of noise makes of effort and waves; `far` is arriving per leaving wave."""
    ahead = np.exp(1j * theta)
    by_sample, by_effort = observer_response(observer, theta)
    lead = p.period * p.lead
    seen = by_sample[1] + lead * by_sample[2]
    fed = by_effort[1] + lead * by_effort[2]
    under_way = sum((ahead**at for at in range(delay_periods)), np.zeros_like(ahead))
    # own F = b seen n - root a; F acts `delay_periods` after its sample
    own = ahead**delay_periods * p.divisor + p.impedance * (2.0 * p.half_mobility * under_way - fed)
    # U = H (moved n + carried F - late a), a = far U
    rate = p.root * (1.0 - 1.0 / ahead) / p.period
    low_pass = p.filter_gain / (1.0 - (1.0 - p.filter_gain) / ahead)
    moved, carried = rate * by_sample[0], rate * by_effort[0] - p.root * p.slip / ahead
    late = ahead ** -(delay_periods + 1.0)
    through = 1.0 + low_pass * far * (late + carried * p.root / own)
    leaving = low_pass * (moved + carried * p.impedance * seen / own) / through
    arriving = far * leaving
    effort = (p.impedance * seen - p.root * arriving) / own
    return Responses(effort, arriving, leaving)


def tank_changes(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    theta: npt.NDArray[np.float64],
    far: Complex,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return Q_tot and Q, both of shape (n,) [J per period and unit of spectrum]."""
    answer = noise_responses(p, observer, delay_periods, theta, far)
    seen = np.real(np.conj(answer.effort) * (np.exp(1j * theta) - 1.0))
    waves = 0.5 * p.period * (np.abs(answer.arriving) ** 2 - np.abs(answer.leaving) ** 2)
    return seen + waves, seen


def worst_changes(
    p: PortParams, observer: ObserverParams, delay_periods: int, theta: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return -Q_tot and Q, each of shape (n,), behind the worst line and passive far end.

    The worst is taken at each frequency: a line may turn the wave by another phase at each.
    """
    lost = feigned = np.full(len(theta), -math.inf)
    far_size = np.abs(p.filter_gain / (1.0 - (1.0 - p.filter_gain) * np.exp(-1j * theta)))
    for at in range(PHASES):
        far = far_size * np.exp(2j * math.pi * at / PHASES)
        total, seen = tank_changes(p, observer, delay_periods, theta, far)
        lost, feigned = np.maximum(lost, -total), np.maximum(feigned, seen)
    return lost, feigned


@functools.lru_cache(maxsize=256)
def noise_bounds(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    autocorrelation: tuple[float, ...] | None = None,
) -> NoiseBounds:
    """Return drain and feigned gain behind any line and passive far end.

    Of noise of the `autocorrelation` from lag 1 on, with a margin; of the worst colour, which is
    never less, without one.
    """
    theta = math.pi * (np.arange(FREQUENCIES) + 0.5) / FREQUENCIES
    lost, feigned = worst_changes(p, observer, delay_periods, theta)
    worst = NoiseBounds(max(float(lost.max()), 0.0), max(float(feigned.max()), 0.0))
    if autocorrelation is None:
        return worst
    shares = np.array([max(spectrum(autocorrelation, at), 0.0) for at in theta.tolist()])
    drain, gain = (MARGIN * float(np.mean(shares * each)) for each in (lost, feigned))
    return NoiseBounds(
        min(max(drain, 0.0), worst.drain),
        min(max(gain, 0.0), worst.feigned),
    )


def noise_power(
    p: PortParams,
    observer: ObserverParams,
    delay_periods: int,
    deviation: float,
    quantum: float,
    autocorrelation: tuple[float, ...] | None = None,
) -> NoisePower:
    """Return the powers [W] of a declared noise.

    Parameters
    ----------
    p, observer : PortParams, ObserverParams
        The port; its own leak is not used.
    delay_periods : int
        Command delay; a fraction counts as a whole period.
    deviation : float
        Standard deviation of the noise [rad or m].
    quantum : float
        Encoder step [rad or m].
    autocorrelation : tuple of float, optional
        r_1, r_2, ... per variance [1]; without it the worst colour is taken.
    """
    bounds = noise_bounds(p, observer, delay_periods, autocorrelation)
    scale = deviation * deviation / p.period
    step = quantum_power(p, observer, delay_periods, quantum)
    return NoisePower(scale * bounds.drain + step, scale * bounds.feigned)


def quantum_power(
    p: PortParams, observer: ObserverParams, delay_periods: int, quantum: float
) -> float:
    """Return what an encoder step can take [W]: K b q**2 / T**2, see `QUANTUM_DRAIN`."""
    if quantum == 0.0:
        return 0.0
    drain = [drains[delay_periods] for pole, drains in QUANTUM_DRAIN
             if pole <= observer.pole <= SEARCHED and delay_periods < len(drains)]  # fmt: skip
    if drain:
        return drain[0] * p.impedance * quantum * quantum / (p.period * p.period)
    return noise_bounds(p, observer, delay_periods).drain * 0.25 * quantum * quantum / p.period
