"""Wave conversion between a line served every period T and a port served every n-th.

A wave u carries T u**2 / 2 per period, and its integral T u determines position. The slow side gets
means of n waves; to the fast side each wave is held for n periods. With H the hold of one wave over
n periods, |H s|**2 T / 2 = n T s**2 / 2: all energy, nothing to scale. The mean is H^T / n, so H
mean is the orthogonal projection on what is constant over a block, and

    T/2 sum u_i**2  =  n T/2 mean**2  +  T/2 sum (u_i - mean)**2:

the loss is a sum of squares, and no energy is created. Both keep the integral exactly, so no
position drifts; the mean is the only linear conversion of single blocks that does, since n T s = T
sum u_i for all u leaves no choice. Picking every n-th wave keeps neither.

A repeated sample often gets a factor 1/sqrt(n). That is for samples of weight T each; a slow wave
already has weight n T, and with the factor the integral would be lost.

Sources: Cauchy & Schwarz; Welford, Technometrics 4(3), 1962 (the running sum of squares).
"""

from __future__ import annotations


def gather_wave(count: int, mean: float, wave: float) -> tuple[float, float]:
    """Add a wave to a block.

    Parameters
    ----------
    count : int
        Waves in the block so far.
    mean : float
        Their mean [W**0.5].
    wave : float
        The next one [W**0.5].

    Returns
    -------
    tuple of float
        Mean of all, and by how much the sum of squares about the mean grew [W]; never negative.
    """
    step = wave - mean
    share = 1.0 / (count + 1.0)
    return mean + share * step, count * share * step * step


def hand_over(size: int, count: int, mean: float) -> tuple[float, float]:
    """Return the slow wave of a block of `size`, and the lost sum of squares.

    A block that began late has only `count` waves; the others count as 0.

    Returns
    -------
    tuple of float
        Slow wave [W**0.5], and what is lost [W]; 0 where the block is full.
    """
    if count == size:
        return mean, 0.0
    share = count / size
    return share * mean, count * (1.0 - share) * mean * mean
