"""How a law answers a sample: asked of its own steps, on an axis without limits."""

from __future__ import annotations

import math
from typing import Any

from tautwave.controller.records import AxisParams, AxisState, PairParams, PairState, PairView
from tautwave.controller.steps import Law
from tautwave.laws.limit import NO_LIMITS
from tautwave.laws.site import SiteParams
from tautwave.laws.velocity import track_velocity
from tautwave.laws.wall import NO_WALL

INF = math.inf


def sample_gain(
    law: Law, end: Any, link: Any, period: float, gain: float, mass: float, *, still: bool = False
) -> float:
    """Return by how much a law's effort changes with its newest sample [N m/rad or N/m].

    Parameters
    ----------
    law : Law
        The bare law; a pair of it is asked twice, once with the master's sample off.
    end, link : NamedTuple
        Constants of its ends, and between them.
    period, gain, mass : float
        Period [s], gain of the velocity tracker, lower bound of the inertia [kg m**2 or kg].
    still : bool
        Take the sample for a place, and no motion: what is found is stiffness alone.
    """
    off = 1e-6
    site = SiteParams(period, 0.5 * period / mass, NO_WALL, NO_LIMITS, gain, 0.0, has_wall=False)
    half = 0.5 * period
    p = AxisParams(site, half, 0.0, INF, 1.0, 0, 0, True, 1, half, end)
    q = PairParams(0, 1, False, True, 1.0, 1.0, 1.0, 1.0, 1.0, period, half, 0.0, INF, 0, 0, link)
    efforts = []
    for sample in (0.0, off):
        one, two = AxisState(end=law.end()), AxisState(end=law.end())
        pair = PairView(PairState(link=law.link()), q, one, two, p, p, [])
        law.steps.start(pair, 0.0)
        law.steps.engage(pair)
        one.position = sample
        one.velocity = 0.0 if still else track_velocity(gain, 0.0, sample, period)
        one.count = two.count = 1
        law.steps.close(one, p, sample, 1.0, period, 0.0)
        law.steps.close(two, p, 0.0, 1.0, period, 0.0)
        law.steps.exchange(pair, True, True, True)
        efforts.append(law.steps.compute_effort(one, p, one.velocity))
    return (efforts[1] - efforts[0]) / off
