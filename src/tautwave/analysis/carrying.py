"""How fast a serial chain's weight changes at most, in any posture, weighed by damping.

Whoever carries a weight late errs by its slope: by entries of the Hessian H(q) of the potential.
With any weights w > 0, and 2 a b <= (w_j / w_i) a^2 + (w_i / w_j) b^2 term by term,

    |a' H b| <= sum over i of h_i (a_i^2 + b_i^2) / 2,    h_i >= sum over j of |H_ij(q)| w_j / w_i

for all q. So what a weight takes may be put on those joints that have damping for it. The weights
here make the greatest h_i per damping as small as they can.

The first joints' part of H is a polynomial of degree one in cos q_k and sin q_k for each of them.
On M places evenly around the circle such a one reaches at least cos(pi / M) of its greatest size,
so with p joints the greatest of M^p postures over cos(pi / M)^p is a bound of all postures, for
every choice of signs in the sum, too. The bodies beyond are counted with their links stretched.

Source: derived here; the bound on a grid is Ehlich and Zeller's (Math. Z. 86, 1964) for degree one.
"""

from __future__ import annotations

import functools
import math

import numpy as np
import numpy.typing as npt

from tautwave.models.chain.params import ChainParams

Floats = npt.NDArray[np.float64]

FIRST = 4
"""Joints whose postures are looked at one by one, at most."""
PLACES = 12
"""Of each of these, around the circle."""
STEPS = 60
"""By which the weights are found; any weights are right."""


@functools.lru_cache(maxsize=16)
def weighed_slopes(chain: ChainParams, damping: tuple[float, ...]) -> tuple[float, ...]:
    """Return a bound h of how fast each joint's weight changes [N m/rad], in any posture.

    Parameters
    ----------
    chain : ChainParams
        Whose joints all turn.
    damping : tuple of float
        What each joint has to pay with [N m s/rad], above zero; it decides where h is put.

    Returns
    -------
    tuple of float
        h, such that the weight of a posture that is off by a, on a way b, errs by no more work than
        the sum of h_i (a_i^2 + b_i^2) / 2.
    """
    count = len(chain.joints)
    first = min(FIRST, count)
    main = np.zeros((PLACES**first, count, count))
    main[:, :first, :first] = np.abs(_hessians(chain, first)) / math.cos(math.pi / PLACES) ** first
    for at in range(first, count):
        main[:, : at + 1, : at + 1] += _pull(chain) * _moment(chain, at)
    weights, best = np.ones(count), np.full(count, math.inf)
    has = np.array(damping)
    for _ in range(STEPS):
        slopes = (main @ weights).max(axis=0) / weights
        share = slopes / has
        if share.max() < (best / has).max():
            best = slopes
        weights = weights * (share / share.max()) ** 0.3
    return tuple(best.tolist())


def _pull(chain: ChainParams) -> float:
    return math.sqrt(chain.gx**2 + chain.gy**2 + chain.gz**2)


def _moment(chain: ChainParams, at: int) -> float:
    """Return the size of a joint's first moment [kg m], with all beyond at the next joint."""
    return math.sqrt(sum(value * value for value in chain.carried[at][1:4]))


def _hessians(chain: ChainParams, first: int) -> Floats:
    """Return the Hessian of the first joints' bodies on a grid; shape (PLACES**first, p, p)."""
    turn = 2.0 * math.pi / PLACES * np.arange(PLACES)
    grid = np.stack(np.meshgrid(*[turn] * first, indexing="ij"), axis=-1).reshape(-1, first)
    frames = np.empty((len(grid), first, 3, 3))
    here = np.array([[chain.cb, -chain.sb, 0.0], [chain.sb, chain.cb, 0.0], [0.0, 0.0, 1.0]])
    for i, joint in enumerate(chain.joints[:first]):
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, joint.ca, -joint.sa], [0.0, joint.sa, joint.ca]])
        spin = np.zeros((len(grid), 3, 3))
        spin[:, 0, 0] = spin[:, 1, 1] = np.cos(grid[:, i])
        spin[:, 1, 0] = np.sin(grid[:, i])
        spin[:, 0, 1] = -spin[:, 1, 0]
        spin[:, 2, 2] = 1.0
        here = here @ tilt @ spin
        frames[:, i] = here
    axes = frames[..., 2]
    gravity = np.array([chain.gx, chain.gy, chain.gz])
    out = np.zeros((len(grid), first, first))
    beyond = np.zeros((len(grid), 3))
    for i in reversed(range(first)):
        beyond = beyond + frames[:, i] @ np.array(chain.carried[i][1:4])
        way = np.cross(axes[:, i], beyond)
        for j in range(i + 1):
            out[:, i, j] = out[:, j, i] = -np.cross(axes[:, j], way) @ gravity
    return out
