"""In a run: whose frames are feedback, what a motor forgot, what comes late, what ends."""

from __future__ import annotations

import math

import pytest

from tautwave.errors import DeviceFault, DriverError
from tests.drivers.mit.benches import foreign, motor, simulated
from tests.foreign import mit_motors as m


def test_a_command_acts_one_period_after_it_was_written() -> None:
    rig = simulated(motor(1), mass=1e-4)
    rig.up()
    rows, faults = rig.run(6, 0.5)
    moved = [row[0].position for row in rows]
    steps = [at for at in range(1, 6) if moved[at] - moved[0] > 1e-3]
    assert steps[0] == 2  # written in cycle 0, sent in 1, seen from 2 on
    assert not faults
    rig.driver.close()


def test_torque_velocity_and_temperatures_are_those_of_the_motor() -> None:
    rig = foreign(motor(1, direction=-1), mass=0.1)
    rig.up()
    rows, _ = rig.run(50, 0.5)
    row = [0.0] * 3
    rig.driver.fill(row, 0)
    assert rig.driver.columns == [
        "master.a1.motor_effort",
        "master.a1.driver_temperature",
        "master.a1.rotor_temperature",
    ]
    assert row[0] == pytest.approx(0.5, abs=0.01)
    assert row[1:] == [31.0, 42.0]
    assert rows[-1][0].velocity == pytest.approx(-rig.motors[0].speed, abs=0.03)
    assert rows[-1][0].position > 0.0 > rig.motors[0].x
    rig.driver.close()


@pytest.mark.parametrize(
    ("can_id", "text"),
    [
        (0x7FF, "0100cc0000000000"),  # a poll: the motor answers to it, once more
        (0x7FF, "0100331500000000"),  # a read
        (0x7FF, "0100550a01000000"),  # a write to CTRL_MODE, as it is
        (0x011, "0100550a01000000"),  # its echo alone
        (0x012, "127ac777199333a6"),  # another motor's feedback
        (0x011, "127ac777199333a6"),  # on this id, of another nibble
    ],
)
def test_another_master_is_never_taken_for_feedback(can_id: int, text: str) -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.run(3)
    for _ in range(20):
        rig.line.other_master(can_id, bytes.fromhex(text))
        (state,) = rig.cycle()
        assert not state.valid or state.position == pytest.approx(0.0, abs=1e-3)
    assert rig.cycle()[0].valid
    assert not rig.driver.faults()
    rig.driver.close()


def test_a_motor_that_was_switched_off_and_on_is_not_driven_on() -> None:
    rig = foreign(motor(1), motor(2))
    rig.up()
    rig.run(10, 0.2)
    rig.motors[0].power_up()
    rows, faults = rig.run(3, 0.2)
    assert [fault.axis for fault in faults] == ["master.a1"]
    assert faults[0].fatal
    assert "disabled: it was switched off and on" in faults[0].text
    assert not rows[-1][0].valid
    assert rows[-1][1].valid
    rig.driver.close()


@pytest.mark.parametrize(("state", "words"), [(9, "under-voltage"), (12, "rotor is too hot")])
def test_an_error_stops_the_axis_in_words(state: int, words: str) -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.motors[0].state, rig.motors[0].torque = state, 0.0
    _, faults = rig.run(3)
    assert len(faults) == 1
    assert words in faults[0].text
    rig.driver.close()


def test_a_host_that_stalls_finds_the_watchdog_tripped() -> None:
    rig = foreign(motor(1), watchdog_s=0.05)
    rig.up()
    rig.run(5, 0.3)
    rig.clock.sleep_until(rig.clock.now_ns() + 60_000_000)
    rig.line.advance(rig.clock.now_ns())
    assert (rig.motors[0].state, rig.motors[0].torque) == (13, 0.0)
    _, faults = rig.run(2, 0.3)
    assert "no command in time" in faults[0].text
    rig.driver.close()
    assert not rig.driver.unconfirmed


def test_a_motor_that_forgot_before_it_was_enabled_is_refused() -> None:
    rig = foreign(motor(1))
    rig.driver.open()
    rig.motors[0].power_up()  # its TIMEOUT is 0 again, and it would be enabled unwatched
    with pytest.raises(DeviceFault, match=r"(TIMEOUT|CTRL_MODE)\(\d+\) reads"):
        rig.enable()
    rig.driver.close()
    assert rig.motors[0].state == 0


def test_an_error_while_enabling_is_said() -> None:
    rig = foreign(motor(1))
    rig.driver.open()
    rig.motors[0].state = 8
    with pytest.raises(DeviceFault, match="over-voltage"):
        rig.enable()
    rig.driver.close()


def test_a_motor_that_stays_off_is_said() -> None:
    rig = foreign(motor(1), motor(2))
    rig.driver.open()
    rig.motors[1].powered = False
    with pytest.raises(DriverError, match=r"master\.a2 \(motor 2"):
        rig.enable()
    rig.driver.close()


def test_watchdogs_are_fed_while_other_buses_are_enabled() -> None:
    rig = foreign(motor(1), watchdog_s=0.01)
    rig.up()
    for _ in range(200):
        rig.driver.enable_step()
        rig.clock.sleep_until(rig.clock.now_ns() + rig.bus.period_ns)
    assert rig.motors[0].state == 1
    rig.driver.close()


def test_a_lost_answer_costs_its_cycle_and_its_axis_alone() -> None:
    rig = foreign(motor(1), motor(2))
    rig.up()
    rig.run(5)
    rig.motors[0].mute = 1
    rows, faults = rig.run(3)
    assert [[state.valid for state in row] for row in rows] == [[False, True]] + [[True] * 2] * 2
    assert not faults
    rig.driver.close()


def test_a_late_answer_is_dropped_and_costs_one_cycle() -> None:
    rig = foreign(motor(1), motor(2), mass=0.001)
    rig.up()
    rig.run(20, 0.3)
    rig.line.later_ns[17] = [700_000]  # after the deadline, before the next request
    valid = [[state.valid for state in rig.cycle(0.3)] for _ in range(4)]
    assert valid == [[False, True]] + [[True, True]] * 3
    rig.driver.close()


def test_an_answer_that_comes_sooner_than_the_wire_allows_is_an_older_one() -> None:
    rig = foreign(motor(1), mass=0.001)
    rig.up()
    rig.run(20, 0.3)
    rig.line.later_ns[17] = [800_000]  # 50 us after the next request
    before = rig.cycle(0.3)[0]
    after = rig.cycle(0.3)[0]
    assert not before.valid
    assert after.valid
    assert after.age_ns < 1_000_000
    assert after.position == pytest.approx(rig.motors[0].x, abs=5e-3)
    rig.driver.close()


@pytest.mark.parametrize("way", ["disable", "close"])
def test_a_motor_that_stays_on_is_named(way: str) -> None:
    rig = foreign(motor(1), motor(2))
    rig.up()
    rig.run(3, 0.3)
    stubborn, hear = rig.motors[1], rig.motors[1].hear
    stubborn.hear = lambda can_id, data: (
        stubborn._say() if can_id == 2 and data[-1] == 0xFD else hear(can_id, data)
    )
    getattr(rig.driver, way)()
    assert set(rig.driver.unconfirmed) == {"master.a2"}
    assert "still says enabled after disable" in rig.driver.unconfirmed["master.a2"]
    assert abs(stubborn.torque) < 3e-3  # it has been told zero torque
    assert rig.motors[0].state == 0


def test_a_disable_that_was_lost_is_sent_again() -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.run(3, 0.3)
    rig.motors[0].mute = 2
    rig.driver.disable()
    assert not rig.driver.unconfirmed
    rig.driver.close()


@pytest.mark.parametrize("late_ms", [5, 31, 45, 75, 95, 300])
def test_motors_are_known_to_be_off_however_late_their_answers_come(late_ms: int) -> None:
    """Meanwhile answers to older commands say that they are enabled."""
    rig = foreign(motor(1), motor(2))
    rig.up()
    rig.run(3, 0.3)
    for answers in (17, 18):
        rig.line.later_ns[answers] = [late_ms * 1_000_000] * 10_000
    rig.run(late_ms + 5, 0.3)  # whose samples are all late
    rig.driver.disable()
    rig.clock.sleep_until(rig.clock.now_ns() + 30_000_000)  # another bus is left as well
    rig.driver.close()
    assert [one.state for one in rig.motors] == [0, 0]
    assert not rig.driver.unconfirmed


def test_the_last_frame_before_disable_is_zero_torque() -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.run(5, 0.5)
    rig.driver.close()
    last = [data for data in rig.motors[0].log if data[:7] != bytes((0xFF,) * 7)][-1]
    assert last[-2:] in (b"\x07\xff", b"\x08\x00")


def test_nan_is_torque_zero() -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.run(5, math.nan)
    assert abs(rig.motors[0].torque) < 3e-3
    rig.driver.close()


def test_a_bus_that_is_gone_is_said_once_and_the_motors_are_named() -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.run(3)

    def gone(can_id: int, data: bytes) -> bool:
        raise DriverError("CAN interface can0 is down or gone")

    rig.line.send = gone
    _, faults = rig.run(5)
    assert [fault.text for fault in faults] == ["CAN interface can0 is down or gone"]
    rig.driver.close()
    assert "down or gone" in rig.driver.unconfirmed["master.a1"]


def test_a_queue_that_stays_full_is_a_dead_bus() -> None:
    rig = foreign(motor(1))
    rig.up()
    rig.run(3)
    rig.line.send = lambda can_id, data: False
    _, faults = rig.run(12)
    (dead,) = [fault.text for fault in faults if "dead bus" in fault.text and fault.fatal]
    assert "bit rate (here 1000000)" in dead
    rig.driver.close()


def test_a_register_of_the_foreign_motor_is_as_the_manual_numbers_it() -> None:
    assert (m.MST, m.ESC, m.TIMEOUT, m.MODE, m.P, m.V, m.T) == (7, 8, 9, 10, 21, 22, 23)


@pytest.mark.parametrize(
    ("rate_hz", "more"),
    [(400.0, {}), (420.0, {}), (1000.0, {"data_bitrate": 5_000_000})],
    ids=["classic 400", "classic 420", "fd 1000"],
)
def test_seven_joints_miss_no_sample_at_the_rate_that_the_budget_allows(
    rate_hz: float, more: dict[str, int]
) -> None:
    rig = simulated(*(motor(number) for number in range(1, 8)), rate_hz=rate_hz, **more)
    rig.up()
    rows, faults = rig.run(60, 0.2)
    assert all(state.valid for row in rows for state in row)
    assert not faults
    rig.driver.close()
    assert not rig.driver.unconfirmed


def test_beyond_that_rate_samples_go_missing_on_the_same_wire() -> None:
    rig = simulated(*(motor(number) for number in range(1, 8)), rate_hz=560.0)
    rig.up()
    rows, _ = rig.run(60, 0.2)
    assert not all(row[-1].valid for row in rows)
    rig.driver.close()
