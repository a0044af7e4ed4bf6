"""Bus watchdog, hardware errors, alert bit, and what brings a servo back."""

from __future__ import annotations

import pytest

from tautwave_sim.dynamixel import packets as p2
from tautwave_sim.dynamixel.hardware import HARDWARE_KINDS
from tests.sim.dynamixel.line import Host, split

EVENTS = {"overload": 5, "electrical_shock": 4, "encoder": 3, "overheat": 2, "input_voltage": 0}


def running(**options: object) -> Host:
    host = Host((1, 2), **options)  # type: ignore[arg-type]
    for one in (1, 2):
        host.write(one, "Operating Mode", 1)
        host.write(one, "Torque Enable", 1)
        host.write(one, "Goal Velocity", 50)
    return host


def test_the_watchdog_stops_the_motor_and_locks_the_goals() -> None:
    host = running()
    host.write(1, "Bus Watchdog", 10)  # 200 ms
    host.pass_time(0.19)
    assert host.read(1, "Bus Watchdog") == 10
    assert host.servos[0].axis.physics.v > 0.5
    host.pass_time(0.3)
    assert host.read(1, "Bus Watchdog") == 255
    assert host.read(1, "Goal Velocity") == 0
    assert abs(host.servos[0].axis.physics.v) < 0.01
    for name in ("Goal Velocity", "Goal Position", "Goal PWM", "Goal Current"):
        assert host.write(1, name, 10) == p2.RANGE_ERROR, name
    host.sync_write("Goal Velocity", {1: 50})
    host.hear()
    assert host.read(1, "Goal Velocity") == 0
    assert host.write(1, "LED", 1) == 0
    assert host.write(1, "Bus Watchdog", 0) == 0
    assert host.write(1, "Goal Velocity", 50) == 0
    host.pass_time(0.5)
    assert host.read(1, "Bus Watchdog") == 0
    assert host.servos[0].axis.physics.v > 0.5


def test_it_trips_in_the_middle_of_silence_not_at_its_end() -> None:
    host = running()
    host.write(1, "Bus Watchdog", 10)
    begin = host.servos[0].axis.physics.x
    host.pass_time(2.0)
    speed = 50 * host.servos[0].joint.velocity
    assert host.servos[0].axis.physics.x - begin == pytest.approx(0.2 * speed, rel=0.1)
    assert host.servos[1].axis.physics.x - begin > 1.5 * speed


@pytest.mark.parametrize("heard", [(1, p2.PING), (p2.BROADCAST, p2.SYNC_READ), (1, p2.READ)])
def test_any_instruction_to_it_feeds_the_watchdog(heard: tuple[int, int]) -> None:
    host = running()
    host.write(1, "Bus Watchdog", 2)
    for _ in range(20):
        host.pass_time(0.03)
        host.talk(p2.frame(heard[0], bytes((heard[1], 132, 0, 4, 0, 1))), wait_ns=2_000_000)
    assert host.read(1, "Bus Watchdog") == 2


def test_what_is_said_to_others_does_not_feed_it() -> None:
    host = running()
    host.write(1, "Bus Watchdog", 2)
    for _ in range(4):
        host.pass_time(0.03)
        host.ask(2, p2.PING)
    assert host.read(1, "Bus Watchdog") == 255


def test_it_sleeps_while_the_torque_is_off() -> None:
    host = Host((1,))
    host.write(1, "Bus Watchdog", 1)
    host.pass_time(1.0)
    assert host.read(1, "Bus Watchdog") == 1


def test_a_current_of_a_tripped_servo_is_zero() -> None:
    host = Host((1,), simulator={"factory": False})
    host.write(1, "Goal Current", 0)
    host.write(1, "Torque Enable", 1)
    host.write(1, "Bus Watchdog", 1)
    host.write(1, "Goal Current", 20)
    host.pass_time(0.002)
    assert host.servos[0].motor.commanded > 0.0
    host.pass_time(0.1)
    assert host.servos[0].motor.commanded == 0.0
    assert host.read(1, "Goal Current") == 0


# ----------------------------------------------------------------------- hardware errors


@pytest.mark.parametrize("kind", HARDWARE_KINDS)
def test_a_hardware_error_drops_the_torque_and_raises_the_alert(kind: str) -> None:
    events = [{"kind": kind, "at_s": 1.0, "id": 1}]
    quirks = {1: {"registers": {"Shutdown": 0x3D}}}
    host = running(simulator={"faults": {"events": events}, "servos": quirks})
    assert host.error(1, p2.PING) == 0
    host.pass_time(1.0)
    assert host.error(1, p2.PING) == p2.ALERT
    responses = split(host.sync_read((1, 2)))
    assert [response[8] for response in responses] == [p2.ALERT, 0]
    assert host.read(1, "Hardware Error Status") == 1 << EVENTS[kind]
    assert host.read(1, "Torque Enable") == 0
    assert host.read(2, "Torque Enable") == 1
    assert host.write(1, "LED", 7) == p2.ALERT | p2.RANGE_ERROR
    assert host.write(1, "Torque Enable", 1) == p2.ALERT | p2.RESULT_FAIL
    fast = host.sync_read((1, 2), code=p2.FAST_SYNC_READ)
    assert (fast[8], fast[8 + 8]) == (p2.ALERT, 0)
    host.error(1, p2.REBOOT)
    host.pass_time(0.3)
    assert host.error(1, p2.PING) == 0
    assert host.read(1, "Hardware Error Status") == 0
    assert host.write(1, "Torque Enable", 1) == 0


def test_an_error_that_shutdown_leaves_out_only_alerts() -> None:
    events = [{"kind": "encoder", "at_s": 0.5, "id": 1}]
    host = running(simulator={"faults": {"events": events}})
    host.pass_time(0.6)
    assert host.read(1, "Hardware Error Status") == 1 << 3
    assert host.error(1, p2.PING) == p2.ALERT
    assert host.read(1, "Torque Enable") == 1


def test_a_stalled_motor_is_overloaded_after_a_while() -> None:
    quirks = {1: {"overload_s": 0.5}}
    host = Host((1,), simulator={"factory": False, "servos": quirks}, truths={"grip": (1e4, 10.0)})
    host.write(1, "Goal Current", 0)
    host.write(1, "Torque Enable", 1)
    stall = round(2.3 / 2.69e-3)
    host.write(1, "Goal Current", stall)
    host.pass_time(0.4)
    assert host.read(1, "Hardware Error Status") == 0
    host.pass_time(0.4)
    assert host.read(1, "Hardware Error Status") == 1 << 5
    assert host.read(1, "Torque Enable") == 0
    assert host.read(1, "Present Current") == 0


def test_current_heats_and_heat_shuts_down() -> None:
    quirks = {1: {"heating_s": 0.5, "overload_share": 2.0, "registers": {"Temperature Limit": 60}}}
    host = Host((1,), simulator={"factory": False, "servos": quirks}, truths={"grip": (1e4, 10.0)})
    assert host.read(1, "Present Temperature") == 25
    host.write(1, "Goal Current", 0)
    host.write(1, "Torque Enable", 1)
    host.write(1, "Goal Current", round(2.3 / 2.69e-3))
    host.pass_time(0.2)
    warm = host.read(1, "Present Temperature")
    assert 35 < warm < 60
    host.pass_time(0.6)
    assert host.read(1, "Hardware Error Status") == 1 << 2
    host.pass_time(3.0)
    assert host.read(1, "Present Temperature") == 25


def test_a_low_supply_alerts_and_a_330_shuts_down_for_it() -> None:
    for model, volts, torque in (("XM430-W350", 9.0, 1), ("XL330-M288", 3.2, 0)):
        events = {"events": []}
        host = Host((1,), model, simulator={"faults": events, "servos": {1: {"voltage": volts}}})
        host.servos[0].memory.poke("Torque Enable", 1)
        host.servos[0].motor.configure()
        host.pass_time(0.1)
        assert host.read(1, "Present Input Voltage") == round(volts * 10)
        assert host.read(1, "Hardware Error Status") == 1
        assert host.read(1, "Torque Enable") == torque
