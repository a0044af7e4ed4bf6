"""An axis that nobody sees: what it keeps for some periods, and how it lets go after them."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.controller.axis import decide_axis
from tautwave.controller.records import BROKEN, FINISHED, MISSING, RunState
from tautwave.controller.run import check_sample
from tautwave.types import Fault
from tests.runtime.parts import WIDE, Axis, Bench, site, state, swing

SPRING = (100.0, 0.0)
STEP = 0.5
"""[N] What the rate limit allows per period."""


def blind(slots: list[int], *, stopping: bool = True, at_once: bool = False, **keys: Any) -> Axis:
    """Return an axis that pushed with 2 N, or moved with 2 m/s, after so many slots each."""
    limit = WIDE._replace(effort_step=math.inf if at_once else STEP)
    axis = site(limit=limit, **keys)
    axis.params = axis.params._replace(blind=5)
    axis.state.command = 2.0
    axis.state.total = 2.0 if keys.get("admittance") else -2.0
    axis.state.stopping = stopping
    for count in slots:
        for _ in range(count):
            axis.pass_slot()
        axis.miss()
        decide_axis(axis.state, axis.params, axis.table, False, 1.0, axis.law.steps)
    return axis


@pytest.mark.parametrize("law", [{}, {"spring": SPRING}], ids=["wave", "position"])
def test_an_effort_goes_by_the_rate_limit_and_counts_skipped_slots(law: dict[str, Any]) -> None:
    for slots, left in [([1], 1.5), ([1, 1], 1.0), ([2, 1], 0.5), ([4], 0.0), ([1] * 9, 0.0)]:
        assert blind(slots, **law).command == pytest.approx(left)
    assert blind([1], at_once=True, **law).command == 0.0


def test_a_velocity_goes_at_once() -> None:
    assert blind([1], admittance=True).command == 0.0


@pytest.mark.parametrize(
    "keys", [{}, {"spring": SPRING}, {"admittance": True}], ids=["wave", "position", "velocity"]
)
def test_a_command_is_kept_for_fewer_than_the_limit(keys: dict[str, Any]) -> None:
    for slots in ([1], [1] * 4, [3, 1]):
        kept = blind(slots, stopping=False, **keys)
        assert (kept.command, kept.stopping) == (2.0, False)
    gone = blind([3, 2], stopping=False, at_once=True, **keys)  # slots that were skipped count
    assert (gone.command, gone.stopping) == (0.0, True)


def heard(fed: bool, efforts: list[float]) -> tuple[RunState, list[bool]]:
    """Return how a run stands after samples with these efforts, and which were usable."""
    bench = Bench()
    r, o, axis = bench.pair.control.run, bench.pair.control.state, bench.master
    params = axis.params._replace(fed=fed, senses=True)
    usable = []
    for slot, effort in enumerate(efforts):
        m = state(0.25, effort)
        check_sample(r, o, params, [axis.state, bench.slave.state], m, slot, 0)
        usable.append(m.valid)
    return o, usable


def test_a_law_fed_by_an_effort_takes_a_sample_without_it_for_none() -> None:
    """Four in a row stop the run, as silence does, and the sentence has the effort."""
    nan = math.nan
    o, usable = heard(True, [0.1, nan, nan, nan, 0.2, nan, nan, nan])
    assert usable == [True, False, False, False, True, False, False, False]
    assert o.kind == FINISHED
    o, _ = heard(True, [0.1, *[nan] * 4])
    assert (o.kind, o.slot, o.first) == (BROKEN, 4, 0.25)
    assert math.isnan(o.second)
    o, usable = heard(False, [0.1, *[nan] * 9])
    assert all(usable)
    assert o.kind == FINISHED


def test_an_axis_that_is_silent_and_then_has_no_effort_stops_as_soon() -> None:
    bench = Bench()
    r, o, axis = bench.pair.control.run, bench.pair.control.state, bench.master
    params = axis.params._replace(fed=True)
    script = [(math.nan, True), (0.1, False), (math.nan, True), (0.1, False)]
    for slot, (effort, valid) in enumerate(script):
        m = state(0.25, effort, valid)
        check_sample(r, o, params, [axis.state, bench.slave.state], m, slot, 0)
    assert (o.kind, o.slot) == (MISSING, 3)


def test_a_device_in_fault_gets_nothing_and_the_other_one_is_damped() -> None:
    limit = WIDE._replace(effort=10.0, effort_step=0.01, stop_damping=1.0)
    fault = Fault("slave.a", "over temperature", fatal=True)
    bench = Bench(
        cycles=30,
        release=10,
        master=site(limit=limit, spring=SPRING),
        slave=site(limit=limit, spring=SPRING),
        hand={"positions": swing},
        arm={"positions": lambda axis, cycle: -swing(axis, cycle), "faults": {15: fault}},
    )
    bench.loop.run()
    assert any(bench.efforts(bench.arm)[:15])
    assert not any(bench.efforts(bench.arm)[15:])
    assert not any(bench.column("slave.a.commanded")[15:])
    assert any(bench.efforts(bench.hand)[15:])
