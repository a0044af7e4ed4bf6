"""What the loop does not let pass: lost samples, limits, bad numbers, faults, a bad start."""

from __future__ import annotations

import itertools
import math

import pytest

from tautwave.errors import DeviceFault, DriverError, SafetyStop
from tautwave.laws.wall import WallParams
from tautwave.types import Fault
from tests.runtime.leaving import assert_finite_commands, assert_left_safely
from tests.runtime.parts import WIDE, Bench, site, swing

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
    assert result.stop == (0.035, "slave.a", "no_sample")
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
    ("positions", "reported"),
    [
        (
            jump(10, 0.7),
            "left its position range of -0.5 to 0.5 rad at 0.010 s: position 0.7 rad, velocity ",
        ),
        (
            lambda axis, k: 0.03 * max(0, k - 9),
            "exceeded its velocity limit of 20 rad/s at 0.010 s: position 0.03 rad, velocity ",
        ),
    ],
)
@pytest.mark.parametrize("bus", ["hand", "arm"])
def test_a_guard_stops_with_axis_and_value(positions: object, reported: str, bus: str) -> None:
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
    assert message.startswith(f"{side}.a {reported}")
    assert message.endswith(" rad/s")
    reason = "position_range" if "range" in reported else "velocity_limit"
    assert result.stop == (0.01, f"{side}.a", reason)
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
    assert str(result.error).startswith(f"{side}.a: measured position {bad} rad, effort nan N m;")
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
    assert result.stop == (0.005, "", "device_fault")
    assert result.cycles == 6 + 5
    assert_left_safely(bench)


def test_the_first_reason_is_the_one_that_is_reported() -> None:
    bench = Bench(
        cycles=300, release=20, missing_limit=3,
        arm={"faults": {5: Fault("slave.a", "hot", True)}, "valid": lambda axis, k: k < 6},
    )  # fmt: skip
    result = bench.loop.run()
    assert isinstance(result.error, DeviceFault)
    assert result.stop == (0.005, "slave.a", "device_fault")


@pytest.mark.parametrize("when", [10, "leaving"])
def test_what_a_silent_device_says_later_ends_the_sentence(when: int | str) -> None:
    """A servo that was switched off and on: silent first, and back while the others are stopped."""
    said = Fault("slave.a", "torque enable reads 0 instead of 1", True)
    gone = {"valid": lambda axis, k: k < 6}
    at = 12 if when == "leaving" else when  # 6 + 3 missing, 3 of the release; then the last look
    earlier = {2: Fault("slave.a", "warm", False), 9: Fault("slave.a", "a note", False)}
    bench = Bench(
        cycles=300, release=3, missing_limit=3, arm={"faults": earlier | {at: said}, **gone}
    )
    result = bench.loop.run()
    assert bench.arm.counts["faults"] == 13
    assert isinstance(result.error, DeviceFault)
    assert str(result.error) == (
        "slave.a on bus 'arm': no sample in 3 cycles in a row; then slave.a: torque enable reads "
        "0 instead of 1"
    )
    assert result.stop is not None
    assert result.stop.reason == "no_sample"
    assert said._replace(text=f"slave.a: {said.text}") in result.faults
    assert_left_safely(bench)


def test_a_fault_before_the_stop_is_none_of_its_reasons() -> None:
    bench = Bench(cycles=300, missing_limit=3, arm={"valid": lambda axis, k: k < 6})
    bench.loop._sensing.faults.append(Fault("slave.a", "an old one, reset since", True))
    bench.loop._sensing._until_stop = 1
    assert str(bench.loop.run().error).endswith("in a row; check power and cable")


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


def test_the_engage_ramp_bounds_every_effort_but_what_resists_a_device_on_its_way_out() -> None:
    """Out for ten periods, back for ten, and out on the other side."""
    limit = WIDE._replace(effort=2.0)
    bench = Bench(
        cycles=100, engage=50, release=0, master=site(b=1000.0, limit=limit),
        hand={"positions": lambda axis, k: 0.01 * (10 - abs(k - 10))},
    )  # fmt: skip
    bench.loop.run()
    efforts = bench.efforts(bench.hand)
    for k in range(50):
        back = 10 < k <= 20
        assert abs(efforts[k]) <= (2.0 * (k + 1) / 50 + 1e-12 if back else 2.0)
    assert efforts[5] == pytest.approx(-2.0)  # it acts against the way out, in full
    assert efforts[30] == pytest.approx(2.0)
    assert abs(efforts[60]) == pytest.approx(2.0)


def test_ramps_that_overlap_multiply() -> None:
    """And once their product falls, nothing exceeds it."""
    limit = WIDE._replace(effort=2.0)
    bench = Bench(
        cycles=30, engage=20, release=20, master=site(b=1000.0, limit=limit),
        hand={"positions": lambda axis, k: 0.01 * k},
    )  # fmt: skip
    bench.loop.run()
    for k, effort in enumerate(bench.efforts(bench.hand)[:30]):
        share = min(1.0, (k + 1) / 20) * min(1.0, (30 - k) / 20)
        assert abs(effort) <= (2.0 * share + 1e-12 if k > 15 else 2.0)
