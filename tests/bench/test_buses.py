"""`bench buses` measures on one processor, and leaves the process where it was."""

from __future__ import annotations

import os

import pytest

from tautwave.bench.buses import one_processor


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no affinity")
def test_what_is_measured_shares_a_processor_and_lets_go_of_it() -> None:
    before = os.sched_getaffinity(0)
    with one_processor():
        assert len(os.sched_getaffinity(0)) == 1
        assert os.sched_getaffinity(0) <= before
    assert os.sched_getaffinity(0) == before


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system has no affinity")
def test_a_measurement_that_fails_lets_go_of_it_as_well() -> None:
    before = os.sched_getaffinity(0)
    with pytest.raises(ValueError, match="in the middle"), one_processor():
        raise ValueError("in the middle")
    assert os.sched_getaffinity(0) == before
