"""What a Feetech servo has to be before torque: each fault with its sentence, and nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import pytest

from tautwave.errors import ConfigError, DeviceFault, DriverError, SettingsDifferError
from tests.drivers.feetech.benches import Rig, foreign, servo
from tests.foreign.feetech_line import ALL, SYNC_WRITE, Servo, frame


def late_twin(rig: Rig) -> None:
    rig.line.servos.append(Servo(1, registers={7: 100}))


def equal_twin(rig: Rig) -> None:
    rig.line.servos.append(Servo(1))


def second_id(rig: Rig) -> None:
    rig.line.servos.append(Servo(9, registers={7: 1}))


def silent(rig: Rig) -> None:
    rig.servos[1].mute = True


def overheated(rig: Rig) -> None:
    rig.servos[1].status = 4


def stuck_on(rig: Rig) -> None:
    rig.servos[0].memory[40] = 1
    rig.servos[0].stubborn = True


def other_supply(rig: Rig) -> None:
    for one in rig.servos:
        one.volts = 5.0


REFUSED: dict[str, tuple[str, dict[str, Any], Callable[[Rig], None] | None, str]] = {
    "another model": ("HLS", {"registers": {4: 14}}, None, "reports unknown model 10.14 (model "),
    "firmware of the other table": (
        "HLS", {"registers": {1: 10}}, None, "firmware 3.10 has the table of STS",
    ),
    "SCS": ("HLS", {"registers": {0: 0, 1: 9, 2: 1}}, None, "is an SCS servo: no axis runs on it"),
    "unknown firmware": ("HLS", {"registers": {1: 77}}, None, "is a servo of unknown table"),
    "offset of another program": ("HLS", {"registers": {31: 100}}, None, "offset(31) 100 -> 0"),
    "many turns": ("STS", {"registers": {18: 0x10}}, None, "phase(18) 16 -> 0"),
    "silent": ("HLS", {}, silent, "master.a2 (bus servos, servo 2): no answer at 1000000 baud"),
    "overheated": ("HLS", {}, overheated, "master.a2 (bus servos, servo 2): overheated"),
    "stays on": ("HLS", {}, stuck_on, "torque(40) reads 1 after 0 was written"),
    "twin that answers later": ("STS", {}, late_twin, "two servos answer as id 1"),
    "twin that garbles": ("HLS", {"registers": {7: 0xFF, 13: 1}}, equal_twin, "servo 1): "),
    "second id": ("HLS", {}, second_id, "servo 9 obeys id 1 too (its second id(7))"),
    "supply": ("STS", {}, other_supply, "its supply reads 5.0 V, but the rig is for 7.4 V"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_is_not_as_the_rig_states_is_refused_with_torque_off(name: str) -> None:
    kind, more, blow, words = REFUSED[name]
    rig = foreign(servo(1, kind), servo(2, kind), **more)
    if blow is not None:
        blow(rig)
    with pytest.raises(DriverError) as told:
        rig.up()
    assert words in str(told.value)
    rig.driver.close()
    assert all(one.memory[40] == 0 or one.stubborn for one in rig.line.servos)
    assert not any(one.came_on for one in rig.line.servos)


def test_without_the_permission_nothing_is_switched_on() -> None:
    rig = foreign(servo(1), bus={"allow_unwatched": False})
    with pytest.raises(DriverError, match=r"has no watchdog.*--allow-unwatched"):
        rig.driver.open()
    assert not rig.servos[0].came_on


@pytest.mark.parametrize("text", ["", "  "])
def test_a_rig_without_a_way_to_cut_the_power_is_refused_before_any_wire(text: str) -> None:
    with pytest.raises(ConfigError, match="write how a person cuts their power"):
        foreign(servo(1), power_cut=text)


def test_what_new_writes_for_it_is_refused_at_the_start() -> None:
    rig = foreign(servo(1), power_cut="TODO")
    with pytest.raises(DriverError, match="power_cut still says TODO"):
        rig.driver.open()
    assert not any(code == 3 and address[:1] == b"\x28" for _, code, address in rig.line.sent[:-2])


@pytest.mark.parametrize("echoes", [False, True])
def test_another_master_is_noticed_before_a_byte_is_sent(echoes: bool) -> None:
    rig = foreign(servo(1))
    rig.line.echoes = echoes
    rig.line.say(frame(ALL, SYNC_WRITE, bytes((44, 2, 1, 16, 0))))
    with pytest.raises(DriverError, match="another master is at work on this line"):
        rig.driver.open()
    assert not rig.line.sent


def test_an_echo_is_told_from_answers_and_said() -> None:
    rig = foreign(servo(1), servo(2, "STS"))
    rig.line.echoes = True
    rig.servos[0].status = 0
    rig.up()
    assert any("returns what it sends" in note for note in rig.driver.notes)
    rows, faults = rig.run(20, effort=0.2)
    assert not faults
    assert all(state.valid for row in rows for state in row)
    rig.driver.close()
    assert not rig.driver.unconfirmed


@pytest.mark.parametrize("kind", ["STS", "HLS"])
def test_nothing_is_written_for_good_and_a_stale_goal_does_not_act(kind: str) -> None:
    rig = foreign(servo(1, kind), registers={33: 1, 28: 1, 38: 3})
    one = rig.servos[0]
    before = dict(one.eeprom)
    one.memory[44:46] = b"\xff\x01"  # of another program
    rig.up()
    assert one.came_on == [(2, 0)]
    rig.driver.close()
    assert one.eeprom == before
    one.start()
    assert one.memory[33] == 1


def test_with_configure_an_offset_is_written_once_and_locked_again() -> None:
    rig = foreign(servo(1), registers={31: 100}, bus={"configure": True})
    rig.up()
    one = rig.servos[0]
    assert (one.eeprom[31], one.memory[55]) == (0, 1)
    assert any("offset(31) 100 -> 0" in note for note in rig.driver.notes)
    rig.driver.close()


def test_without_configure_all_that_differs_is_listed_at_once() -> None:
    rig = foreign(servo(1), registers={31: 5, 18: 0x10})
    with pytest.raises(SettingsDifferError) as told:
        rig.driver.open()
    assert "offset(31) 5 -> 0" in str(told.value)
    assert "phase(18) 16 -> 0" in str(told.value)


def test_an_offset_of_the_rig_is_that_of_the_servo_sign_and_magnitude() -> None:
    rig = foreign(servo(1, "STS", offset=-300), registers={31: 300 & 0xFF, 32: 0x09})
    rig.up()
    rig.driver.close()


def test_a_servo_that_forgets_between_bring_up_and_torque_is_not_switched_on() -> None:
    """It is in position mode then, and would go to a goal that nobody gave."""
    for after in range(0, 40, 3):
        rig = foreign(servo(1), servo(2))
        rig.driver.open()
        count = 0

        def strike(rig: Rig = rig, after: int = after) -> None:
            nonlocal count
            count += 1
            if count == after:
                rig.servos[1].cut_power(rig.clock.now_ns(), 1_000_000)

        rig.line.on_instruction = strike
        with suppress(DeviceFault):
            rig.enable()
            rig.run(20)
        assert all(came == (2, 0) for came in rig.servos[1].came_on)
        rig.driver.close()


def test_a_follower_holds_where_it_stands_with_its_limits() -> None:
    rig = foreign(servo(1, "STS"), servo(2), bus={"follows": (1, 2)})
    for one in rig.servos:
        one.x = 0.3
    rig.up()
    sts, hls = rig.servos
    held = 2048 + round(0.3 / 0.0015339807878856412)
    assert (sts.word(42, 15), hls.word(42, 15)) == (held, held)
    assert sts.word(48, 15) == pytest.approx(1000 / (1.21 * 7.4 / 2.68), abs=1)  # of 1 N m
    assert hls.word(44, 15) == int(1.0 / (6.5e-3 * 0.814))
    assert sts.word(46, 15) > 0
    _, faults = rig.run(20, position=-0.2)
    assert not faults
    assert sts.word(42, 15) == hls.word(42, 15) == 2048 - 130
    rig.driver.close()
    assert not rig.driver.unconfirmed
