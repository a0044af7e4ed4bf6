"""What `check` says of an axis, against runs."""

from __future__ import annotations

import numpy as np
import pytest

from tautwave.config import count_velocity
from tautwave.session.facts import count_words
from tests.certificate.rigs import rig
from tests.rigs.running import run_rig

COARSE = "master.axes.lever.encoder_quantum=0.01"


@pytest.mark.parametrize("filter_s", [0.0, 0.002])
def test_the_first_count_reads_as_check_says(filter_s: float) -> None:
    coarse = rig(COARSE, f"master.axes.lever.velocity_filter_s={filter_s}", "duration_s=1")
    run = run_rig(coarse)
    first = int(np.argmax(run["master.lever.position"] != 0.0))
    reads = count_velocity(coarse, "master.lever", 0.01)
    assert run["master.lever.velocity"][first] == pytest.approx(reads, rel=1e-9)
    assert count_words(coarse, "master.lever") == (
        f"; one encoder count reads as {reads:.3g} rad/s (limit 15)"
    )


def test_a_slow_bus_divides_by_its_own_period_and_an_exact_encoder_says_nothing() -> None:
    slow = rig(COARSE, "buses.hand.divisor=10")
    assert count_velocity(slow, "master.lever", 0.01) == pytest.approx(1.0)
    exact = rig("master.axes.lever.encoder_quantum=0")
    assert count_words(exact, "master.lever") == ""
