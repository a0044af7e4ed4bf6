"""Protocol 1.0: AX-12 and MX-28, and an X servo set to it."""

from __future__ import annotations

import pytest

from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.wire import packets1 as p1
from tests.sim.dynamixel.line import Host, words


def word(host: Host, address: int) -> int:
    return int.from_bytes(host.ask1(1, p2.READ, address, 2)[5:7], "little")


@pytest.fixture
def host() -> Host:
    return Host((1,), "AX-12A", truths={"mass": 0.005})


def test_a_goal_is_reached(host: Host) -> None:
    assert word(host, 36) == 512
    assert host.ask1(1, p2.WRITE, 24, 1) == p1.status(1, 0)
    assert host.ask1(1, p2.WRITE, 30, *words(700)) == p1.status(1, 0)
    host.pass_time(0.1)
    assert host.ask1(1, p2.READ, 46, 1)[5] == 1
    assert 0 < word(host, 38) < 0x400
    host.pass_time(2.0)
    assert word(host, 36) == pytest.approx(700, abs=1)
    host.ask1(1, p2.WRITE, 30, *words(300))
    host.pass_time(0.1)
    assert word(host, 38) & 0x400  # clockwise


def test_wheel_mode_turns_by_moving_speed(host: Host) -> None:
    host.ask1(1, p2.WRITE, 8, 0, 0)
    host.ask1(1, p2.WRITE, 24, 1)
    host.ask1(1, p2.WRITE, 32, *words(0x400 | 100))
    host.pass_time(1.0)
    assert word(host, 38) == pytest.approx(0x400 | 100, abs=2)
    assert host.servos[0].axis.physics.v < 0.0


@pytest.mark.parametrize(
    ("params", "bit"),
    [
        ((p2.WRITE, 25, 2), p1.RANGE_BIT),
        ((p2.WRITE, 36, 0, 0), p1.RANGE_BIT),
        ((p2.WRITE, 30, 0), p1.RANGE_BIT),
        ((p2.READ, 200, 2), p1.RANGE_BIT),
        ((p2.ACTION,), p1.INSTRUCTION_BIT),
        ((0x08,), p1.INSTRUCTION_BIT),
    ],
)
def test_error_bits(host: Host, params: tuple[int, ...], bit: int) -> None:
    assert host.ask1(1, *params) == p1.status(1, bit)


def test_angle_limit_and_checksum_bits(host: Host) -> None:
    host.ask1(1, p2.WRITE, 8, *words(600))
    assert host.ask1(1, p2.WRITE, 30, *words(601)) == p1.status(1, p1.ANGLE_BIT)
    sent = bytearray(p1.frame(1, b"\x01"))
    sent[-1] ^= 4
    assert host.talk(bytes(sent)) == p1.status(1, p1.CHECKSUM_BIT)


@pytest.mark.parametrize(
    ("kind", "bit"),
    [
        ("overload", p1.OVERLOAD_BIT),
        ("overheat", p1.OVERHEATING_BIT),
        ("input_voltage", p1.VOLTAGE_BIT),
    ],
)
def test_conditions_are_bits_of_every_answer_and_drop_the_torque(kind: str, bit: int) -> None:
    events = [{"kind": kind, "at_s": 0.1}]
    host = Host((1,), "MX-28", simulator={"faults": {"events": events}})
    host.ask1(1, p2.WRITE, 24, 1)
    host.pass_time(0.2)
    assert host.ask1(1, p2.PING) == p1.status(1, bit)
    assert host.ask1(1, p2.READ, 24, 1)[4:6] == bytes((bit, 0))


def test_lock_keeps_the_eeprom(host: Host) -> None:
    assert host.ask1(1, p2.WRITE, 5, 10) == p1.status(1, 0)
    host.ask1(1, p2.WRITE, 47, 1)
    assert host.ask1(1, p2.WRITE, 5, 20) == p1.status(1, p1.RANGE_BIT)


def test_the_torque_does_not_lock_it(host: Host) -> None:
    host.ask1(1, p2.WRITE, 24, 1)
    assert host.ask1(1, p2.WRITE, 5, 10) == p1.status(1, 0)


def test_status_return_level_and_broadcast(host: Host) -> None:
    assert host.ask1(0xFE, p2.WRITE, 25, 1) == b""
    assert host.ask1(1, p2.READ, 25, 1)[5] == 1
    host.ask1(1, p2.WRITE, 16, 1)
    assert host.ask1(1, p2.WRITE, 25, 0) == b""
    assert host.ask1(1, p2.READ, 25, 1)[5] == 0
    host.ask1(0xFE, p2.WRITE, 16, 0)
    assert host.ask1(1, p2.READ, 25, 1) == b""
    assert host.ask1(1, p2.PING) == p1.status(1, 0)


def test_an_old_servo_is_deaf_to_protocol_2(host: Host) -> None:
    assert host.ask(1, p2.PING) == b""


def test_load_has_a_direction() -> None:
    host = Host((1,), "MX-28", truths={"grip": (20.0, 0.5)})
    host.ask1(1, p2.WRITE, 24, 1)
    host.ask1(1, p2.WRITE, 30, *words(2100))
    host.pass_time(0.5)
    up = word(host, 40)
    assert 0 < up < 0x400
    host.ask1(1, p2.WRITE, 30, *words(1996))
    host.pass_time(0.5)
    assert word(host, 40) & 0x3FF == pytest.approx(up, rel=0.1)
    assert word(host, 40) & 0x400


def test_an_x_servo_can_speak_protocol_1() -> None:
    host = Host((1,))
    assert host.write(1, "Protocol Type", 1) == 0
    assert host.ask(1, p2.PING) == b""
    assert host.ask1(1, p2.PING) == p1.status(1, 0)
    assert host.ask1(1, p2.READ, 132, 4) == p1.status(1, 0, b"\0\x08\0\0")
    assert host.ask1(1, p2.WRITE, 13, 2) == p1.status(1, 0)
    assert host.ask(1, p2.PING)[4] == 1
