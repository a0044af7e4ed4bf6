"""Whether a coupling generated energy in a run, from its rows alone.

    G(t) = -absorbed + stored - sum over axes and gaps between samples of d dx^2 / dt

*absorbed* is what the coupling took from both devices, *stored* the potential of its spring, the
rest what the devices' sure damping d could have taken, all in the units of one side. A coupling
that is passive together with that damping never lets G rise, whatever moves both ends: each held
effort leaks no more than the damping takes. So the greatest increase between any two moments is
what it generated (from the start alone, what it lost before would pay for it), and a run in which G
rises in many of its seconds goes on generating.

A clipped spring, as both ends feel it, has the potential of the clip; with K e^2 / 2 in its place,
what was never put in would count as generated where it is stretched further than the clip.

White noise of variance s^2 in the positions is no motion, and the books take it for one: the
damping could have taken 2 d s^2 / dt less, and an effort that changes by g with its newest sample
took g s^2 more from the device than a period's books say. Both are taken back.

Source: passivity of a sampled spring between two dampers, `couplings.position.certificate`; the
rule for a run is derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.claim import NOTHING

Floats = npt.NDArray[np.float64]
Rows = npt.NDArray[np.bool_]

ACCURACY = 1e-3
"""Of what the damping could have taken: the books are no better."""

NOISE_ACCURACY = 0.1
"""Of what noise feigns: its deviation is known to a twentieth. A sum of n squares of displacements
deviates by sqrt(3 / n) of itself; three times that are left open where it is more."""

ROUNDING = 1e-12
"""Of all that passed to and fro: sums of doubles are no better."""

LASTING = 0.25
"""Of the seconds: a coupling that generates in more of them goes on."""

FEW = 2
"""Seconds in which it may generate in a run of a few seconds."""


class Rise(NamedTuple):
    """What a coupling generated, in J and s.

    Attributes
    ----------
    given : float
        Greatest increase of G between any two moments.
    begin_s, end_s : float
        These moments.
    taken : float
        What the damping could have taken in the whole run.
    floor : float
        An increase that accuracy of the books does not tell from 0.
    share : float
        Of the seconds: those in which G rises by more than its part of the floor.
    lasting : bool
        It generated more than the floor, and in more than a quarter of the seconds.
    """

    given: float
    begin_s: float
    end_s: float
    taken: float
    floor: float
    share: float
    lasting: bool

    def exceeds(self, claim: float) -> bool:
        """Return whether it generated more than was claimed [J], or goes on."""
        return self.given > max(claim, self.floor) or self.lasting


def clipped_potential(stiffness: float, clip: float | Floats, stretch: Floats) -> Floats:
    """Return the energy of a spring whose effort is clipped [J], shape of `stretch`.

    Parameters
    ----------
    stiffness : float
        K > 0 [N m/rad or N/m].
    clip : float or array
        Greatest effort of either end [N m or N].
    stretch : array
        [rad or m].
    """
    size = np.abs(stretch)
    reach = np.minimum(size, clip / stiffness)
    energy: Floats = stiffness * reach * (size - 0.5 * reach)
    return energy


def damping_work(damping: float, moved: Floats, lasted: Floats) -> Floats:
    """Return what damping takes at least between two samples [J]: d dx^2 / dt, (gaps,).

    Parameters
    ----------
    damping : float
        Lower bound [N m s/rad or N s/m].
    moved, lasted : array
        Displacement between two samples [rad or m], and time [s].
    """
    work: Floats = damping * moved**2 / lasted
    return work


def feigned_by_noise(
    damping: float, answer: float, variance: Floats | float, lasted: Floats
) -> Floats:
    """Return by how much noise lowers G between two samples [J], (gaps,); below 0: raises it.

    Parameters
    ----------
    damping : float
        Lower bound [N m s/rad or N s/m].
    answer : float
        By how much the effort that acts changes with its newest sample [N m/rad or N/m].
    variance : float or array
        Of the samples, less their covariance with the next [rad**2 or m**2].
    lasted : array
        Time between them [s].
    """
    feigned: Floats = (2.0 * damping / lasted - answer) * variance
    return feigned


def rise_of(
    time: Floats, given: Floats, damped: Floats, feigned: Floats, counted: Rows, flow: float
) -> Rise:
    """Return what a coupling generated.

    Parameters
    ----------
    time : array
        Of the rows in which every axis has a sample [s], (rows,).
    given : array
        What the coupling gave and holds from each row to the next, -absorbed + stored [J],
        (rows - 1,).
    damped, feigned : array
        What damping could have taken of it, and what noise feigns of G [J], (rows - 1,).
    counted : array of bool
        Gaps in which the coupling acted, (rows - 1,).
    flow : float
        All that passed to and fro [J].
    """
    steps = np.where(counted, given - damped + feigned, 0.0)
    feints = np.where(counted, feigned, 0.0)
    taken = float(np.sum(np.where(counted, damped, 0.0) - feints))
    total = np.concatenate([[0.0], np.cumsum(steps)])
    lowest = np.minimum.accumulate(total)
    end = int(np.argmax(total - lowest))
    begin = int(np.argmin(total[: end + 1]))
    doubt = max(NOISE_ACCURACY, 3.0 * math.sqrt(3.0 / max(1, len(feints))))
    floor = ACCURACY * max(taken, 0.0) + doubt * float(np.sum(np.abs(feints)))
    floor += ROUNDING * flow + NOTHING
    return _judged(time, total, counted, (begin, end), max(taken, 0.0), floor)


def surplus_of(time: Floats, given: Floats, damped: Floats, flow: float) -> Rise:
    """Return what was given since the start beyond what damping could have taken.

    For books in which what is stored is not known: what they give back was put in before, so that
    only a new greatest sum is a rise.

    Parameters
    ----------
    time : array
        [s], (rows,).
    given, damped : array
        What was given, and what damping could have taken of it or was allowed, since the first row
        [J], (rows,).
    flow : float
        All that passed to and fro [J].
    """
    most = np.maximum.accumulate(np.maximum(given - damped, 0.0))
    end = int(np.argmax(most))
    taken = float(damped[-1])
    floor = ACCURACY * taken + ROUNDING * flow + NOTHING
    return _judged(time, most, np.ones(len(time) - 1, bool), (0, end), taken, floor)


def _judged(
    time: Floats, total: Floats, counted: Rows, span: tuple[int, int], taken: float, floor: float
) -> Rise:
    share, seconds = _rising(time, total, counted, floor)
    begin, end = span
    risen = float(total[end] - total[begin])
    lasting = risen > floor and share > LASTING and share * seconds > FEW
    return Rise(risen, float(time[begin]), float(time[end]), taken, floor, share, lasting)


def _rising(time: Floats, total: Floats, counted: Rows, floor: float) -> tuple[float, int]:
    """Return the share of the seconds in which a sum rises by its part of the floor, and how many.

    Only those count in which the coupling acted.
    """
    second = np.floor(time - time[0]).astype(np.int64)
    edges = np.flatnonzero(np.diff(second)) + 1
    first = np.concatenate([[0], edges])
    last = np.concatenate([edges, [len(time) - 1]])
    whole = np.concatenate([[0], np.cumsum(counted)])
    acted = whole[last] > whole[first]
    seconds = int(np.count_nonzero(acted))
    if seconds == 0:
        return 0.0, 0
    rises = (total[last] - total[first] > floor / seconds) & acted
    return float(np.count_nonzero(rises)) / seconds, seconds
