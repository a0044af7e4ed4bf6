"""A pair at two rates with a state for every wave under way: large, and plainly right."""

from __future__ import annotations

import numpy as np

from tautwave.analysis.ports.multirate import RatedEnd, _driven, _lines
from tautwave.analysis.ports.sampled_loop import Matrix


def period_matrix(master: RatedEnd, slave: RatedEnd, samples: int) -> Matrix:
    """Return the state matrix over `common_slots` slots of two ends `samples` slots apart.

    States: master's, slave's, for each the wave held and the sum of the block (both 0 at the
    line's own rate), then the waves under way to the slave and to the master, oldest
    first. Shape (n, n).
    """
    return _driven(master, slave, samples, np.eye(_lines(master, slave) + 2 * samples))
