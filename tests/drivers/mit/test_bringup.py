"""Before torque: what is set is read back, what is not as the rig says is refused by name."""

from __future__ import annotations

import math

import pytest

from tautwave.errors import DeviceFault, DriverError
from tests.drivers.mit.benches import foreign, motor
from tests.foreign import mit_motors as m


def refused(match: str, kind: type[DriverError] = DriverError, **more: object) -> None:
    rig = foreign(motor(1), motor(2), **more)  # type: ignore[arg-type]
    with pytest.raises(kind, match=match):
        rig.driver.open()
    assert all(one.torque == 0.0 and one.state != 1 for one in rig.motors)


def test_all_is_set_and_read_back_and_nothing_is_saved() -> None:
    rig = foreign(motor(1), motor(2), watchdog_s=0.05)
    rig.driver.open()
    for one in rig.motors:
        assert (one.ram[m.MODE], one.ram[m.TIMEOUT], one.state) == (1, 1000, 0)
        assert (one.saved[m.MODE], one.saved[m.TIMEOUT]) == (2, 0)
    assert rig.driver.watchdog_s == {"master.a1": 0.05, "master.a2": 0.05}
    assert rig.driver.identities["master.a1"]["firmware"] == "5013.2"
    assert rig.driver.identities["master.a1"]["gear_ratio"] == "10"
    notes = " ".join(rig.driver.notes)
    assert "TIMEOUT(9) = 1000, read back" in notes
    assert "CTRL_MODE(10) 2 -> 1 written and read back" in notes


@pytest.mark.parametrize(
    ("register", "key"), [(m.P, "p_max: 3.1416"), (m.V, "v_max: 3.1416"), (m.T, "t_max: 3.1416")]
)
def test_a_range_that_is_another_is_refused(register: int, key: str) -> None:
    refused(f"write {key}", registers={register: 3.1416})


@pytest.mark.parametrize("wild", [math.nan, math.inf, 0.0, -12.5])
def test_a_range_that_is_no_range_is_refused(wild: float) -> None:
    refused("PMAX", registers={m.P: wild})


def test_a_motor_without_a_watchdog_is_refused_or_named() -> None:
    rig = foreign(motor(1))
    rig.motors[0].deaf_registers.add(m.TIMEOUT)
    with pytest.raises(DriverError, match=r"TIMEOUT\(9\) reads 0 after 2000 was written"):
        rig.driver.open()
    rig = foreign(motor(1), bus={"allow_unwatched": True})
    rig.motors[0].deaf_registers.add(m.TIMEOUT)
    rig.up()
    assert "keeps its last torque" in rig.driver.unwatched["master.a1"]
    assert rig.driver.watchdog_s == {}
    rig.driver.close()


def test_a_motor_that_stays_in_another_mode_is_refused() -> None:
    rig = foreign(motor(1))
    rig.motors[0].deaf_registers.add(m.MODE)
    with pytest.raises(DriverError, match=r"CTRL_MODE\(10\) reads 2 after 1 was written"):
        rig.driver.open()


def test_who_is_silent_is_said_and_who_answered() -> None:
    rig = foreign(motor(1), motor(2))
    rig.motors[1].powered = False
    with pytest.raises(DriverError, match=r"from master\.a2 \(motor 2\); master\.a1 \(motor 1\) a"):
        rig.driver.open()


def test_an_answer_with_id_0_is_refused_with_the_remedy() -> None:
    refused(r"answers with id 0.*MST_ID \(register 7\) to 0x11", registers={m.MST: 0})


@pytest.mark.parametrize("feedback_id", [17, 0x55])
def test_two_motors_of_one_id_are_refused_whatever_they_answer_with(feedback_id: int) -> None:
    rig = foreign(motor(1))
    rig.motors.append(m.ForeignMotor(1, feedback_id, 1.0, {}))
    with pytest.raises(DriverError, match=f"2 motors answer to this id .*{feedback_id:#x}"):
        rig.driver.open()


def test_classic_answers_on_a_bus_of_fd_are_said() -> None:
    rig = foreign(motor(1), motor(2), data_bitrate=5_000_000)
    rig.line.classic_ids.add(18)
    with pytest.raises(
        DriverError, match=r"master\.a2 \(motor 2\) answered in classic CAN.*can_br"
    ):
        rig.driver.open()


@pytest.mark.parametrize("state", [8, 9, 10, 11, 12, 14])
def test_an_error_is_refused_or_cleared_where_that_is_asked_for(state: int) -> None:
    rig = foreign(motor(1))
    rig.motors[0].state = state
    with pytest.raises(DeviceFault, match="clear_errors: true"):
        rig.driver.open()
    rig = foreign(motor(1), clear_errors=True)
    rig.motors[0].state = state
    rig.up()
    assert rig.motors[0].state == 1
    assert any("; cleared" in note for note in rig.driver.notes)
    rig.driver.close()


def test_a_watchdog_that_had_tripped_is_cleared_and_said() -> None:
    rig = foreign(motor(1))
    rig.motors[0].state = 13
    rig.up()
    assert any("no command in time; cleared" in note for note in rig.driver.notes)
    rig.driver.close()


@pytest.mark.parametrize("turns", [1, -1])
def test_lost_turns_are_taken_back_where_the_range_tells(turns: int) -> None:
    rig = foreign(motor(1), motor(2, direction=-1, zero=0.3))
    rig.motors[1].x = 0.3
    for one in rig.motors:
        one.turns = turns
        one.x += 0.5
    rig.up()
    states = rig.cycle()
    assert states[0].position == pytest.approx(0.5, abs=1e-3)
    assert states[1].position == pytest.approx(-0.5, abs=1e-3)
    assert sum("counts one turn only" in note for note in rig.driver.notes) == 2
    rig.driver.close()


@pytest.mark.parametrize(("most", "doubted"), [(3.1, 0), (7.0, 1)])
def test_turns_that_a_range_leaves_open_are_said(most: float, doubted: int) -> None:
    rig = foreign(motor(1), bus={"position_range": (-most, most)})
    rig.motors[0].x = 0.5
    rig.up()
    said = [note for note in rig.driver.notes if "loses whole turns" in note]
    assert len(said) == doubted
    assert all("also holds -5.783 or 6.783" in note for note in said)
    rig.driver.close()


def test_a_place_that_no_turn_explains_is_refused() -> None:
    rig = foreign(motor(1))
    rig.motors[0].x = 3.1
    with pytest.raises(DriverError, match="no whole number of turns is inside"):
        rig.driver.open()


def test_lost_answers_about_registers_are_asked_again() -> None:
    rig = foreign(motor(1))
    one, heard = rig.motors[0], rig.motors[0]._register
    count = iter(range(10_000))
    one._register = lambda data: [] if next(count) % 3 == 1 else heard(data)
    rig.up()
    rig.driver.close()


def test_answers_that_others_asked_for_are_not_taken_for_another_register() -> None:
    rig = foreign(motor(1))
    read = rig.motors[0]._register
    echo = bytes.fromhex("0100550a01000000")
    rig.motors[0]._register = lambda data: [(17, echo), *read(data)]
    rig.up()
    assert rig.cycle()[0].position == pytest.approx(0.0, abs=1e-3)
    rig.driver.close()
