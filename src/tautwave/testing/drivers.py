"""Requirements of every driver, whatever its bus: `class TestX(DriverContract)` with a `bench`.

A bench provides a driver and the devices behind it on the fake clock. The loop relies on every
test.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest

from tautwave.clock import FakeClock
from tautwave.contracts import Driver
from tautwave.errors import DriverError
from tautwave.types import AxisCommand, CommandDelay, JointState

PERIOD_NS = 1_000_000
ENABLE_LIMIT = 5000  # cycles
UNSAID = "the bench does not say how"


class DriverBench(NamedTuple):
    """A driver before `open`, its axes' causality, and access to the devices' state.

    `commanded(axis)` is the last command the device received and follows [N m, N, rad/s or m/s];
    `position(axis)` is its true position. `names` are the axes' full names; `cut()` cuts the line,
    so that nothing the host sends arrives any more. Leave both out where no device outlives the
    host.

    What else may happen to a device, each the reason as text where it cannot: `forget(axis,
    span_ns)` takes its power for so long, and with it what was set in it; `stick(axis)` has it
    answer and stay on, whatever it is commanded; `spoil()` makes each answer that of another device
    or to another request; `twin()`, before `open`, puts a second device on the line that obeys the
    commands of the first axis.
    """

    driver: Driver
    clock: FakeClock
    causality: tuple[str, ...]
    commanded: Callable[[int], float]
    position: Callable[[int], float]
    names: tuple[str, ...] = ()
    cut: Callable[[], None] | None = None
    forget: Callable[[int, int], None] | str = UNSAID
    stick: Callable[[int], None] | str = UNSAID
    spoil: Callable[[], None] | str = UNSAID
    twin: Callable[[], None] | str = UNSAID
    period_ns: int = PERIOD_NS
    tolerance: float = 1e-3


def strike(clock: FakeClock, at_ns: int, blow: Callable[[], None]) -> None:
    """Call `blow` once at `at_ns` [ns], also within `open`: when the clock is next read."""
    pending = [blow]

    def now_ns() -> int:
        now = FakeClock.now_ns(clock)
        if pending and now >= at_ns:
            pending.pop()()
        return now

    clock.now_ns = now_ns  # type: ignore[method-assign]


def strokes(bring_up_ns: int, count: int, period_ns: int = PERIOD_NS) -> Iterator[int]:
    """Yield times from `open` on [ns]: over bring-up, the first 50 cycles after it, and 20 drawn.

    `count` of each third; 0: every cycle of the first two.
    """
    cycles = bring_up_ns // period_ns
    step = max(1, cycles // count) if count else 1
    yield from range(0, bring_up_ns, step * period_ns)
    run = 50 // count if count else 1
    yield from range(bring_up_ns, bring_up_ns + 50 * period_ns, run * period_ns)
    draw = random.Random(bring_up_ns)
    for _ in range(count or 20):
        yield bring_up_ns + draw.randrange(50 * period_ns, 300 * period_ns)


def cycle(bench: DriverBench, commands: list[AxisCommand] | None = None) -> list[JointState]:
    """One cycle as the loop runs it."""
    deadline = bench.clock.now_ns() + bench.period_ns
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
        bench.clock.sleep_until(bench.clock.now_ns() + bench.period_ns)
    raise AssertionError("never enabled")


def push(bench: DriverBench, value: float) -> list[AxisCommand]:
    """Return a command of `value` in the causality of each axis."""
    return [
        AxisCommand(value, 0.0) if kind == "impedance" else AxisCommand(0.0, value)
        for kind in bench.causality
    ]


class DriverContract:
    """The suite; pytest collects the subclasses.

    `forgets_at`: at how many cycles of bring-up, of the first 50 of a run, and of later ones, power
    goes in the longest test; 0: at every one of bring-up and of those 50.
    """

    forgets_at = 0

    @pytest.fixture
    def bench(self) -> DriverBench:
        raise NotImplementedError

    def test_it_is_a_driver(self, bench: DriverBench) -> None:
        assert isinstance(bench.driver, Driver)
        delay = bench.driver.command_delay
        assert isinstance(delay, CommandDelay)
        assert delay.periods >= 0
        assert 0.0 <= delay.remainder_s < bench.period_ns * 1e-9

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
                    assert state.position == pytest.approx(true, abs=bench.tolerance)
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
            until = bench.clock.now_ns() + round(1e9 * watched[name]) + 2 * bench.period_ns
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

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("span_ms", "count"),
        [
            (50, 2),
            pytest.param(50, 0, marks=pytest.mark.nightly),
            pytest.param(500, 4, marks=pytest.mark.nightly),
            pytest.param(5000, 2, marks=pytest.mark.nightly),
        ],
    )
    def test_a_device_that_forgets_in_the_middle_is_told_or_obeys(
        self, bench: DriverBench, span_ms: int, count: int
    ) -> None:
        """Whenever its power goes and comes back, no device is taken for enabled that is not."""
        if isinstance(bench.forget, str):
            pytest.skip(f"no device here can forget: {bench.forget}")
        enable(bench)
        bench.driver.close()
        began = bench.clock.now_ns()
        enable(bench)
        bring_up_ns = bench.clock.now_ns() - began
        bench.driver.close()
        axis = len(bench.causality) - 1
        for after_ns in strokes(bring_up_ns, count or self.forgets_at, bench.period_ns):
            told = self._forgetting(bench, axis, after_ns, span_ms * 1_000_000)
            assert told or after_ns <= bring_up_ns, f"after {after_ns * 1e-6:g} ms"

    def _forgetting(self, bench: DriverBench, axis: int, after_ns: int, span_ns: int) -> bool:
        """Cut a device's power; return whether that was reported. At the end it obeys or is off."""
        clock, forget = bench.clock, bench.forget
        assert not isinstance(forget, str)
        at_ns = clock.now_ns() + after_ns
        strike(clock, at_ns, lambda: forget(axis, span_ns))
        told = False
        try:
            enable(bench)
            until_ns = max(
                at_ns + span_ns + 300 * bench.period_ns, clock.now_ns() + 50 * bench.period_ns
            )
            while not told and clock.now_ns() < until_ns:
                sign = 1.0 if clock.now_ns() // (20 * bench.period_ns) % 2 else -1.0
                cycle(bench, push(bench, 0.3 * sign))
                told = any(fault.fatal for fault in bench.driver.faults())
            if not told:
                states = cycle(bench, push(bench, 0.3))
                assert states[axis].valid
                assert bench.commanded(axis) != 0.0, "it was taken for enabled and is not"
        except DriverError:
            told = True
        finally:
            bench.driver.close()
        clock.sleep_until(max(clock.now_ns(), at_ns + span_ns) + 1_000_000_000)
        for which in range(len(bench.causality)):
            assert bench.commanded(which) == 0.0
        return told

    def test_a_device_that_does_not_switch_off_is_named_and_its_watchdog_stays_armed(
        self, bench: DriverBench
    ) -> None:
        if isinstance(bench.stick, str):
            pytest.skip(f"no device here can stay on: {bench.stick}")
        enable(bench)
        for _ in range(5):
            cycle(bench, push(bench, 0.5))
        bench.stick(0)
        name = bench.names[0]
        watchdog_s = bench.driver.watchdog_s.get(name)
        bench.driver.close()
        # A driver that waited for its watchdog has seen it off.
        off = not bench.driver.unconfirmed and bench.commanded(0) == 0.0
        assert off or set(bench.driver.unconfirmed) == {name}
        if watchdog_s is not None:
            bench.clock.sleep_until(
                bench.clock.now_ns() + round(1e9 * watchdog_s) + 2 * bench.period_ns
            )
            assert bench.commanded(0) == 0.0

    def test_somebody_elses_words_are_no_samples_and_are_told_from_silence(
        self, bench: DriverBench
    ) -> None:
        if isinstance(bench.spoil, str):
            pytest.skip(f"no answer here can be another's: {bench.spoil}")
        enable(bench)
        for _ in range(5):
            cycle(bench, push(bench, 0.1))
        bench.spoil()
        cycle(bench, push(bench, 0.1))
        told = set()
        for _ in range(10):
            states = cycle(bench, push(bench, 0.1))
            assert not any(state.valid for state in states)
            told |= {fault.axis for fault in bench.driver.faults() if fault.fatal}
        misses = dict(getattr(bench.driver, "misses", {}))
        assert told | set(misses) == set(bench.names)
        assert all(misses.values())
        bench.driver.close()
        for axis, name in enumerate(bench.names):
            assert bench.commanded(axis) == 0.0 or name in bench.driver.unconfirmed

    def test_a_command_that_reaches_two_devices_is_refused(self, bench: DriverBench) -> None:
        if isinstance(bench.twin, str):
            pytest.skip(f"no command here can reach two devices: {bench.twin}")
        bench.twin()
        with pytest.raises(DriverError):
            enable(bench)
        bench.driver.close()
        for axis in range(len(bench.causality)):
            assert bench.commanded(axis) == 0.0
