"""Two sites in one process, for tests that meet them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from tests.session.sites import Make, Pair


@pytest.fixture
def pair() -> Iterator[Make]:
    """Return what makes a pair of sites with changes of the rig; all are closed at the end."""
    with ExitStack() as stack:

        def make(*changes: str) -> Pair:
            made = Pair(*changes)
            stack.callback(made.close)
            return made

        yield make
