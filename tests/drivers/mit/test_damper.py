"""A damper in the motor: its codes, what is compared before torque, its books, and its loss."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError, DriverError
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.damper import DamperBooks
from tautwave_drivers.mit.options import Motor, facts, motors_of, scale_of
from tests.drivers.mit.benches import Rig, block, bus_of, driver_options, foreign, motor, simulated

DAMPED = {"damping": 0.3, "velocity_filter_hz": 100.0}
KEYS = {"id": 1, "feedback_id": 17, "p_max": 12.5, "v_max": 30.0, "t_max": 10.0}


def decoded(frame: bytes) -> tuple[float, float, float, float]:
    """Return velocity, kp, kd and torque of a frame of a DM-J4310, at the motor."""
    word = int.from_bytes(frame, "big")
    v, kp, kd, t = (word >> at & 0xFFF for at in (36, 24, 12, 0))
    return (2 * v / 4095 - 1) * 30.0, kp / 4095 * 500, kd / 4095 * 5, (2 * t / 4095 - 1) * 10.0


@given(st.integers(-200, 200), st.sampled_from([1, -1]), st.floats(0.001, 5.0))
def test_at_rest_two_frames_push_as_commanded_whatever_the_velocity_code_says(
    steps: int, direction: int, damping: float
) -> None:
    scale = scale_of(
        Motor(**KEYS, direction=direction, damping=damping, velocity_filter_hz=100.0)  # type: ignore[arg-type]
    )
    effort = steps * scale.torque
    pushes = []
    for upper in (True, False):
        code = scale.coder(10.0)(effort, upper)
        v, kp, kd, t = decoded(damiao.command(code, scale.damping_code))
        assert kp == 0.0
        assert kd == pytest.approx(damping, abs=0.51 * 5.0 / 4095)
        pushes.append(direction * (kd * v + t))
        assert abs(pushes[-1] - effort) <= 0.7501 * scale.torque
    assert abs(sum(pushes) / 2.0 - effort) <= 0.2501 * scale.torque


def test_the_certificate_gets_the_code_and_not_the_wish() -> None:
    options = block(motor(1, damping=0.1, velocity_filter_hz=80.0), motor(2))
    one, other = facts(driver_options(options), bus_of(options))
    assert one.damper is not None
    assert one.damper.damping == pytest.approx(82 * 5.0 / 4095)
    assert one.damper.filter_s == pytest.approx(1.0 / (math.tau * 80.0))
    assert "V_BW(32) of motor 1" in one.damper.assumed
    assert other.damper is None


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"damping": 0.1}, "no velocity_filter_hz; write what its register V_BW(32) reads"),
        ({"damping": 0.5, "velocity_filter_hz": 100.0}, "make 11 N m, more than motor 1 gives"),
    ],
)
def test_what_does_not_go_together_is_refused(more: dict[str, Any], words: str) -> None:
    options = block(motor(1, **more))
    bus = bus_of(options)
    bus = bus._replace(axes=(bus.axes[0]._replace(velocity_limit=20.0),))
    with pytest.raises(ConfigError) as caught:
        motors_of(driver_options(options), bus)
    assert words in str(caught.value)


@pytest.mark.parametrize("reads", [50.0, math.nan])
def test_another_filter_than_the_certificate_has_is_refused(reads: float) -> None:
    rig = foreign(motor(1, damping=0.1, velocity_filter_hz=100.0), registers={32: reads})
    with pytest.raises(DriverError, match=r"V_BW\(32\) reads (50|nan)"):
        rig.driver.open()
    rig.driver.close()


def test_without_a_damper_the_filter_is_not_asked_for() -> None:
    rig = foreign(motor(1, velocity_filter_hz=100.0), registers={32: 50.0})
    rig.up()
    rig.driver.close()


def spun(rig: Rig, speed: float) -> None:
    """Bring up a motor that turns at a speed [rad/s] when it is enabled."""
    rig.up()
    rig.run(2)
    if hasattr(rig.motors[0], "axis"):
        rig.motors[0].axis.physics.v = speed
    else:
        rig.motors[0].speed = speed


@pytest.mark.parametrize("make", [foreign, simulated])
def test_a_motor_slows_down_between_samples_by_the_exponential(make: Any) -> None:
    rig = make(motor(1, damping=0.05, velocity_filter_hz=100.0), mass=1e-4)
    spun(rig, 20.0)
    rows, faults = rig.run(6)
    assert not faults
    places = [row[0].position for row in rows]
    rate = 41 * 5.0 / 4095 * 1e-3 / 1e-4
    # One that held its torque over a period would have (1 - rate)^2 = 0.25 here, not 0.37.
    found = (places[4] - places[2]) / (places[2] - places[0])
    assert found == pytest.approx(math.exp(-2.0 * rate), abs=0.03)
    rig.driver.close()


@pytest.mark.parametrize("make", [foreign, simulated])
def test_its_books_are_the_kinetic_energy_that_is_gone(make: Any) -> None:
    rig = make(motor(1, damping=0.2, velocity_filter_hz=100.0), mass=0.02)
    spun(rig, 5.0)
    rig.run(400)
    names = rig.driver.columns
    row = [0.0] * len(names)
    rig.driver.fill(row, 0)
    taken = dict(zip(names, row, strict=True))
    kinetic = 0.5 * 0.02 * 25.0
    assert taken["master.a1.damper_absorbed"] == pytest.approx(kinetic, rel=0.03)
    assert 0.9 * kinetic < taken["master.a1.damper_least"] <= kinetic
    rig.driver.close()


def test_a_motor_that_limits_its_torque_is_stopped() -> None:
    """It says nothing of it: its torque, as it reports it, lacks what a damper takes."""
    rig = simulated(
        motor(1, **DAMPED),
        mass=0.05,
        simulator={"motors": {"1": {"derates_at_s": 0.05, "derated_to": 0.01}}},
    )
    spun(rig, 4.0)
    _, faults = rig.run(1100)
    assert [fault.axis for fault in faults] == ["master.a1"]
    assert faults[0].fatal
    assert "its damper takes far less than it should" in faults[0].text
    (state,) = rig.cycle()
    assert not state.valid
    rig.driver.close()


def test_a_motor_in_fault_gets_no_damper() -> None:
    rig = foreign(motor(1, **DAMPED))
    rig.up()
    rig.run(3)
    rig.driver._axes[0].fault = "for a test"
    rig.run(1)
    assert decoded(rig.motors[0].log[-1])[2] == 0.0
    rig.driver.close()


STEPS = (1e-6, 1e-3)
"""Of position and torque; the first is fine, for bounds that can be compared."""


def filtered(
    hz: float, filter_hz: float, steps: tuple[float, float] = STEPS, share: float = 1.0
) -> tuple[DamperBooks, float, bool]:
    """Swing a damper of 0.1 N m s/rad for a second [1 rad/s at `hz`], then stand still.

    Its velocity is behind a low-pass of `filter_hz`, and its torque is a `share` of what it ought
    to be. Return its books, what it took, and whether they found that it lacks.
    """
    tau, fine, w = 1.0 / (math.tau * filter_hz), 20, math.tau * hz
    books, place, y, taken = DamperBooks(0.1, tau, steps, 1e-3), 0.0, 0.0, 0.0
    lacks = False
    for at in range(2000 * fine):
        if at % fine == 0:
            books.take(math.floor(place / steps[0] + 0.5) * steps[0], -share * 0.1 * y)
            lacks = lacks or (at > 0 and at % (500 * fine) == 0 and books.lacks())
        h = 1e-3 / fine
        v = math.sin(w * (at + 0.5) * h) if at < 1000 * fine else 0.0
        before = y
        y = v + (y - v) * math.exp(-h / tau)
        taken += share * 0.1 * (v * v * h + (before - y) * tau * v)  # y over h, exactly
        place += v * h
    return books, taken, lacks


@pytest.mark.parametrize("filter_hz", [10.0, 30.0, 500.0])
@pytest.mark.parametrize("hz", [2.0, 10.0, 25.0, 50.0])
def test_a_healthy_damper_takes_the_least_whatever_its_filter(hz: float, filter_hz: float) -> None:
    books, taken, lacks = filtered(hz, filter_hz)
    assert not lacks
    assert books.least <= taken
    assert books.absorbed == pytest.approx(taken, rel=0.1)
    if hz <= 10.0:
        assert books.least > 0.9 * taken


def test_a_slow_filter_lowers_the_least() -> None:
    """To 1 / (1 + (10/30)^2) and 1 / (1 + (10/500)^2), the real part of a low-pass."""
    slow, quick = (filtered(10.0, filter_hz)[0].least for filter_hz in (30.0, 500.0))
    assert slow / quick == pytest.approx(0.9, abs=0.02)


@pytest.mark.parametrize("filter_hz", [30.0, 500.0])
def test_one_that_gives_a_fifth_lacks(filter_hz: float) -> None:
    assert filtered(5.0, filter_hz, share=0.2)[2]


def test_a_position_that_flickers_by_a_step_is_no_motion() -> None:
    books = DamperBooks(5.0, 1.0 / (math.tau * 500.0), (4e-4, 1e-6), 1e-3)
    books.take(0.0, 0.0)
    for _ in range(50):  # a way is of 8 periods, and ends with a step
        for at in range(8):
            books.take(4e-4 if at == 7 else 0.0, 0.0)
        assert books.least <= 0.0
        assert not books.lacks()


def test_books_without_a_sample_count_nothing_over_the_gap() -> None:
    books = DamperBooks(0.5, 1e-5, (1e-4, 1e-3), 1e-3)
    for at in range(9):
        books.take(1e-3 * at, -0.5)
    least = books.least
    assert books.absorbed == pytest.approx(0.5 * 8e-3)
    assert least == pytest.approx(0.5 * 7.9e-3**2 / 8e-3, rel=0.01)
    books.miss()
    for _ in range(9):
        books.take(1.0, -0.5)
    assert books.least <= least
    assert not books.lacks()


def test_a_filter_follows_while_it_does_not_damp() -> None:
    """Where it begins to damp in motion the filter is full: what is in it comes back."""
    books = DamperBooks(0.1, 5e-3, STEPS, 1e-3)
    for at in range(101):
        books.take(5e-3 * at, math.nan if at < 60 else -0.5)
    assert books.absorbed == pytest.approx(0.5 * 0.2, rel=1e-9)
    assert books.least == pytest.approx(0.5 * 0.2, rel=0.01)


def test_a_spec_without_velocity_limit_has_no_torque_to_spare() -> None:
    options = block(motor(1, damping=0.1, velocity_filter_hz=100.0))
    bus = bus_of(options)
    endless = AxisSpec("master.a1", 1, "rotary", "impedance", 1.0)
    with pytest.raises(ConfigError, match="where its damper would fail"):
        motors_of(driver_options(options), bus._replace(axes=(endless,)))


def pressed(rig: Rig) -> None:
    """Bring up motors that are pushed against and move, all damped."""
    rig.up()
    rig.run(30, 0.4)


def kinetic_change(rig: Rig, at: int) -> float:
    """Return what a simulated motor does to itself in ten slots of its own [J]."""
    axis = rig.motors[at].axis
    axis.physics.v = 1.0
    before = axis.physics.motor_work
    for _ in range(10):
        rig.motors[at].pass_slot()
    return float(axis.physics.motor_work - before)


MORE: dict[str, Any] = {"mass": 0.02, "watchdog_s": 0.02}


def test_a_watchdog_that_fires_in_contact_leaves_neither_effort_nor_damper() -> None:
    rig = simulated(motor(1, **DAMPED), motor(2, **DAMPED), **MORE)
    pressed(rig)
    assert rig.motors[0]._order[3] > 0.29
    rig.clock.sleep_until(rig.clock.now_ns() + 40_000_000)  # the host stalls
    rig.line.advance(rig.clock.now_ns())
    for at, one in enumerate(rig.motors):
        assert (one.state, one.torque, one._order) == (13, 0.0, (0.0,) * 5)
        assert kinetic_change(rig, at) == 0.0
    _, faults = rig.run(2, 0.4)
    assert ["no command in time" in fault.text for fault in faults] == [True, True]
    rig.driver.close()
    assert not rig.driver.unconfirmed


def test_one_that_falls_silent_in_contact_leaves_the_other_damped() -> None:
    quirks = {"motors": {"1": {"silent_at_s": 0.02}}}
    rig = simulated(motor(1, **DAMPED), motor(2, **DAMPED), simulator=quirks, **MORE)
    pressed(rig)
    rows, faults = rig.run(3, 0.4)
    assert [state.valid for state in rows[-1]] == [False, True]
    assert not faults  # the loop counts missing samples, and says which axis
    assert "master.a1" not in rig.driver.misses  # nothing came in its place
    assert (rig.motors[0].torque, kinetic_change(rig, 0)) == (0.0, 0.0)
    assert kinetic_change(rig, 1) < 0.5 * 0.4 * 0.01  # half of what its effort alone would do
    rig.driver.close()
    assert list(rig.driver.unconfirmed) == ["master.a1"]


def test_another_master_that_polls_changes_no_damper() -> None:
    rig = foreign(motor(1, **DAMPED), mass=0.02)
    rig.up()
    rig.run(10, 0.4)
    for _ in range(20):
        rig.line.other_master(0x7FF, bytes.fromhex("0100cc0000000000"))
        (state,) = rig.cycle(0.4)
        assert not state.valid or abs(state.position) < 0.1
        assert rig.motors[0].kd == pytest.approx(0.3, abs=1e-3)
    assert not rig.driver.faults()
    rig.driver.close()


def test_a_supply_that_dips_in_contact_ends_with_everything_off() -> None:
    quirks = {"motors": {"1": {"restarts_at_s": 0.02}}}
    rig = simulated(motor(1, **DAMPED), simulator=quirks, **MORE)
    rig.up()
    _, faults = rig.run(40, 0.4)
    assert "it was switched off and on" in faults[0].text
    one = rig.motors[0]
    assert (one.state, one.registers.whole(9), kinetic_change(rig, 0)) == (0, 0, 0.0)
    rig.driver.close()


def test_a_turn_that_is_lost_moves_no_damper() -> None:
    """The position is taken back by it; a damper has no place."""
    quirks = {"motors": {"1": {"turns": 1}}}
    rig = simulated(motor(1, **DAMPED), simulator=quirks, **MORE)
    rig.up()
    rows, faults = rig.run(20, 0.0)
    assert not faults
    assert abs(rows[-1][0].position) < 2e-3
    assert any("taken for -1 turns further" in note for note in rig.driver.notes)
    assert abs(rig.motors[0].torque) < 5e-3
    assert kinetic_change(rig, 0) < 0.0
    rig.driver.close()
