"""The loop: order of calls, deadlines, ramps, and every way out ending in the safe command."""

from __future__ import annotations

import itertools

import pytest

from tautwave.contracts import READ_SHARE
from tautwave.errors import BusTimeout, SafetyStop, SettingsDifferError
from tests.runtime.leaving import ENDING, assert_left_safely
from tests.runtime.parts import PERIOD_NS, WIDE, Bench, site, swing

# -- the ordinary run ---------------------------------------------------------------------------


def test_every_cycle_asks_all_buses_before_it_reads_any_and_writes_last() -> None:
    bench = Bench(cycles=3)
    assert bench.loop.run().error is None
    cycle = [
        ("hand", "request"), ("arm", "request"),
        ("hand", "read"), ("hand", "faults"), ("arm", "read"), ("arm", "faults"),
        ("hand", "write"), ("arm", "write"),
    ]  # fmt: skip
    begin = [(bus, method) for method in ("open", "enable_step") for bus in ("hand", "arm")]
    end = [(bus, method) for method in (*ENDING, "faults") for bus in ("hand", "arm")]
    assert bench.log == begin + 3 * cycle + end


def test_one_row_per_cycle_on_the_grid_of_slots() -> None:
    bench = Bench(cycles=7)
    result = bench.loop.run()
    assert (result.cycles, result.missed_cycles) == (7, 0)
    assert bench.clock.now_ns() == 7 * PERIOD_NS
    assert bench.column("time_s") == pytest.approx([k * 1e-3 for k in range(7)])
    assert set(bench.column("skipped_slots")) == {0.0}


def test_a_run_begins_at_its_first_slot_when_all_drives_are_on() -> None:
    bench = Bench(cycles=7, arm={"enable_steps": 20})
    bench.loop.run()
    assert bench.begun == [bench.clock.now_ns() - 7 * PERIOD_NS]
    assert bench.begun[0] >= 19 * PERIOD_NS


def test_two_runs_on_the_fake_clock_are_equal_to_the_bit() -> None:
    runs = []
    for _ in range(2):
        bench = Bench(cycles=200, line=3, hand={"positions": swing})
        bench.loop.run()
        runs.append(bench.rows)
    assert runs[0] == runs[1]


def test_the_read_deadline_leaves_time_to_command_in_the_same_slot() -> None:
    bench = Bench(cycles=4)
    seen = []
    read = bench.hand.read
    bench.hand.read = lambda deadline: (seen.append(deadline), read(deadline))[1]  # type: ignore[method-assign]
    bench.loop.run()
    assert seen == [PERIOD_NS * k + round(READ_SHARE * PERIOD_NS) for k in range(4)]


def test_settings_that_differ_on_several_buses_are_one_list() -> None:
    """Else each bus takes a refused run of its own."""
    differ = {name: SettingsDifferError((name,), (f"{name}: mode 3 -> 0",)) for name in BUSES}
    for buses in (("hand",), ("arm",), BUSES):
        bench = Bench(**{name: {"fails": {("open", 0): differ[name]}} for name in buses})  # type: ignore[arg-type]
        error = bench.loop.run().error
        assert isinstance(error, SettingsDifferError)
        assert error.buses == buses
        assert error.differences == tuple(f"{name}: mode 3 -> 0" for name in buses)
        assert ("arm", "open") in bench.log
        assert "enable_step" not in [method for _, method in bench.log]


# -- ways out ------------------------------------------------------------------------------------

BUSES = ("hand", "arm")
METHODS = ("open", "enable_step", "request", "read", "write", "faults", "disable", "close")


@pytest.mark.parametrize("bus", ["hand", "arm"])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("count", [0, 3])
@pytest.mark.parametrize("error", [RuntimeError("broken"), KeyboardInterrupt()], ids=["bug", "^C"])
def test_a_driver_that_fails_anywhere_leaves_all_axes_safe(
    bus: str, method: str, count: int, error: BaseException
) -> None:
    bench = Bench(**{bus: {"fails": {(method, count): error}}})  # type: ignore[arg-type]
    result = bench.loop.run()
    if method in ("disable", "close"):
        assert result.error is None
    elif count == 0 or method not in ("open", "enable_step"):
        assert result.error is error
    assert_left_safely(bench)


@pytest.mark.parametrize("method", ["write", "disable", "close"])
@pytest.mark.parametrize("error", [RuntimeError("broken"), KeyboardInterrupt()], ids=["bug", "^C"])
def test_failing_on_the_way_out_stops_none_of_it(method: str, error: BaseException) -> None:
    count = 20 if method == "write" else 0
    bench = Bench(hand={"fails": {(method, count): error}}, arm={"fails": {(method, count): error}})
    bench.loop.run()
    assert_left_safely(bench)


@pytest.mark.parametrize("error", [OSError("disk"), KeyboardInterrupt()], ids=["disk", "^C"])
def test_a_sink_that_raises_ends_safely(error: BaseException) -> None:
    def fail(bench: Bench) -> None:
        if len(bench.rows) == 5:
            raise error

    bench = Bench(on_commit=fail)
    result = bench.loop.run()
    assert result.error is error
    assert result.cycles in (4, 5)
    assert_left_safely(bench)


def test_time_over_ends_safely_and_ramps_down() -> None:
    bench = Bench(cycles=60, release=10, hand={"positions": lambda axis, k: 1e-4 * k})
    bench.loop.run()
    assert_left_safely(bench)
    assert max(map(abs, bench.efforts(bench.hand)[:50])) > 0.0


def test_enabling_that_never_ends_times_out_and_names_the_bus() -> None:
    bench = Bench(arm={"enable_steps": 10**9})
    result = bench.loop.run()
    assert isinstance(result.error, BusTimeout)
    assert "arm" in str(result.error)
    assert "hand" not in str(result.error)
    assert bench.clock.now_ns() == pytest.approx(10e9, rel=0.01)
    # One that is on is stepped too: its drives watch for silence.
    assert bench.hand.counts["enable_step"] == bench.arm.counts["enable_step"]
    assert_left_safely(bench)


@pytest.mark.parametrize(("takes_ms", "rests_ms"), [(0.25, 0.75), (2.5, 1.0)])
def test_a_host_that_is_too_slow_gives_drives_time_to_answer_while_it_enables(
    takes_ms: float, rests_ms: float
) -> None:
    bench = Bench(arm={"enable_steps": 20})
    clock, step = bench.clock, bench.arm.enable_step
    times: list[tuple[int, int]] = []

    def slow() -> bool:
        begun = clock.now_ns()
        clock.sleep_until(begun + round(1e6 * takes_ms))
        times.append((begun, clock.now_ns()))
        return step()

    bench.arm.enable_step = slow  # type: ignore[method-assign]
    assert bench.loop.run().error is None
    rests = {after[0] - before[1] for before, after in itertools.pairwise(times)}
    assert rests == {round(1e6 * rests_ms)}


def test_a_stop_while_enabling_leaves() -> None:
    bench = Bench(arm={"enable_steps": 10**9})
    step = bench.arm.enable_step

    def stop_then_step() -> bool:
        if bench.arm.counts.get("enable_step", 0) == 3:
            bench.loop.stop()
        return step()

    bench.arm.enable_step = stop_then_step  # type: ignore[method-assign]
    result = bench.loop.run()
    assert result.interrupted
    assert isinstance(result.error, KeyboardInterrupt)
    assert_left_safely(bench)


# -- Ctrl-C ----------------------------------------------------------------------------------------


def test_stop_ramps_down_over_the_release_cycles_and_then_ends() -> None:
    limit = WIDE._replace(effort=2.0)

    def stop(bench: Bench) -> None:
        if len(bench.rows) == 30:
            bench.loop.stop()

    bench = Bench(
        cycles=1000, release=20, master=site(b=1000.0, limit=limit), on_commit=stop,
        hand={"positions": lambda axis, k: 0.01 * k},
    )  # fmt: skip
    result = bench.loop.run()
    assert (result.error, result.interrupted, result.cycles) == (None, True, 50)
    efforts = bench.efforts(bench.hand)
    assert abs(efforts[29]) == pytest.approx(2.0)
    for k in range(30, 50):
        assert abs(efforts[k]) <= 2.0 * (50 - k) / 20 + 1e-12
    assert_left_safely(bench)


def test_a_second_stop_leaves_at_once() -> None:
    def stop(bench: Bench) -> None:
        if len(bench.rows) in (30, 33):
            bench.loop.stop()

    bench = Bench(cycles=1000, release=200, on_commit=stop)
    result = bench.loop.run()
    assert result.interrupted
    assert result.cycles == 33
    assert_left_safely(bench)


def test_a_stop_near_the_end_does_not_prolong_the_run() -> None:
    def stop(bench: Bench) -> None:
        if len(bench.rows) == 18:
            bench.loop.stop()

    bench = Bench(cycles=20, release=200, on_commit=stop)
    assert bench.loop.run().cycles == 20


# -- overruns --------------------------------------------------------------------------------------


def late_at(*sleeps: int, slots: float = 3.0):
    """Oversleep by `slots` periods at the given sleeps (the n-th call of sleep_until)."""
    calls = itertools.count()
    return lambda deadline: int(slots * PERIOD_NS) if next(calls) in sleeps else 0


def test_overruns_skip_and_count_and_never_run_a_slot_twice() -> None:
    bench = Bench(cycles=50, line=2, oversleep=late_at(10, 20, 21), hand={"positions": swing})
    result = bench.loop.run()
    slots = [round(t * 1e3) for t in bench.column("time_s")]
    assert len(set(slots)) == len(slots)
    assert slots == sorted(slots)
    assert result.missed_cycles == 9
    assert result.cycles == 41
    assert sum(bench.column("skipped_slots")) == 9.0
    # A row's time is the slot it ran in, and its skipped slots are those just before.
    for before, row in itertools.pairwise(bench.rows):
        assert round((row[0] - before[0]) * 1e3) == row[3] + 1


def test_slots_that_pass_while_devices_are_reset_are_counted() -> None:
    def ask(bench: Bench) -> None:
        if len(bench.rows) == 10:
            bench.pair.control.wants_reset = True

    bench = Bench(cycles=40, on_commit=ask)
    opens, clock = bench.arm.open, bench.clock

    def open_slowly() -> None:
        opens()
        if bench.rows:  # five periods and a half
            clock.sleep_until(clock.now_ns() + 11 * PERIOD_NS // 2)

    bench.arm.open = open_slowly  # type: ignore[method-assign]
    result = bench.loop.run()
    assert not bench.pair.control.wants_reset
    assert result.missed_cycles == 5
    assert result.cycles == 35
    assert round(bench.rows[10][0] * 1e3) == 15


def test_less_than_a_period_late_is_late_but_misses_nothing() -> None:
    bench = Bench(cycles=30, oversleep=late_at(10, slots=0.6))
    result = bench.loop.run()
    assert (result.missed_cycles, result.cycles) == (0, 30)
    assert bench.column("lateness_us")[11] == pytest.approx(600.0)
    assert bench.column("lateness_us")[12] == 0.0  # deadlines are absolute: no drift


def test_too_many_skipped_slots_stop_the_run() -> None:
    bench = Bench(cycles=500, overrun_limit=20, release=5, oversleep=late_at(10, slots=20.0))
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    assert "20 slots" in str(result.error)
    assert result.cycles < 30
    assert_left_safely(bench)


def test_a_stall_beyond_the_end_of_the_run_ends_it() -> None:
    bench = Bench(cycles=30, oversleep=late_at(10, slots=45.0))
    result = bench.loop.run()
    assert result.cycles == 11
    assert_left_safely(bench)


def test_a_stop_asked_for_before_the_loop_opens_nothing() -> None:
    bench = Bench(cycles=10)
    bench.loop.stop()
    result = bench.loop.run()
    assert not result.opened
    assert isinstance(result.error, KeyboardInterrupt)
    assert ("hand", "open") not in bench.log
    assert not bench.rows
    assert_left_safely(bench)
