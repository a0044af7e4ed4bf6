"""Requirements of every driver, whatever its bus: `class TestX(DriverContract)` with a `bench`.

A bench provides a driver and the devices behind it on the fake clock. The loop relies on every
test.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import Driver
from tautwave.types import AxisCommand, CommandDelay, JointState

PERIOD_NS = 1_000_000
ENABLE_LIMIT = 5000  # cycles


class DriverBench(NamedTuple):
    """A driver before `open`, its axes' causality, and access to the devices' state.

    `commanded(axis)` is the last command the device received and follows [N m, N, rad/s or m/s];
    `position(axis)` is its true position. `names` are the axes' full names; `cut()` cuts the line,
    so that nothing the host sends arrives any more. Leave both out where no device outlives the
    host.
    """

    driver: Driver
    clock: FakeClock
    causality: tuple[str, ...]
    commanded: Callable[[int], float]
    position: Callable[[int], float]
    names: tuple[str, ...] = ()
    cut: Callable[[], None] | None = None


def cycle(bench: DriverBench, commands: list[AxisCommand] | None = None) -> list[JointState]:
    """One cycle as the loop runs it."""
    deadline = bench.clock.now_ns() + PERIOD_NS
    bench.driver.request()
    states = list(bench.driver.read(deadline))
    assert bench.clock.now_ns() <= deadline
    if commands is not None:
        bench.driver.write(commands)
    bench.clock.sleep_until(deadline)
    return states


def enable(bench: DriverBench) -> None:
    bench.driver.open()
    for _ in range(ENABLE_LIMIT):
        if bench.driver.enable_step():
            return
        bench.clock.sleep_until(bench.clock.now_ns() + PERIOD_NS)
    raise AssertionError("never enabled")


def push(bench: DriverBench, value: float) -> list[AxisCommand]:
    """Return a command of `value` in the causality of each axis."""
    return [
        AxisCommand(value, 0.0) if kind == "impedance" else AxisCommand(0.0, value)
        for kind in bench.causality
    ]


class DriverContract:
    """The suite; pytest collects the subclasses."""

    @pytest.fixture
    def bench(self) -> DriverBench:
        raise NotImplementedError

    def test_it_is_a_driver(self, bench: DriverBench) -> None:
        assert isinstance(bench.driver, Driver)
        delay = bench.driver.command_delay
        assert isinstance(delay, CommandDelay)
        assert delay.periods >= 0
        assert 0.0 <= delay.remainder_s < PERIOD_NS * 1e-9

    def test_close_works_without_open_and_twice(self, bench: DriverBench) -> None:
        bench.driver.close()
        bench.driver.close()

    def test_disable_works_without_open_and_twice(self, bench: DriverBench) -> None:
        bench.driver.disable()
        bench.driver.disable()
        bench.driver.close()

    def test_a_command_before_enabling_is_ignored(self, bench: DriverBench) -> None:
        bench.driver.write(push(bench, 0.5))
        bench.driver.open()
        bench.driver.write(push(bench, 0.5))
        for _ in range(5):
            cycle(bench, push(bench, 0.5))
        for axis in range(len(bench.causality)):
            assert bench.commanded(axis) == 0.0
        bench.driver.close()

    def test_read_returns_one_state_per_axis_by_the_deadline(self, bench: DriverBench) -> None:
        enable(bench)
        for _ in range(20):
            states = cycle(bench, push(bench, 0.0))
            assert len(states) == len(bench.causality)
            for state in states:
                assert isinstance(state, JointState)
                assert state.age_ns >= 0
                if state.valid:
                    assert state.position - state.position == 0.0
        bench.driver.close()

    def test_what_is_measured_is_where_the_device_is(self, bench: DriverBench) -> None:
        enable(bench)
        states = []
        for _ in range(50):
            states = cycle(bench, push(bench, 0.5))
            where = [bench.position(axis) for axis in range(len(states))]
            for state, true in zip(states, where, strict=True):
                if state.valid:
                    assert state.position == pytest.approx(true, abs=1e-3)
        assert all(state.position > 0.0 for state in states)
        bench.driver.close()

    def test_the_last_command_acts_until_the_next(self, bench: DriverBench) -> None:
        enable(bench)
        cycle(bench, push(bench, 0.5))
        for _ in range(5):
            cycle(bench)  # nothing written
        assert all(bench.commanded(axis) != 0.0 for axis in range(len(bench.causality)))
        bench.driver.close()

    @pytest.mark.parametrize("way", ["disable", "close"])
    def test_leaving_sends_the_safe_command(self, bench: DriverBench, way: str) -> None:
        enable(bench)
        for _ in range(10):
            cycle(bench, push(bench, 0.5))
        getattr(bench.driver, way)()
        for axis in range(len(bench.causality)):
            assert bench.commanded(axis) == 0.0
        bench.driver.write(push(bench, 0.5))
        for axis in range(len(bench.causality)):
            assert bench.commanded(axis) == 0.0
        bench.driver.close()
        bench.driver.close()

    def test_it_can_be_opened_again(self, bench: DriverBench) -> None:
        for _ in range(2):
            enable(bench)
            cycle(bench, push(bench, 0.5))
            bench.driver.close()

    def test_faults_are_a_sequence_of_sentences(self, bench: DriverBench) -> None:
        enable(bench)
        cycle(bench, push(bench, 0.0))
        for fault in bench.driver.faults():
            assert fault.text
        bench.driver.close()

    def test_it_says_what_each_device_does_when_the_host_stops(self, bench: DriverBench) -> None:
        enable(bench)
        watched, unwatched = bench.driver.watchdog_s, bench.driver.unwatched
        assert all(0.0 < seconds < math.inf for seconds in watched.values())
        assert all(unwatched.values())
        assert {*watched, *unwatched} == set(bench.names)
        assert len(watched) + len(unwatched) == len(bench.names)
        bench.driver.close()

    def test_a_device_off_the_line_stops_when_it_said(self, bench: DriverBench) -> None:
        if bench.cut is None:
            pytest.skip("no device outlives the host")
        enable(bench)
        for _ in range(10):
            cycle(bench, push(bench, 0.5))
        bench.cut()
        watched = dict(bench.driver.watchdog_s)
        for name in sorted(watched, key=watched.__getitem__):
            until = bench.clock.now_ns() + round(1e9 * watched[name]) + 2 * PERIOD_NS
            bench.clock.sleep_until(until)
            assert bench.commanded(bench.names.index(name)) == 0.0
        for name in bench.driver.unwatched:
            assert bench.commanded(bench.names.index(name)) != 0.0
        bench.driver.close()

    def test_switching_off_is_confirmed(self, bench: DriverBench) -> None:
        assert not bench.driver.unconfirmed
        enable(bench)
        cycle(bench, push(bench, 0.5))
        bench.driver.disable()
        assert not bench.driver.unconfirmed
        bench.driver.close()
        assert not bench.driver.unconfirmed

    @pytest.mark.parametrize("way", ["disable", "close"])
    def test_a_device_that_cannot_be_switched_off_is_named(
        self, bench: DriverBench, way: str
    ) -> None:
        if bench.cut is None:
            pytest.skip("no device outlives the host")
        enable(bench)
        cycle(bench, push(bench, 0.5))
        bench.cut()
        getattr(bench.driver, way)()
        assert set(bench.driver.unconfirmed) == set(bench.names)
        assert all(bench.driver.unconfirmed.values())
        bench.driver.close()
        assert set(bench.driver.unconfirmed) == set(bench.names)
