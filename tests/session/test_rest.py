"""A slave of two sites on its way: what it gets without a sample, at an end, beyond its limits."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from tautwave.controller.records import GUARD
from tests.session.sites import Pair

KEYS = (
    "simulation.hand.lever.reference={type: minimum_jerk, waypoints: [[0, 0]]}",
    "simulation.environment.lever={type: free}",
    "coupling.pairs.lever.offset=0.3",
    "coupling.pairs.lever.engage_tolerance=0.01",
    "simulation.faults.missing_probability=0.2",
    "loop.missing_limit=9",
)


@pytest.fixture
def two() -> Iterator[Pair]:
    pair = Pair(*KEYS)
    pair.run(200)
    assert pair.slave["link.aligning"][-1] == 1.0
    yield pair
    pair.close()


def test_without_a_sample_it_gets_nothing_and_at_an_end_it_is_held(two: Pair) -> None:
    pulled = np.arange(200)[two.slave["link.aligning"] == 1.0][5:]
    sent, valid = two.slave["slave.lever.commanded"], two.slave["slave.lever.valid"] > 0.0
    assert not sent[pulled][~valid[pulled]].any()
    assert np.count_nonzero(sent[pulled]) > 50
    two.slave.control.stop_after(200)
    two.run(60)
    speed = two.slave["slave.lever.velocity"][202:]
    assert np.abs(speed).max() > 0.05
    assert (two.slave["slave.lever.commanded"][202:] * speed).max() <= 0.0


def test_beyond_its_range_it_stops(two: Pair) -> None:
    control = two.slave.control
    (own,) = control._own
    control.samples[own].position, control.samples[own].valid = 9.0, True
    control._meeting.rest.sense(200, 0)
    assert control.state.kind == GUARD


def test_a_way_that_takes_too_long_is_begun_again_with_a_budget_of_its_own(two: Pair) -> None:
    control: Any = two.slave.control
    rest, s = control._meeting.rest, control.axes[control._own[0]]
    pull, granted, slot = rest._pulls[0], rest.granted[0], rest._limit
    assert not rest.arrived(slot)
    assert rest._pulls[0] is pull
    s.port_energy = -0.2
    assert not rest.arrived(slot + 1)
    assert "slave lever not aligned: " in rest.hindrance
    assert rest._pulls[0] is not pull
    assert rest._pulls[0].target == pull.target
    assert rest._pulls[0].budget == pytest.approx(0.2 + rest.granted[0] - granted)
    assert rest._limit > slot + 1


def test_it_has_arrived_once_what_it_was_sent_has_acted(two: Pair) -> None:
    control: Any = two.slave.control
    rest, s = control._meeting.rest, control.axes[control._own[0]]
    pull = rest._pulls[0]
    pull.reference = s.position = pull.target
    s.total = 0.01
    assert not rest.arrived(300)  # lets go
    assert not rest.arrived(400)
    s.total = 0.0
    assert [rest.arrived(300 + k) for k in range(4)] == [False, False, True, True]
