"""Access rules and error codes of the status packet, each by a write or read that earns it."""

from __future__ import annotations

import pytest

from tautwave_sim.dynamixel import packets as p2
from tests.sim.dynamixel.line import Host, split, words


@pytest.fixture
def host() -> Host:
    return Host((1, 2))


def test_result_fail_when_clearing_turns_in_motion(host: Host) -> None:
    host.write(1, "Operating Mode", 1)
    host.write(1, "Torque Enable", 1)
    host.write(1, "Goal Velocity", 100)
    host.pass_time(0.5)
    assert host.error(1, p2.CLEAR, *b"\x01DXL\x22") == p2.RESULT_FAIL
    host.write(1, "Goal Velocity", 0)
    host.pass_time(0.5)
    assert host.error(1, p2.CLEAR, *b"\x01DXL\x22") == 0
    assert 0 <= host.read(1, "Present Position") < 4096


def test_clear_takes_whole_turns_away() -> None:
    host = Host((1,), counts=(3 * 4096 + 100,))
    assert host.read(1, "Present Position") == 3 * 4096 + 100
    assert host.error(1, p2.CLEAR, *b"\x01DXL\x23") == p2.RANGE_ERROR
    assert host.error(1, p2.CLEAR, *b"\x01DXL\x22") == 0
    assert host.read(1, "Present Position") == 100


def test_instruction_error(host: Host) -> None:
    assert host.error(1, 0x42) == p2.INSTRUCTION_ERROR
    assert host.error(1, p2.ACTION) == p2.INSTRUCTION_ERROR
    assert host.error(1, 0x20) == p2.INSTRUCTION_ERROR
    assert host.error(1, p2.SYNC_READ, 132, 0, 4, 0, 1) == p2.INSTRUCTION_ERROR


def test_crc_error(host: Host) -> None:
    sent = bytearray(p2.frame(1, b"\x02\x84\x00\x04\x00"))
    sent[-1] ^= 1
    assert host.talk(bytes(sent)) == p2.status(1, p2.CRC_ERROR)
    assert host.read(1, "Present Position") == 2048


@pytest.mark.parametrize(
    ("name", "value"),
    [("LED", 2), ("Status Return Level", 3), ("Bus Watchdog", 128), ("ID", 253), ("Baud Rate", 8)],
)
def test_range_error(host: Host, name: str, value: int) -> None:
    before = host.read(1, name)
    assert host.write(1, name, value) == p2.RANGE_ERROR
    assert host.read(1, name) == before


@pytest.mark.parametrize("mode", [2, 6, 15])
def test_a_mode_that_is_none(host: Host, mode: int) -> None:
    assert host.write(1, "Operating Mode", mode) == p2.RANGE_ERROR


def test_a_servo_without_current_has_no_current_mode() -> None:
    host = Host((1,), "XL430-W250")
    assert host.write(1, "Operating Mode", 0) == p2.RANGE_ERROR
    assert host.write(1, "Operating Mode", 5) == p2.RANGE_ERROR
    assert host.error(1, p2.WRITE, 102, 0, 1, 0) == p2.ACCESS_ERROR


@pytest.mark.parametrize(
    "params",
    [
        (),
        (116,),
        (116, 0),
        (116, 0, 1, 2),  # two bytes of four
        (118, 0, 1, 2),  # the last two of four
        (116, 0, 1, 0, 0, 0, 0, 0),
    ],
)
def test_length_error(host: Host, params: tuple[int, ...]) -> None:
    error = host.error(1, p2.WRITE, *params)
    assert error in (p2.LENGTH_ERROR, p2.ACCESS_ERROR if len(params) == 8 else p2.LENGTH_ERROR)
    assert host.read(1, "Goal Position") == 0


def test_length_error_of_a_read(host: Host) -> None:
    assert host.error(1, p2.READ, 132, 0) == p2.LENGTH_ERROR
    assert host.error(1, p2.READ, 132, 0, 4, 0, 0) == p2.LENGTH_ERROR


def test_limit_error(host: Host) -> None:
    host.write(1, "Operating Mode", 0)
    host.write(1, "Current Limit", 100)
    assert host.write(1, "Goal Current", 100) == 0
    assert host.write(1, "Goal Current", -101) == p2.LIMIT_ERROR
    assert host.write(1, "Goal Velocity", 201) == p2.LIMIT_ERROR
    assert host.read(1, "Goal Current") == 100


def test_positions_are_limited_in_position_mode_only(host: Host) -> None:
    host.write(1, "Max Position Limit", 3000)
    assert host.write(1, "Goal Position", 3001) == p2.LIMIT_ERROR
    assert host.write(1, "Goal Position", -1) == p2.LIMIT_ERROR
    host.write(1, "Operating Mode", 4)
    assert host.write(1, "Goal Position", -100_000) == 0


@pytest.mark.parametrize("address", [0, 6, 70, 126, 132, 14, 66, 662, 5000])
def test_access_error_read_only_or_undefined(host: Host, address: int) -> None:
    assert host.error(1, p2.WRITE, *words(address), 1) == p2.ACCESS_ERROR


@pytest.mark.parametrize(("address", "size"), [(14, 2), (660, 3), (5000, 1), (132, 0)])
def test_access_error_of_a_read(host: Host, address: int, size: int) -> None:
    response = host.ask(1, p2.READ, *words(address), *words(size))
    assert response == p2.status(1, p2.ACCESS_ERROR)


def test_a_read_may_cross_what_is_empty(host: Host) -> None:
    response = host.ask(1, p2.READ, 0, 0, 147, 0)
    assert len(response) == 11 + 147
    assert response[9:11] == b"\xfc\x03"


def test_the_eeprom_is_locked_while_the_torque_is_on(host: Host) -> None:
    assert host.write(1, "Current Limit", 500) == 0
    host.write(1, "Torque Enable", 1)
    for name in ("ID", "Operating Mode", "Current Limit", "Return Delay Time", "Shutdown"):
        assert host.write(1, name, 3) == p2.ACCESS_ERROR
    assert host.write(1, "LED", 1) == 0
    host.write(1, "Torque Enable", 0)
    assert host.write(1, "Current Limit", 400) == 0


def test_one_refusal_refuses_all(host: Host) -> None:
    host.write(1, "Operating Mode", 0)
    goal_current_and_velocity = (102, 0, 10, 0, 0, 0, 0, 1)
    assert host.error(1, p2.WRITE, *goal_current_and_velocity) == p2.LIMIT_ERROR
    assert host.read(1, "Goal Current") == 1193
    assert host.error(1, p2.WRITE, 102, 0, 10, 0, 100, 0, 0, 0) == 0
    assert (host.read(1, "Goal Current"), host.read(1, "Goal Velocity")) == (10, 100)


# ------------------------------------------------------------------------------ indirect


def test_indirect_data_stand_for_their_targets(host: Host) -> None:
    for at, address in enumerate((126, 127, 132, 133, 134, 135, 65)):
        assert host.error(1, p2.WRITE, *words(168 + 2 * at), *words(address)) == 0
    assert host.ask(1, p2.READ, 224, 0, 7, 0)[9:-2] == b"\0\0\0\x08\0\0\0"
    assert host.error(1, p2.WRITE, *words(230), 1) == 0
    assert host.read(1, "LED") == 1
    assert host.error(1, p2.WRITE, *words(224), 1, 0) == p2.ACCESS_ERROR  # read-only there


def test_an_item_of_four_bytes_needs_four_indirect_addresses(host: Host) -> None:
    for at in range(4):
        host.error(1, p2.WRITE, *words(578 + 2 * at), *words(116 + at))
    assert host.error(1, p2.WRITE, *words(634), 0, 4) == p2.LENGTH_ERROR
    assert host.error(1, p2.WRITE, *words(634), 0, 4, 0, 0) == 0
    assert host.read(1, "Goal Position") == 1024


def test_indirect_addresses_reach_the_ram_only(host: Host) -> None:
    assert host.error(1, p2.WRITE, *words(168), 63, 0) == p2.RANGE_ERROR
    assert host.error(1, p2.WRITE, *words(168), *words(662)) == p2.RANGE_ERROR


def test_indirect_data_left_alone_are_memory(host: Host) -> None:
    assert host.error(1, p2.WRITE, *words(224), 1, 2, 3) == 0
    assert host.ask(1, p2.READ, 224, 0, 3, 0)[9:-2] == b"\1\2\3"


# ------------------------------------------------------------------------------ addresses


def test_a_change_of_id_is_answered_with_the_old_one(host: Host) -> None:
    assert host.ask(1, p2.WRITE, 7, 0, 9) == p2.status(1, 0)
    assert host.ask(1, p2.PING) == b""
    assert host.ask(9, p2.PING)[4] == 9


def test_a_change_of_baud_rate_is_answered_at_the_old_one(host: Host) -> None:
    assert host.ask(1, p2.WRITE, 8, 0, 1) == p2.status(1, 0)
    assert host.ask(1, p2.PING) == b""
    host.port.baud = 57_600
    assert host.talk(p2.frame(1, b"\x01"), 10_000_000)[4] == 1
    assert host.talk(p2.frame(2, b"\x01"), 10_000_000) == b""


def test_two_servos_with_one_id_garble_each_other() -> None:
    host = Host((1, 2))
    host.write(2, "ID", 1)
    response = host.ask(1, p2.PING)
    assert response
    assert p2.HEADER not in response


def test_the_second_id_is_heard_and_not_answered(host: Host) -> None:
    host.write(1, "Secondary(Shadow) ID", 5)
    host.write(2, "Secondary(Shadow) ID", 5)
    assert host.ask(5, p2.WRITE, 65, 0, 1) == b""
    assert [host.read(one, "LED") for one in (1, 2)] == [1, 1]


@pytest.mark.parametrize(("level", "responses"), [(0, "100"), (1, "110"), (2, "111")])
def test_status_return_level(host: Host, level: int, responses: str) -> None:
    host.write(1, "Status Return Level", level)
    heard = [
        host.ask(1, p2.PING),
        host.ask(1, p2.READ, 132, 0, 4, 0),
        host.ask(1, p2.WRITE, 65, 0, 1),
    ]
    assert [bool(one) for one in heard] == [one == "1" for one in responses]
    assert len(split(host.sync_read((1, 2)))) == (1 if level == 0 else 2)


def test_a_broadcast_is_done_by_all_and_answered_by_none(host: Host) -> None:
    assert host.ask(p2.BROADCAST, p2.WRITE, 65, 0, 1) == b""
    assert host.ask(p2.BROADCAST, p2.READ, 65, 0, 1, 0) == b""
    assert [host.read(one, "LED") for one in (1, 2)] == [1, 1]
    host.ask(p2.BROADCAST, p2.REG_WRITE, 65, 0, 0)
    assert host.ask(p2.BROADCAST, p2.ACTION) == b""
    assert [host.read(one, "LED") for one in (1, 2)] == [0, 0]


def test_a_refused_reg_write_registers_nothing(host: Host) -> None:
    assert host.error(1, p2.REG_WRITE, 65, 0, 7) == p2.RANGE_ERROR
    assert host.read(1, "Registered Instruction") == 0


def test_a_reboot_takes_a_while_and_resets_the_ram(host: Host) -> None:
    host.write(1, "LED", 1)
    host.write(1, "Return Delay Time", 10)
    host.write(1, "Torque Enable", 1)
    assert host.error(1, p2.REBOOT) == 0
    assert host.ask(1, p2.PING) == b""
    host.pass_time(0.2)
    assert host.read(1, "LED") == 0
    assert host.read(1, "Torque Enable") == 0
    assert host.read(1, "Return Delay Time") == 10
    assert host.read(1, "Realtime Tick") < 400


@pytest.mark.parametrize(
    ("option", "device_id", "baud"), [(0xFF, 1, 1), (0x01, 2, 1), (0x02, 2, 3)]
)
def test_a_factory_reset_keeps_what_it_is_asked_to(
    host: Host, option: int, device_id: int, baud: int
) -> None:
    servo = host.servos[1]
    assert servo.device_id == 2
    servo.memory.poke("Baud Rate", 3)
    servo.memory.poke("Return Delay Time", 10)
    servo.memory.poke("Operating Mode", 0)
    assert host.error(2, p2.FACTORY_RESET, option) == 0
    peek = servo.memory.peek
    assert (servo.device_id, peek("Baud Rate"), peek("Return Delay Time")) == (device_id, baud, 250)
    assert peek("Operating Mode") == 3
    assert peek("Firmware Version") == servo.firmware > 0
    assert not servo.hears(servo.baud, 0)  # it reboots


def test_a_factory_reset_that_would_lose_servos_or_a_running_one_is_none(host: Host) -> None:
    assert host.error(1, p2.FACTORY_RESET) == p2.LENGTH_ERROR
    assert host.error(1, p2.FACTORY_RESET, 3) == p2.RANGE_ERROR
    host.write(1, "Torque Enable", 1)
    assert host.error(1, p2.FACTORY_RESET, 0x02) == p2.RESULT_FAIL
    assert host.ask(p2.BROADCAST, p2.FACTORY_RESET, 0xFF) == b""
    assert [servo.device_id for servo in host.servos[:2]] == [1, 2]


def test_changing_the_mode_resets_gains_profile_and_goals(host: Host) -> None:
    host.write(1, "Position P Gain", 5)
    host.write(1, "Profile Velocity", 5)
    host.write(1, "Goal Current", 5)
    host.write(1, "Operating Mode", 0)
    assert host.read(1, "Position P Gain") == 800
    assert host.read(1, "Profile Velocity") == 0
    assert host.read(1, "Goal Current") == 1193  # its limit: to be set before torque on


def test_homing_offset_and_reverse_mode(host: Host) -> None:
    host.write(1, "Homing Offset", 100)
    assert host.read(1, "Present Position") == 2148
    host.servos[0].axis.physics.x += 10 * host.servos[0].joint.position
    host.pass_time(0.01)
    assert host.read(1, "Present Position") == 2158
    host.write(1, "Drive Mode", 1)
    assert host.read(1, "Present Position") == 2138
