"""A simulated axis: its drive's delay, limits, encoder and faults, on the loop's grid."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import AxisSpec
from tautwave.streams import BLOCK, NOISE, colour_taps, normal_noise
from tautwave.truth import PositionLoop
from tautwave_sim.axis import SimulatedAxis
from tautwave_sim.bench import free_axis
from tautwave_sim.loopback import LoopbackSimulator
from tests.sim.truths import PERIOD, truth


def run(axis: SimulatedAxis, commands: list[float]) -> list[float]:
    seen = []
    for command in commands:
        axis.command(command)
        axis.pass_slot()
        seen.append(axis.physics.x)
    return seen


def held(mass: float, commands: list[float]) -> list[float]:
    x = v = 0.0
    seen = []
    for command in commands:
        x += v * PERIOD + 0.5 * command / mass * PERIOD**2
        v += command / mass * PERIOD
        seen.append(x)
    return seen


@given(st.lists(st.floats(-5, 5), min_size=1, max_size=40), st.integers(0, 4))
def test_a_command_acts_after_its_delay_and_exactly(commands: list[float], delay: int) -> None:
    axis = SimulatedAxis("master.a", truth(delay=float(delay)))
    expected = held(0.5, [0.0] * delay + commands)[: len(commands)]
    assert run(axis, commands) == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_a_remainder_splits_the_period() -> None:
    axis = SimulatedAxis("master.a", truth(delay=1.25))
    run(axis, [2.0, 0.0, 0.0])
    # 2 N act from 1.25 to 2.25 periods.
    v = 2.0 / 0.5 * PERIOD
    assert axis.physics.v == pytest.approx(v, rel=1e-12)
    assert axis.physics.x == pytest.approx(v * PERIOD * (0.5 + 0.75), rel=1e-12)
    assert axis.physics.motor_work == pytest.approx(0.5 * 0.5 * v * v, rel=1e-12)


@given(st.floats(-1e3, 1e3), st.sampled_from([0.0, 0.1, 0.3]))
def test_the_motor_saturates_and_counts(value: float, quantum: float) -> None:
    axis = SimulatedAxis("master.a", truth(limit=3.0, effort_quantum=quantum))
    run(axis, [value])
    acted = axis.physics.v * 0.5 / PERIOD
    assert abs(acted) <= 3.0 * (1 + 1e-12)
    if abs(value) < 2.8:
        assert abs(acted - value) <= 0.5 * quantum + 1e-9


def test_the_encoder_quantises_after_the_noise() -> None:
    axis = SimulatedAxis("master.a", truth(quantum=1e-3, noise=4e-4))
    seen = np.array([axis.measure().position for _ in range(4000)])
    counts = seen / 1e-3
    assert np.abs(counts - np.round(counts)).max() < 1e-9
    assert seen.std() == pytest.approx(math.hypot(4e-4, 1e-3 / math.sqrt(12.0)), rel=0.1)
    plain = SimulatedAxis("master.a", truth(noise=4e-4))
    noise = np.array([plain.measure().position for _ in range(4000)])
    assert noise.std() == pytest.approx(4e-4, rel=0.05)
    assert abs(noise.mean()) < 3e-5


def test_streams_are_the_axis_own_and_seeded() -> None:
    first = [SimulatedAxis("m.a", truth(noise=1.0, seed=(1, 7))).measure().position for _ in "ab"]
    other = SimulatedAxis("m.a", truth(noise=1.0, seed=(1, 8))).measure().position
    assert first[0] == first[1] != other
    lossy = SimulatedAxis("m.a", truth(noise=1.0, missing=0.5, seed=(1, 7)))
    assert lossy.measure().position == first[0]


NARROW = tuple(0.98**k * math.cos(1.67 * k) * (1 - k / 41) for k in range(1, 41))


@pytest.mark.parametrize("colour", [(0.5,), (-0.4,), NARROW], ids=["mean", "MA(-.5)", "narrow"])
def test_noise_has_the_colour_asked_for_across_blocks(colour: tuple[float, ...]) -> None:
    taps = colour_taps(colour)
    assert np.correlate(taps, taps, "full")[len(taps) - 1 :] == pytest.approx(
        (1.0, *colour), abs=1e-6
    )
    axis = SimulatedAxis("master.a", truth(noise=1.0)._replace(colour=colour))
    seen = [axis.measure().position for _ in range(2 * BLOCK + 7)]
    assert seen == normal_noise((1, 2, NOISE), len(seen), colour).tolist()


def test_samples_are_missing_as_often_as_asked_and_never_the_first() -> None:
    axis = SimulatedAxis("master.a", truth(missing=0.2))
    assert axis.measure().valid
    missing = 0
    for _ in range(5000):
        axis.pass_slot()
        missing += not axis.measure().valid
    assert missing / 5000 == pytest.approx(0.2, abs=0.02)


def test_an_impedance_axis_measures_no_effort_and_an_admittance_axis_does() -> None:
    state = SimulatedAxis("master.a", truth()).measure()
    assert math.isnan(state.effort)
    assert math.isnan(state.velocity)
    grip = SimulatedAxis(
        "master.a", truth(servo=True, grip=(100.0, 0.0), reference=[0.0, 0.01, 0.01, 0.01])
    )
    grip.pass_slot()
    assert grip.measure().effort == pytest.approx(1.0)


def test_an_admittance_drive_follows_its_velocity() -> None:
    axis = SimulatedAxis("master.a", truth(servo=True, velocity_quantum=0.1))
    run(axis, [0.234] * 30)
    assert axis.physics.v == pytest.approx(0.2, rel=1e-5)


def test_the_hand_moves_on_the_grid_and_stays_at_the_end() -> None:
    axis = SimulatedAxis("master.a", truth(reference=[0.0, 1.0, 3.0]))
    seen = []
    for _ in range(5):
        seen.append(axis.hand())
        axis.pass_slot()
    assert seen == [(0.0, 1000.0), (1.0, 2000.0), (3.0, 0.0), (3.0, 0.0), (3.0, 0.0)]
    assert SimulatedAxis("slave.a", truth()).hand() == (0.0, 0.0)


def test_who_is_moved_by_a_program_takes_from_it_what_the_motor_gives() -> None:
    axis = SimulatedAxis("master.a", truth())
    program = axis.give_over()
    assert program is not None
    last, work = program.x, 0.0
    for command, x, v in ((2.0, 0.5, 3.0), (-1.0, 0.25, -1.0), (0.5, 1.0, 0.0)):
        axis.command(command)
        program.place(x, v)
        assert program.x == last  # until the slot has passed
        axis.pass_slot()
        work += command * (x - last)
        last = x
        assert (program.x, program.v) == (x, v)
        assert program.motor_work == pytest.approx(work, rel=1e-15)
        assert program.hand_work == pytest.approx(-work, rel=1e-15)
        assert program.forces(0.0, 0.0) == (-command, 0.0)
        assert program.stored(0.0) == (0.0, 0.0, 0.0)


def test_columns_match_what_is_filled() -> None:
    for reference in ((), (0.0, 0.1)):
        axis = SimulatedAxis("master.a", truth(reference=reference))
        row = [math.nan] * (len(axis.columns) + 2)
        axis.fill(row, 1)
        assert math.isnan(row[0])
        assert math.isnan(row[-1])
        assert all(math.isfinite(value) for value in row[1:-1])


class Counter:
    """Stands in for an axis and counts its slots."""

    def __init__(self) -> None:
        self.slots = 0

    def pass_slot(self) -> None:
        self.slots += 1


def grid() -> tuple[LoopbackSimulator, Counter]:
    spec = AxisSpec("master.a", 1, "linear", "impedance", 1.0)
    world = LoopbackSimulator([spec], [truth()])
    counter = Counter()
    world.axes = [counter]  # type: ignore[list-item]
    return world, counter


def test_lateness_below_half_a_period_moves_nothing() -> None:
    world, counter = grid()
    world.advance(7_000_000)
    assert counter.slots == 0  # the grid begins at the first call
    for late, slots in ((7_999_000, 1), (8_400_000, 1), (9_499_999, 2), (9_500_000, 3)):
        world.advance(late)
        assert counter.slots == slots
    world.advance(9_000_000)  # time never runs backwards
    assert counter.slots == 3


def test_rest_begins_a_new_grid() -> None:
    world, counter = grid()
    world.advance(0)
    world.advance(3_000_000)
    world.rest()
    world.advance(90_000_000)
    assert counter.slots == 3
    world.advance(91_000_000)
    assert counter.slots == 4


def test_an_axis_of_a_bench_reads_where_it_is() -> None:
    axis = SimulatedAxis("master.a", free_axis(PERIOD, 0.5, 0.0, seed=(1,)))
    expected = held(0.5, [2.0] * 9)
    for command, place in zip([2.0] * 9, expected, strict=True):
        axis.command(command)
        axis.pass_slot()
        sample = axis.measure()
        assert sample.valid
        assert sample.position == pytest.approx(place, rel=1e-12)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_drive_that_takes_positions_pulls_no_harder_than_its_limit(side: float) -> None:
    axis = SimulatedAxis("master.a", truth(limit=3.0), PositionLoop(1e3, 0.1))
    run(axis, [side])
    assert axis.physics.v * 0.5 / PERIOD == pytest.approx(3.0 * side)
