"""What `tautwave bench` runs on the real clock is certified with the changes it makes."""

from __future__ import annotations

import pytest

from tautwave.bench.live import viewed
from tautwave.bench.rigs import ONE_PAIR
from tautwave.bench.sites import runs
from tautwave.certificate import certify
from tautwave.config import load_rig
from tautwave.config.shipped import find_example


@pytest.mark.parametrize(
    ("shipped", "changes"),
    [
        (ONE_PAIR.shipped, viewed.SETS),
        pytest.param(runs.EXAMPLE, runs.SETS, marks=pytest.mark.slow),
    ],
)
def test_its_rigs_may_run(shipped: str, changes: tuple[str, ...]) -> None:
    assert certify(load_rig(find_example(shipped).path, changes)).passed
