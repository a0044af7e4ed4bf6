"""The loop: order of calls, deadlines, and every way out ending in the safe command."""

from __future__ import annotations

import itertools
import math

import pytest

from tautwave.contracts import READ_SHARE
from tautwave.errors import BusTimeout, DeviceFault, DriverError, SafetyStop
from tautwave.laws.wall import WallParams
from tautwave.types import SAFE_COMMAND, Fault
from tests.runtime.parts import PERIOD_NS, WIDE, Bench, site

ENDING = ["write", "disable", "close"]


def swing(axis: int, cycle: int) -> float:
    return 0.01 * math.sin(0.3 * cycle)


def assert_left_safely(bench: Bench) -> None:
    """Every bus: safe command, disable, close, in this order and at the end."""
    tail = bench.log[-6:]
    assert tail == [(bus, method) for method in ENDING for bus in ("hand", "arm")]
    for driver in (bench.hand, bench.arm):
        assert driver.written[-1] == [SAFE_COMMAND]


def assert_finite_commands(bench: Bench) -> None:
    for driver in (bench.hand, bench.arm):
        for commands in driver.written:
            assert all(math.isfinite(number) for command in commands for number in command)


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
    end = [(bus, method) for method in ENDING for bus in ("hand", "arm")]
    assert bench.log == begin + 3 * cycle + end


def test_one_row_per_cycle_on_the_grid_of_slots() -> None:
    bench = Bench(cycles=7)
    result = bench.loop.run()
    assert (result.cycles, result.missed_cycles) == (7, 0)
    assert bench.clock.now_ns() == 7 * PERIOD_NS
    assert bench.column("time_s") == pytest.approx([k * 1e-3 for k in range(7)])
    assert set(bench.column("skipped_slots")) == {0.0}


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


# -- ways out ------------------------------------------------------------------------------------

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


# -- missing samples -----------------------------------------------------------------------------


def test_missing_samples_hold_the_command() -> None:
    bench = Bench(
        cycles=40,
        missing_limit=10,
        hand={"positions": lambda axis, k: 1e-4 * k, "valid": lambda axis, k: not 20 <= k < 25},
    )
    result = bench.loop.run()
    assert result.error is None
    assert result.lost == (5, 0)
    efforts = bench.efforts(bench.hand)
    assert len(set(efforts[19:25])) == 1
    assert efforts[19] != 0.0
    assert efforts[25] != efforts[24]
    assert bench.column("master.a.valid")[19:26] == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]


def test_a_sample_lost_for_good_stops_with_the_name_of_its_axis() -> None:
    bench = Bench(
        cycles=100,
        release=8,
        missing_limit=6,
        hand={"positions": lambda axis, k: 1e-4 * k},
        arm={"valid": lambda axis, k: k < 30},
    )
    result = bench.loop.run()
    assert isinstance(result.error, DriverError)
    assert "slave.a" in str(result.error)
    assert "6 cycles" in str(result.error)
    # Found in cycle 35 (30..35 were missing), then the ramp.
    assert result.cycles == 36 + 8
    efforts = [abs(e) for e in bench.efforts(bench.arm)]
    assert efforts[-1] == 0.0
    assert efforts[34] >= efforts[36] >= efforts[43]
    assert_left_safely(bench)


def test_a_driver_that_returns_too_few_states_is_an_error_and_shifts_nobody() -> None:
    bench = Bench(hand={"states": 0})
    result = bench.loop.run()
    assert isinstance(result.error, DriverError)
    assert "hand" in str(result.error)
    assert_left_safely(bench)


# -- limits and guards ---------------------------------------------------------------------------


def jump(at: int, value: float):
    return lambda axis, k: value if k >= at else 0.0


@pytest.mark.parametrize(
    ("positions", "told"),
    [
        (jump(10, 0.7), "left its position range"),
        (lambda axis, k: 0.03 * max(0, k - 9), "exceeded its velocity limit"),
    ],
)
@pytest.mark.parametrize("bus", ["hand", "arm"])
def test_a_guard_stops_with_axis_and_value(positions: object, told: str, bus: str) -> None:
    limit = WIDE._replace(velocity=20.0, position_low=-0.5, position_high=0.5, stop_damping=2.0)
    bench = Bench(
        cycles=100,
        release=10,
        line=2,
        master=site(limit=limit),
        slave=site(limit=limit),
        **{bus: {"positions": positions}},  # type: ignore[arg-type]
    )
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    side = "master" if bus == "hand" else "slave"
    message = str(result.error)
    assert message.startswith(f"{side}.a {told}")
    assert "position" in message
    assert "velocity" in message
    assert result.cycles == 11 + 10
    assert_finite_commands(bench)
    assert_left_safely(bench)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("bus", ["hand", "arm"])
def test_a_sample_that_is_no_number_stops_with_axis_and_value(bad: float, bus: str) -> None:
    bench = Bench(cycles=100, release=10, line=2, **{bus: {"positions": jump(10, bad)}})  # type: ignore[arg-type]
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    side = "master" if bus == "hand" else "slave"
    assert str(result.error).startswith(f"{side}.a: measured position {bad}")
    assert result.cycles == 11 + 10
    assert_finite_commands(bench)
    assert_left_safely(bench)


def test_the_stop_damps_then_fades() -> None:
    limit = WIDE._replace(position_low=-0.05, position_high=0.05, stop_damping=2.0, effort=10.0)
    bench = Bench(
        cycles=300, release=50, master=site(limit=limit),
        hand={"positions": lambda axis, k: 1e-3 * k},
    )  # fmt: skip
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    at = 51  # the first position beyond 0.05
    efforts = bench.efforts(bench.hand)
    assert efforts[at + 1 : at + 20] == pytest.approx([-2.0] * 19)  # 1 m/s against 2 N s/m
    tail = [abs(e) for e in efforts[at + 40 :]]
    assert tail[-1] == 0.0
    assert all(later <= sooner for sooner, later in itertools.pairwise(tail))


def test_a_nan_never_reaches_a_motor_nor_the_books() -> None:
    for bad in (math.nan, math.inf):
        bench = Bench(
            cycles=60,
            line=2,
            hand={"positions": lambda axis, k, bad=bad: bad if k == 9 else 1e-4 * k},
        )
        bench.loop.run()
        assert_finite_commands(bench)
        for name in bench.columns:
            assert all(math.isfinite(value) for value in bench.column(name)), name


def test_an_admittance_axis_without_a_measured_effort_stops() -> None:
    limit = WIDE._replace(velocity=1.0)
    bench = Bench(
        cycles=60,
        slave=site(admittance=True, limit=limit),
        arm={"efforts": lambda axis, k: math.nan if k == 9 else 0.1},
    )
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    assert "slave.a" in str(result.error)
    assert_finite_commands(bench)
    assert all(math.isfinite(e) for e in bench.column("a.port_slave.absorbed"))


def test_a_first_sample_that_is_nan_never_engages_silently() -> None:
    bench = Bench(cycles=60, hand={"positions": lambda axis, k: math.nan if k == 0 else 1e-4 * k})
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    assert set(bench.efforts(bench.hand)) == {0.0}
    assert_left_safely(bench)


# -- engaging --------------------------------------------------------------------------------------


def test_engaging_is_refused_when_the_sides_are_apart() -> None:
    bench = Bench(offset=0.0, tolerance=0.01, arm={"positions": lambda axis, k: 0.02})
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    assert "pair a" in str(result.error)
    assert "+0.02" in str(result.error)
    assert "0.01" in str(result.error)
    assert set(bench.efforts(bench.hand)) == {0.0}
    assert_left_safely(bench)
    near = Bench(offset=0.0, tolerance=0.01, arm={"positions": lambda axis, k: 0.009})
    assert near.loop.run().error is None


def test_it_is_not_armed_inside_a_wall() -> None:
    limit = WIDE._replace(effort=10.0)
    wall = WallParams(0.0, 1.0, 1000.0, 0.0, controlled=False)
    bench = Bench(
        cycles=400, master=site(limit=limit, wall=wall),
        hand={"positions": lambda axis, k: 0.01 if k < 200 else 0.0005 if k < 300 else 0.002},
    )  # fmt: skip
    assert bench.loop.run().error is None
    efforts = bench.efforts(bench.hand)
    assert set(efforts[:200]) == {0.0}
    assert efforts[200] != 0.0 or efforts[201] != 0.0
    assert efforts[298] == pytest.approx(-0.5, abs=0.05)


def test_standing_in_a_wall_for_good_is_a_safety_stop() -> None:
    wall = WallParams(0.0, 1.0, 1000.0, 0.0, controlled=False)
    bench = Bench(
        cycles=8000, master=site(limit=WIDE._replace(effort=10.0), wall=wall),
        hand={"positions": lambda axis, k: 0.01},
    )  # fmt: skip
    result = bench.loop.run()
    assert isinstance(result.error, SafetyStop)
    assert "not engaged after 5 s" in str(result.error)
    assert set(bench.efforts(bench.hand)) == {0.0}
    assert_left_safely(bench)


def test_engaging_waits_for_both_samples() -> None:
    bench = Bench(cycles=30, arm={"valid": lambda axis, k: k >= 3}, hand={"positions": swing})
    assert bench.loop.run().error is None
    assert bench.efforts(bench.hand)[:3] == [0.0] * 3


def test_the_engage_ramp_bounds_every_effort() -> None:
    limit = WIDE._replace(effort=2.0)
    bench = Bench(
        cycles=100, engage=50, release=0, master=site(b=1000.0, limit=limit),
        hand={"positions": lambda axis, k: 0.01 * k},
    )  # fmt: skip
    bench.loop.run()
    efforts = bench.efforts(bench.hand)
    for k in range(50):
        assert abs(efforts[k]) <= 2.0 * (k + 1) / 50 + 1e-12
    assert abs(efforts[60]) == pytest.approx(2.0)


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


# -- faults ----------------------------------------------------------------------------------------


def test_a_fault_is_reported_and_a_fatal_one_stops() -> None:
    warm = Fault("slave.a", "warm", False)
    bench = Bench(cycles=30, arm={"faults": {5: warm}})
    result = bench.loop.run()
    assert (result.error, result.faults) == (None, (Fault("slave.a", "slave.a: warm", False),))
    named = Fault("slave.a", "slave.a (node 2): warm", False)  # a driver that says where
    result = Bench(cycles=30, arm={"faults": {5: named}}).loop.run()
    assert result.faults == (named,)
    hot = Fault("", "bus off", True)
    bench = Bench(cycles=300, release=5, arm={"faults": {5: hot}})
    result = bench.loop.run()
    assert isinstance(result.error, DeviceFault)
    assert str(result.error) == "arm: bus off"
    assert result.cycles == 6 + 5
    assert_left_safely(bench)


def test_the_first_reason_is_the_one_that_is_told() -> None:
    bench = Bench(
        cycles=300, release=20, missing_limit=3,
        arm={"faults": {5: Fault("slave.a", "hot", True)}, "valid": lambda axis, k: k < 6},
    )  # fmt: skip
    result = bench.loop.run()
    assert isinstance(result.error, DeviceFault)


def test_ramps_that_overlap_multiply() -> None:
    limit = WIDE._replace(effort=2.0)
    bench = Bench(
        cycles=30, engage=20, release=20, master=site(b=1000.0, limit=limit),
        hand={"positions": lambda axis, k: 0.01 * k},
    )  # fmt: skip
    bench.loop.run()
    for k, effort in enumerate(bench.efforts(bench.hand)[:30]):
        share = min(1.0, (k + 1) / 20) * min(1.0, (30 - k) / 20)
        assert abs(effort) <= 2.0 * share + 1e-12
