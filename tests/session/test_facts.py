"""What `check` says of an axis, against runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tautwave.config import count_velocity
from tautwave.rig import command_delays
from tautwave.session.facts import (
    axis_rows,
    count_words,
    coupling_messages,
    pair_rows,
    pair_sentence,
)
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


@pytest.mark.parametrize(
    ("kind", "arm", "offset", "row", "effort", "speed"),
    [
        ("rotary", "0.075", "rad per N m", "rad/(N m)", "N m", "rad/s"),
        ("linear", "", "m per N", "m/N", "N", "m/s"),
    ],
)
def test_a_pair_and_its_axes_are_given_in_units_of_their_kind(
    kind: str, arm: str, offset: str, row: str, effort: str, speed: str
) -> None:
    """(tau + T) / b = 21 ms / 0.02, and what the filters add: (1 - g) / g T of 100 Hz."""
    found = rig(
        *(f"{side}.axes.lever.kind={kind}" for side in ("master", "slave")),
        f"simulation.hand.lever.lever_arm={arm}",
        "slave.axes.lever.velocity_limit=12",
    )
    delays = command_delays(found)
    held = math.exp(-2.0 * math.pi * 100.0 * 1e-3)
    stands = (0.021 + 1e-3 * held / (1.0 - held)) / 0.02
    assert pair_sentence(found, "lever", delays) == (
        f"one-way delay 0.021 s in all; standing offset {stands:.4g} {offset}; held still, a port "
        "gives all of the line's effort"
    )
    assert pair_rows(found, delays) == [("lever", "21 ms", f"{stands:.4g} {row}", "100.0%")]
    each = "effort", f"1.1 {effort}", f"0.0209 {speed}"
    assert axis_rows(found) == [
        ("master.lever", "hand 1", *each, f"15 {speed}"),
        ("slave.lever", "arm 1", *each, f"12 {speed}"),
    ]


def test_a_position_coupling_is_told_with_its_gains_where_they_are_known() -> None:
    found = rig("coupling.delay_s=0.02", name="bench-position-coupling")
    said = coupling_messages(found)
    bare = "positions, 0.02 s each way (passive by its tuning, if at all)"
    assert found.coupling.account is None
    assert said.coupling(found) == bare
    kept = rig("coupling.delay_s=0.02", "coupling.account={}", name="bench-position-coupling")
    assert coupling_messages(kept).coupling(kept) == (
        "positions, 0.02 s each way, in an energy account"
    )
    gains = {"stiffness": 25.5, "damping": 0.1}
    assert said.pair(gains, "N m", "rad", "{:g}".format) == (
        "position coupling, K = 25.5 N m/rad, B = 0.1 N m s/rad"
    )
    assert said.pair({}, "N m", "rad", "{:g}".format) == ""


def test_a_slow_bus_divides_by_its_own_period_and_an_exact_encoder_says_nothing() -> None:
    slow = rig(COARSE, "buses.hand.divisor=10")
    assert count_velocity(slow, "master.lever", 0.01) == pytest.approx(1.0)
    exact = rig("master.axes.lever.encoder_quantum=0")
    assert count_words(exact, "master.lever") == ""
