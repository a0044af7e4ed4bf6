"""Mass-interaction networks offline: the live steps, compiled by numba."""

from __future__ import annotations

import functools
from collections.abc import Callable

from tautwave.scene import batch
from tautwave.simulation.kernel import compiled


@functools.cache
def compiled_batch() -> Callable[..., int]:
    """Return `batch.advance_many` for numba; compiled at the first call, or read from the cache."""
    return compiled.cached(batch.advance_many)
