"""Before torque: the right servo, healthy, in its mode, watched; EEPROM only where allowed."""

from __future__ import annotations

import math

import pytest

from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError, DeviceFault, DriverError
from tautwave.types import AxisCommand
from tautwave_drivers.dynamixel import plugin
from tests.drivers.dynamixel.parts import Bench, bench, servo, spec

EEPROM_END = 64
CURRENT_LIMIT = 38
RANGE_ERROR = 4


def eeprom(made: Bench) -> list[bytes]:
    return [one.memory.read(0, EEPROM_END) or b"" for one in made.world.servos]


def factory(**more: object) -> dict[str, object]:
    return {"simulator": {"factory": True, **more}}


def opened(made: Bench) -> Bench:
    made.driver.open()
    return made


def test_what_was_found_and_set_is_reported() -> None:
    made = opened(bench(spec(1), spec(2)))
    notes = made.driver.notes
    assert any("XM430-W350, firmware 48, 12.0 V, 25 degC" in note for note in notes)
    assert any("1.78 N m/A is the stall slope, +-20 %" in note for note in notes)
    for device_id in (1, 2):
        reported = " ".join(note for note in notes if f"servo {device_id})" in note)
        assert "current mode, return delay 0 us, current limit" in reported
        assert "bus watchdog(98) = 5, written and read back" in reported


def test_torque_is_off_and_everything_is_set_after_open() -> None:
    made = opened(bench(spec(1), spec(2, "admittance"), watchdog_s=0.25))
    assert [made.peek(index, "Torque Enable") for index in (0, 1)] == [0, 0]
    assert [made.peek(index, "Operating Mode") for index in (0, 1)] == [0, 1]
    assert [made.peek(index, "Bus Watchdog") for index in (0, 1)] == [13, 13]  # up to 20 ms more
    assert made.peek(0, "Goal Current") == 0
    assert made.peek(1, "Goal Velocity") == 0


def test_torque_that_was_left_on_is_switched_off() -> None:
    made = bench(spec(1))
    made.poke(0, "Torque Enable", 1)
    opened(made)
    assert made.peek(0, "Torque Enable") == 0


def test_the_goal_is_zero_before_torque_comes_on() -> None:
    made = bench(spec(1))
    opened(made)
    made.poke(0, "Goal Current", 300)  # as after a change of mode
    made.enable()
    assert made.peek(0, "Goal Current") == 0
    assert made.world.servos[0].torque_on


def test_eeprom_is_not_touched_and_the_refusal_says_what_would_change() -> None:
    made = bench(spec(1), spec(2, "admittance"), **factory())
    before = eeprom(made)
    with pytest.raises(DriverError, match="--configure") as caught:
        made.driver.open()
    assert eeprom(made) == before
    reported = str(caught.value)
    assert "operating mode(11) 3 (position) -> 0 (current)" in reported
    assert "operating mode(11) 3 (position) -> 1 (velocity)" in reported
    assert reported.count("return delay time(9) 250 (500 us) -> 0 (0 us)") == 2
    first, *changes, last = reported.splitlines()
    assert first.endswith("lasting settings differ:")
    assert all(line.startswith("  ") and line.count("->") == 1 for line in changes)
    assert "run once with --configure" in last


def test_configure_writes_what_differs_and_tells() -> None:
    given = [servo(1, current_limit=1.345)]
    made = bench(spec(1), servos=given, bus={"configure": True}, **factory())
    before = eeprom(made)[0]
    opened(made)
    after = eeprom(made)[0]
    changed = [at for at in range(EEPROM_END) if before[at] != after[at]]
    assert changed == [9, 11, 38, 39]
    assert made.peek(0, "Current Limit") == 500
    assert sum(note.endswith(" written and read back") for note in made.driver.notes) == 3
    # Nothing is left to write the next time.
    made.driver.close()
    made.driver.open()
    assert not any(note.endswith(" written and read back") for note in made.driver.notes)


def test_another_model_is_refused() -> None:
    made = bench(spec(1), simulator={"servos": {1: {"model": "XM430-W210"}}})
    with pytest.raises(DriverError, match=r"is a XM430-W210 .*the rig states XM430-W350"):
        made.driver.open()


def test_a_silent_servo_is_named_with_the_way_to_find_it() -> None:
    made = bench(spec(1), spec(2))
    made.world.servos[1].present = False
    with pytest.raises(DriverError, match=r"servo 2\): no answer at 4000000 baud.*tautwave scan"):
        made.driver.open()


def test_a_servo_that_answers_only_pings_is_made_to_answer() -> None:
    made = bench(spec(1))
    made.poke(0, "Status Return Level", 0)
    opened(made)
    assert made.peek(0, "Status Return Level") == 2


def test_a_hardware_error_is_reported_as_text() -> None:
    made = bench(spec(1))
    made.world.servos[0].fail(5)
    with pytest.raises(DeviceFault, match="overloaded for too long; its torque is off"):
        made.driver.open()


@pytest.mark.parametrize("transport", ["own", "sdk"])
def test_a_reboot_clears_it_where_asked_for(transport: str) -> None:
    made = bench(spec(1), reboot=True, transport=transport)
    made.world.servos[0].fail(5)
    made.enable()
    assert any("overloaded for too long" in n and n.endswith("rebooted") for n in made.driver.notes)
    assert made.cycle(0.1)[0].valid
    assert not made.driver.faults()


def test_an_error_that_a_reboot_does_not_clear_is_refused() -> None:
    made = bench(spec(1), reboot=True)
    one = made.world.servos[0]
    one.fail(0)
    one.reboot = lambda now_ns: None
    with pytest.raises(DeviceFault, match="even after a reboot; remove the cause"):
        made.driver.open()


def test_an_effort_limit_beyond_the_current_limit_is_refused_in_numbers() -> None:
    quirk = {"servos": {1: {"registers": {"Current Limit": 100}}}}
    made = bench(spec(1, effort=0.6), simulator=quirk)
    with pytest.raises(DriverError, match=r"needs 0.336 A.*is 0.269 A; lower effort_limit to 0.48"):
        made.driver.open()


def test_a_velocity_limit_beyond_the_servos_is_refused() -> None:
    made = bench(spec(1, "admittance", velocity=10.0))
    with pytest.raises(DriverError, match=r"velocity limit\(44\)"):
        made.driver.open()


def test_firmware_without_a_watchdog_needs_to_be_allowed() -> None:
    quirk = {"servos": {1: {"firmware": 37}}}
    made = bench(spec(1), simulator=quirk)
    with pytest.raises(DriverError, match=r"no bus watchdog.*--allow-unwatched"):
        made.driver.open()
    allowed = bench(spec(1), simulator=quirk, bus={"allow_unwatched": True})
    allowed.enable()
    assert allowed.driver.unwatched == {
        "master.a1": "(servo 1) keeps following its last command: its firmware 37 has no bus "
        "watchdog"
    }
    assert allowed.driver.watchdog_s == {}


def test_a_tripped_watchdog_is_armed_again() -> None:
    made = bench(spec(1))
    made.enable()
    made.clock.sleep_until(made.clock.now_ns() + 500_000_000)
    made.cycle(0.0)
    assert any("watchdog tripped" in fault.text for fault in made.driver.faults())
    made.driver.close()
    made.poke(0, "Bus Watchdog", -1)
    made.enable()
    assert any("had tripped; armed again" in note for note in made.driver.notes)
    assert made.peek(0, "Bus Watchdog") == 5


def test_torque_that_a_goal_would_switch_on_is_configured_away() -> None:
    quirk = {"servos": {1: {"registers": {"Drive Mode": 9}}}}
    given = {"servos": [servo(1, "XL330-M288")], "simulator": quirk}
    with pytest.raises(DriverError, match=r"drive mode\(10\) 9 -> 0"):
        bench(spec(1, effort=0.2), **given).driver.open()
    opened(bench(spec(1, effort=0.2), bus={"configure": True}, **given))
    given["servos"][0]["reverse_mode"] = True
    made = opened(bench(spec(1, effort=0.2), bus={"configure": True}, **given))
    assert made.peek(0, "Drive Mode") == 1


def test_too_old_a_firmware_for_a_fast_read_is_reported() -> None:
    quirk = {"servos": {1: {"firmware": 40}}}
    made = bench(spec(1), simulator=quirk, read="fast_sync")
    with pytest.raises(DriverError, match="use read: sync"):
        made.driver.open()


def without_access(made: Bench, *names: str) -> None:
    """Have a servo refuse to be written where a register's name begins so."""
    memory = made.world.servos[0].memory
    refuse = memory._refuse
    memory._refuse = lambda item, value: (
        RANGE_ERROR if item.name.startswith(names) else refuse(item, value)
    )


def unreadable(made: Bench, address: int) -> None:
    memory = made.world.servos[0].memory
    read = memory.read
    memory.read = lambda at, length: None if at == address else read(at, length)


def test_a_register_that_a_servo_does_not_let_us_use_is_named() -> None:
    made = bench(spec(1))
    without_access(made, "Bus Watchdog")
    with pytest.raises(DriverError, match=r"servo 1\): bus watchdog\(98\) rejects \d+: \w+"):
        made.driver.open()
    made = bench(spec(1))
    unreadable(made, CURRENT_LIMIT)
    with pytest.raises(DriverError, match=r"servo 1\): current limit\(38\) cannot be read: \w+"):
        made.driver.open()
    made = bench(spec(1), status_block=True)
    without_access(made, "Indirect Address")
    with pytest.raises(DriverError, match=r"rejects the indirect .* omit status_block"):
        made.driver.open()


def test_a_register_that_another_program_sets_again_is_reported() -> None:
    made = bench(spec(1))
    memory = made.world.servos[0].memory
    poke = memory.poke
    memory.poke = lambda name, value: poke(name, 7 if name == "Bus Watchdog" else value)
    with pytest.raises(DriverError, match=r"reads 7 after \d+ was written; is another program"):
        made.driver.open()


def test_a_servo_that_falls_silent_while_it_is_set_up_is_named() -> None:
    lost = [{"kind": "lost", "nth": number} for number in range(4, 60)]
    made = bench(spec(1), simulator={"faults": {"events": lost}})
    with pytest.raises(DriverError, match=r"^master\.a1 \(bus hand, servo 1\): no response when"):
        made.driver.open()


def test_sim_without_a_simulation_is_reported() -> None:
    made = bench(spec(1))
    made.driver._transport = None
    with pytest.raises(DriverError, match="add a simulation block"):
        made.driver.open()


def test_the_vendors_library_does_the_same() -> None:
    own = bench(spec(1), bus={"configure": True}, **factory())
    sdk = bench(spec(1), bus={"configure": True}, transport="sdk", **factory())
    for made in (own, sdk):
        made.enable()
        for _ in range(3):
            made.cycle(0.2)
    assert own.driver.notes == sdk.driver.notes
    assert eeprom(own) == eeprom(sdk)
    assert own.world.axes[0].physics.v == sdk.world.axes[0].physics.v != 0.0


def test_without_the_vendors_library_own_packets_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "dynamixel_sdk", None)
    made = bench(spec(1), transport="sdk")
    with pytest.raises(ConfigError, match=r"tautwave\[dynamixel\]"):
        made.driver.open()
    opened(bench(spec(1)))


def follower(device_id: int, effort: float = 0.1) -> AxisSpec:
    return spec(device_id, "admittance", effort)._replace(takes_position=True)


def test_a_follower_holds_where_torque_found_it_until_it_is_sent_somewhere() -> None:
    made = bench(
        follower(1), spec(2, effort=0.1), servos=[servo(1, "XL330-M077"), servo(2, "XL330-M077")]
    )
    made.world.axes[0].physics.x = 0.2
    made.enable()
    assert [made.peek(index, "Operating Mode") for index in (0, 1)] == [5, 0]
    most = made.peek(0, "Goal Current")  # its grip: the axis' effort limit
    assert most == int(0.1 / (1e-3 * 0.215 / 1.47))
    held = made.peek(0, "Goal Position")
    assert held == 2048 + round(0.2 * 4096 / (2 * math.pi))
    for _ in range(3):
        made.driver.request()
        made.driver.read(made.clock.now_ns() + 700_000)
        made.driver.write([AxisCommand(0.0, 0.0), AxisCommand(0.05, 0.0)])
        made.clock.sleep_until(made.clock.now_ns() + 1_000_000)
    assert made.peek(0, "Goal Position") == held, "no position was commanded"
    assert made.peek(1, "Goal Current") > 0
    assert plugin.positions, "a rig may say so"
    for _ in range(2):
        made.driver.request()
        made.driver.read(made.clock.now_ns() + 700_000)
        made.driver.write([AxisCommand(0.0, 0.0, 0.25), AxisCommand(0.05, 0.0)])
        made.clock.sleep_until(made.clock.now_ns() + 1_000_000)
    assert made.peek(0, "Goal Position") == 2048 + round(0.25 * 4096 / (2 * math.pi))


def test_a_follower_without_current_control_is_told_what_nobody_limits() -> None:
    wide = follower(1)._replace(position_range=(-3.5, 3.5))
    made = bench(wide, servos=[servo(1, "XL430-W250")])
    with pytest.raises(DriverError, match="beyond its position limits"):
        opened(made)  # its turn ends at 3.14
    narrow = follower(1)._replace(position_range=(-1.0, 1.0))
    made = opened(bench(narrow, servos=[servo(1, "XL430-W250")]))
    assert made.peek(0, "Operating Mode") == 3
    assert any("cannot limit its torque" in note for note in made.driver.notes)
