"""Each family switched on as its manual says, its limits, faults, watchdog and EEPROM."""

from __future__ import annotations

import pytest

from tautwave.errors import ConfigError
from tests.sim.modbus.masters import PERIOD_NS, Bench, read

GENERIC, DSY, CIA402 = "generic", "dsy-rs", "cia402"
MODES = {"generic": (2, 1, 0), "dsy-rs": (2, 1, 0), "cia402": (10, 9, 8)}


def enable(bench: Bench, mode: int = 0) -> None:
    """Switch the only drive on, in its mode for torque (0), velocity (1) or position (2)."""
    table = bench.drive().table
    bench.set(table.roles["mode"], MODES[table.family][mode])
    if table.family == "cia402":
        for word in (0x06, 0x07, 0x0F):
            bench.set("controlword", word)
    elif table.family == "dsy-rs":
        bench.set("forced_inputs", 0x1FE)
        bench.set("forced_io", 1)
    else:
        bench.set("control", 1)


def disable(bench: Bench) -> None:
    switch = {"cia402": ("controlword", 0), "dsy-rs": ("forced_inputs", 0x1FF)}
    bench.set(*switch.get(bench.drive().table.family, ("control", 0)))


def reset(bench: Bench) -> None:
    family = bench.drive().table.family
    if family == "cia402":
        bench.set("controlword", 0)
        bench.set("controlword", 0x80)
    elif family == "dsy-rs":
        bench.set("fault_reset", 1)
    else:
        bench.set("control", 0)
        bench.set("control", 2)


ON = {"generic": 3, "dsy-rs": 1, "cia402": 0x1237}
OFF = {"generic": 1, "dsy-rs": 0, "cia402": 0x0250}
FAULT = {"generic": 4, "dsy-rs": 2, "cia402": 0x0218}
FAMILIES = pytest.mark.parametrize("profile", [GENERIC, DSY, CIA402])


def status(bench: Bench) -> int:
    return bench.number(bench.drive().table.roles["status"])


def torque(bench: Bench) -> str:
    return str(bench.drive().table.roles["command_effort"])


@FAMILIES
def test_on_and_off(profile: str) -> None:
    bench = Bench("rtu", profile)
    assert status(bench) == OFF[profile]
    enable(bench)
    assert status(bench) == ON[profile]
    bench.set(torque(bench), 500)
    assert bench.drive().motor.setpoint == 500
    disable(bench)
    assert status(bench) == OFF[profile]
    assert bench.drive().motor.setpoint == 0


@FAMILIES
def test_a_fault_switches_off_and_is_reset_while_commanded_off(profile: str) -> None:
    event = {"kind": "drive_fault", "nth": 8, "code": 6}
    bench = Bench("tcp", profile, faults={"events": [event]})
    enable(bench)
    bench.set(torque(bench), 500)
    while status(bench) == ON[profile]:
        pass
    assert status(bench) == FAULT[profile]
    assert bench.drive().motor.setpoint == 0
    role = bench.drive().table.roles.get("fault")
    if role is not None:
        assert bench.number(role) == 6
    if profile != CIA402:  # CiA 402 looks at the edge only
        reset_word = {"generic": ("control", 3), "dsy-rs": ("fault_reset", 1)}[profile]
        bench.set(*reset_word)
        assert status(bench) == FAULT[profile]
    disable(bench)
    reset(bench)
    assert status(bench) == OFF[profile]
    if role is not None:
        assert bench.number(role) == 0
    enable(bench)
    assert status(bench) == ON[profile]


def test_one_reset_may_not_be_enough() -> None:
    bench = Bench(quirks={"starts_in_fault": True, "resets": 2})
    reset(bench)
    bench.set("control", 2)  # no edge
    assert status(bench) == 4
    reset(bench)
    assert status(bench) == 1


def test_a_dsy_takes_its_reset_back() -> None:
    bench = Bench("rtu", DSY, quirks={"starts_in_fault": True})
    reset(bench)
    assert (status(bench), bench.number("fault_reset")) == (0, 0)


@FAMILIES
def test_a_drive_takes_its_time_or_refuses(profile: str) -> None:
    slow = Bench("tcp", profile, quirks={"enable_s": 0.2})
    enable(slow)
    assert status(slow) != ON[profile]
    for _ in range(3 if profile == CIA402 else 1):  # each transition takes its time
        slow.wait(0.25)
        if profile == CIA402:
            slow.set("controlword", 0x0F)
    slow.wait(0.25)
    assert status(slow) == ON[profile]
    never = Bench("tcp", profile, quirks={"refuses_to_enable": True})
    enable(never)
    never.wait(1.0)
    assert status(never) != ON[profile]


@FAMILIES
def test_velocity_and_position(profile: str) -> None:
    bench = Bench("tcp", profile, causality="admittance")
    roles = bench.drive().table.roles
    enable(bench, 1)
    bench.set(roles["command_velocity"], 300)
    bench.wait(0.1)
    assert bench.number(roles["velocity"]) == 300
    assert bench.drive().motor.axis.physics.v == pytest.approx(300 * bench.drive().motor.scale[1])
    if "command_position" not in roles:
        return
    bench.set(roles["mode"], MODES[profile][2])
    for _ in range(40):
        bench.set(roles["command_position"], 1000)
        bench.wait(0.01)
    assert bench.number(roles["position"]) == pytest.approx(1000, abs=2)


def test_a_speed_command_left_as_delivered_runs_at_once() -> None:
    # P05.03 is 200 rpm as delivered: whoever enables without writing it finds out.
    bench = Bench("rtu", DSY, causality="admittance")
    enable(bench, 1)
    assert bench.drive().motor.setpoint == 200


@pytest.mark.parametrize("counts", [2000, -2000])
def test_torque_and_velocity_are_held_at_their_limits(counts: int) -> None:
    bench = Bench()
    enable(bench)
    bench.set("torque_limit", 700)
    bench.set("target_torque", counts)
    assert bench.drive().motor.setpoint == (700 if counts > 0 else -700)
    assert status(bench) == 3 | 8
    bench.set("target_torque", 100)
    assert status(bench) == 3
    servo = Bench(causality="admittance")
    enable(servo, 1)
    servo.set("velocity_limit", 50)
    servo.set("target_velocity", counts)
    assert servo.drive().motor.setpoint == (50 if counts > 0 else -50)


@pytest.mark.parametrize(("end", "counts"), [("position_high", 40), ("position_low", -40)])
def test_no_torque_pushes_beyond_the_range_of_position(end: str, counts: int) -> None:
    bench = Bench()
    bench.set(end, counts)
    enable(bench)
    outwards = 25 * counts
    bench.set("target_torque", outwards)
    while abs(bench.number("position")) < 40:
        bench.wait(0.01)
    assert bench.drive().motor.setpoint == 0
    assert status(bench) & 8
    bench.set("target_torque", -outwards)
    assert bench.drive().motor.setpoint == -outwards


@pytest.mark.parametrize("link", ["tcp", "rtu"])
def test_silence_trips_the_watchdog(link: str) -> None:
    bench = Bench(link)
    bench.set("comm_timeout", 50)
    enable(bench)
    bench.set("target_torque", 500)
    for _ in range(5):
        bench.wait(0.04)
        assert status(bench) == 3
    reported = bench.drive().motor.axis.physics.v
    bench.wait(0.06)
    assert status(bench) == 4
    assert bench.number("fault_code") == 1
    assert bench.drive().motor.setpoint == 0
    # The torque acted until the timeout and not beyond: 50 ms of 0.5 N m on 0.5 kg m2 at most.
    assert bench.drive().motor.axis.physics.v - reported <= 0.0595
    coasting = bench.drive().motor.axis.physics.v
    bench.wait(0.5)
    status(bench)
    assert bench.drive().motor.axis.physics.v == coasting


def test_the_watchdog_ends_the_torque_in_the_slot_of_its_time() -> None:
    bench = Bench()
    bench.set("comm_timeout", 20)
    enable(bench)
    bench.set("target_torque", 500)
    heard = bench.drive()._heard_ns
    origin = bench.drive().origin_ns
    bench.until(heard + 100_000_000)
    status(bench)
    pushed = round((heard + 20_000_000 - origin) / PERIOD_NS)
    assert bench.drive().motor.axis.physics.v == pytest.approx(pushed * 1e-3 * 0.5 / 0.5)


def test_no_timeout_no_watchdog() -> None:
    bench = Bench()
    enable(bench)
    bench.wait(100.0)
    assert status(bench) == 3


def test_a_watchdog_that_cannot_be_set() -> None:
    bench = Bench(quirks={"keeps_comm_timeout": True})
    response = bench.set("comm_timeout", 50)
    assert response is not None
    assert response[0] == 16
    assert bench.number("comm_timeout") == 0


def test_eeprom_wears_with_each_write_unless_storing_is_off() -> None:
    bench = Bench()
    for value in (1, 2, 1):
        bench.set("mode", value)
    bench.set("target_torque", 5)  # no lasting register
    assert bench.drive().wear == {"mode": 3}
    bench.set("eeprom", 0)
    bench.set("mode", 2)
    assert bench.drive().wear == {"mode": 3}


def test_the_torque_command_of_a_dsy_wears_its_eeprom() -> None:
    worn = Bench("rtu", DSY, quirks={"registers": {"eeprom": 1}})
    kept = Bench("rtu", DSY)
    for bench in (worn, kept):
        enable(bench)
        for counts in range(20):
            bench.set("torque_command", counts)
    assert worn.drive().wear["torque_command"] == 20
    assert kept.drive().wear == {}


def test_a_worn_out_eeprom_is_a_failure_of_the_device() -> None:
    bench = Bench(quirks={"eeprom_life": 2})
    assert [bench.set("mode", value) for value in (1, 2, 1)][-1] == bytes([0x90, 4])
    assert bench.number("mode") == 2


def test_a_drive_that_stores_is_busy_for_a_while() -> None:
    bench = Bench(quirks={"busy_after_write_s": 0.01})
    bench.set("mode", 1)
    assert bench.ask(read(0)) == bytes([0x83, 6])
    assert bench.set("mode", 2) == bytes([0x90, 6])
    bench.wait(0.02)
    assert bench.number("mode") == 1


def test_what_was_stored_survives_the_supply() -> None:
    events = [{"kind": "power_cycle", "nth": 8}]
    bench = Bench(faults={"events": events})
    bench.set("torque_limit", 800)
    bench.set("eeprom", 0)
    bench.set("comm_timeout", 90)
    enable(bench)
    assert [status(bench) for _ in range(3)] == [3, 3, 1]
    assert (bench.number("torque_limit"), bench.number("comm_timeout")) == (800, 0)
    assert bench.number("eeprom") == 1


def test_a_register_that_is_not_there_is_named() -> None:
    with pytest.raises(ConfigError, match="'speed', which generic does not have"):
        Bench(quirks={"registers": {"speed": 1}})
    with pytest.raises(ConfigError, match="profile 'dsy'"):
        Bench(profile="dsy")


def test_rated_torque_and_counts_are_those_of_the_options() -> None:
    bench = Bench(device={"rated_torque": 2.5, "counts_per_revolution": 4096.0})
    assert (bench.number("rated_torque"), bench.number("counts")) == (2500, 4096)
    assert bench.drive().motor.scale.effort == pytest.approx(2.5e-3)


@pytest.mark.parametrize(("function", "level", "logic"), [(1, 0, 0), (1, 1, 1)])
def test_any_input_may_be_servo_on(function: int, level: int, logic: int) -> None:
    bench = Bench("rtu", DSY)
    bench.set("di1_function", 0)
    bench.set("di3_function", function)
    bench.set("di3_logic", logic)
    bench.set("forced_inputs", 0x1FB | level << 2)
    assert status(bench) == (1 if level else 0)  # nothing is wired: all are high
    bench.set("forced_io", 1)
    assert status(bench) == 1
    bench.set("emergency_stop", 1)
    assert status(bench) == 0


def test_an_input_function_that_no_input_has_is_reported_by_its_state() -> None:
    bench = Bench("rtu", DSY)
    bench.set("di1_function", 0)
    bench.set("unassigned_low", 1)
    assert status(bench) == 1
