"""Who obeys which goal: two servos on one joint, servos nobody listed, turns that were counted."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tautwave.errors import ConfigError, DeviceFault, DriverError
from tautwave.types import AxisCommand, JointState
from tautwave_drivers.dynamixel.budget import budget
from tautwave_drivers.dynamixel.options import match_servos
from tautwave_drivers.dynamixel.protocol.units import scale_of, whole_turns
from tests.drivers.dynamixel.parts import bench, bus_of, options_of, servo, spec
from tests.drivers.dynamixel.test_foreign import MS, Rig, assert_safe, rig, run_until_told
from tests.foreign import servo_line

SHADOW = servo_line.SHADOW
JOINT = [servo(1, shadow={"id": 2}), servo(3)]
OBEYS: dict[int, tuple[int, int]] = {SHADOW: (1, 1), 10: (1, 1)}


def joint(second: dict[int, tuple[int, int]] | None = None, **more: Any) -> Rig:
    """Return servos 1 and 2 on one joint, and 3 on its own."""
    return rig({}, OBEYS | (second or {}), {}, servos=JOINT, **more)


def test_both_motors_of_a_joint_get_the_goal_and_its_effort_counts_once() -> None:
    made = joint()
    made.enable()
    states: list[JointState] = []
    for _ in range(50):
        states, faults = made.cycle(0.2)
        assert not faults
        assert len(states) == 2
    first, second, alone = made.line.servos
    assert first.get(servo_line.GOAL_CURRENT, 2) == second.get(servo_line.GOAL_CURRENT, 2)
    single = alone.get(servo_line.GOAL_CURRENT, 2)
    assert first.get(servo_line.GOAL_CURRENT, 2) == pytest.approx(single / 2, abs=0.6)
    row = [math.nan] * len(made.driver.columns)
    made.driver.fill(row, 0)
    assert row == pytest.approx([0.2, 0.2], abs=0.01)
    assert states[0].valid
    made.driver.close()
    assert made.driver.unconfirmed == {}
    assert_safe(made)
    assert not any(each.get(servo_line.TORQUE, 1) for each in made.line.servos)


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        (SHADOW, 255, r"servo 2\): secondary id\(12\) 255 -> 1 \(it has to follow"),
        (SHADOW, 3, r"servo 2\): secondary id\(12\) 3 -> 1"),
        (10, 0, r"servo 2\): drive mode\(10\) 0 -> 1 \(it turns the other way than opposite"),
        (10, 9, r"servo 2\): drive mode\(10\) 9 -> 1 \(no torque by a goal alone"),
        (11, 3, r"servo 2\): operating mode\(11\) 3 \(position\) -> 0"),
        (20, 77, r"servo 2\): homing offset\(20\) 77 -> 0"),
        (36, 700, r"servo 2\): pwm limit\(36\) 700 -> 885 \(as servo 1"),
        (servo_line.CURRENT_LIMIT, 100, r"servo 2\): current limit\(38\) 100 -> 1193 \(as"),
        (60, 1, r"servo 2\): startup configuration\(60\) 1 -> 0"),
    ],
)
def test_a_shadow_that_is_set_otherwise_is_refused_and_configured(
    register: int, value: int, words: str
) -> None:
    size, _ = servo_line.EEPROM[register]
    with pytest.raises(DriverError, match=words):
        joint({register: (size, value)}).driver.open()
    made = joint({register: (size, value)}, configure=True)
    made.enable()
    made.driver.close()
    joint({each: made.line.servos[1].eeprom[each] for each in servo_line.EEPROM if each}).enable()


def test_a_shadow_of_another_model_is_refused() -> None:
    with pytest.raises(DriverError, match=r"servo 2\): is a XM430-W210"):
        joint({0: (2, 1030)}).driver.open()


def test_a_shadow_that_is_not_there_is_named() -> None:
    made = joint()
    made.line.servos[1].deaf = True
    with pytest.raises(DriverError, match=r"servo 2\): no answer at"):
        made.driver.open()


def test_an_axis_of_which_one_motor_is_not_heard_is_not_seen_and_a_dip_of_it_ends_the_run() -> None:
    made = joint()
    made.enable()
    assert all(state.valid for state in made.cycle()[0])
    made.line.servos[1].deaf = True
    assert [state.valid for state in made.cycle()[0]] == [False, True]
    made.line.servos[1].deaf = False
    assert all(state.valid for state in made.cycle()[0])
    made.line.servos[1].cut_power(made.clock.now_ns(), 50 * MS)
    told = run_until_told(made, 100)
    assert told.startswith("servo 2: torque enable(64) reads 0 instead of 1")
    made.driver.close()
    assert_safe(made)


def test_a_shadow_that_stays_on_is_named_by_its_axis() -> None:
    made = joint()
    made.enable()
    made.line.servos[1].deaf = True
    made.driver.close()
    assert "servo 2 did not confirm torque off" in made.driver.unconfirmed["master.a1"]


@pytest.mark.parametrize("read", ["sync", "fast_sync"])
@pytest.mark.parametrize("causality", ["impedance", "admittance"])
def test_a_joint_of_two_can_be_simulated(read: str, causality: str) -> None:
    given = servo(1, shadow={"id": 2})
    made = bench(spec(1, causality), servos=[given], read=read)
    made.enable()
    for _ in range(100):
        [state] = made.cycle(0.3)
    assert state.valid
    assert state.position > 0.0
    made.driver.write([AxisCommand(0.0, 0.0)])
    made.driver.close()
    assert not any(each.torque_on for each in made.world.servos)


def test_a_servo_listed_as_axis_and_as_shadow_is_refused() -> None:
    for given in (
        [servo(1, shadow={"id": 2}), servo(2)],
        [servo(1, shadow={"id": 1})],
        [servo(1, shadow={"id": 5}), servo(2, shadow={"id": 5})],
    ):
        with pytest.raises(ConfigError, match=r"is the shadow of servo .* list it once"):
            bench(*(spec(one["id"]) for one in given), servos=given)


def test_a_shadow_is_read_in_every_cycle_and_the_budget_counts_it() -> None:
    one, two = (budget(options_of(given), bus_of(spec(1))) for given in (servo(1), JOINT[0]))
    assert two.time_s - one.time_s == pytest.approx((1 + 21) * 10 / 4e6 / 0.8)


# -- servos nobody listed ------------------------------------------------------------------


@pytest.mark.parametrize("obeyed", [1, 3])
def test_a_servo_that_nobody_listed_and_that_obeys_one_of_ours_is_refused(obeyed: int) -> None:
    made = rig({}, {SHADOW: (1, obeyed)}, {}, servos=[servo(1), servo(3)])
    with pytest.raises(DriverError, match=f"servo 2 obeys id {obeyed} too .* shadow: {{id: 2}}"):
        made.driver.open()
    assert_safe(made)


def test_two_servos_that_answer_as_one_id_are_refused() -> None:
    made = rig({}, {7: (1, 1)}, servos=[servo(1)])
    made.line.servos[1].device = 1
    with pytest.raises(DriverError, match="two servos answer as id 1"):
        made.driver.open()


@pytest.mark.parametrize("second", [3, 255])
def test_servos_that_nobody_listed_and_that_obey_none_of_ours_are_left_alone(second: int) -> None:
    made = rig({}, {SHADOW: (1, second)}, servos=[servo(1)])
    before = bytes(made.line.servos[1].memory)
    made.enable()
    for _ in range(5):
        made.cycle()
    made.driver.close()
    assert bytes(made.line.servos[1].memory)[:120] == before[:120]


# -- whole turns ---------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [-3, -1, 0, 1, 7])
@pytest.mark.parametrize("direction", [1, -1])
def test_turns_counted_since_power_up_are_taken_off(turns: int, direction: int) -> None:
    made = rig({}, servos=[servo(1, direction=direction, zero_counts=100)])
    made.line.servos[0].turn = 150.0 + 4096.0 * turns
    made.enable()
    [state] = made.cycle(0.0)[0]
    assert state.position == pytest.approx(direction * 50 / 4096 * math.tau, abs=2e-3)
    said = any("taken off" in note for note in made.driver.notes)
    assert said == bool(turns)
    made.driver.close()


def test_turns_that_the_range_does_not_tell_apart_are_refused() -> None:
    made = rig({}, servos=[servo(1, gear_ratio=4.0)])
    made.line.servos[0].turn = 2048.0 + 4096.0 * 40
    with pytest.raises(DriverError, match=r"whole turns off.*switch the servo off and on"):
        made.driver.open()


@pytest.mark.parametrize(("gear", "doubted"), [(1.0, False), (4.0, True)])
def test_turns_that_the_range_leaves_open_are_said(gear: float, doubted: bool) -> None:
    """After a power-up a servo behind a gear of 4 may be a quarter turn of its axis further."""
    made = rig({}, servos=[servo(1, gear_ratio=gear)])
    made.line.servos[0].turn = 2048.0
    made.driver.open()
    said = [note for note in made.driver.notes if "loses whole turns (1.571)" in note]
    assert len(said) == doubted
    made.driver.close()


@pytest.mark.parametrize("gear", [0.5, 1.0, 9.0])
@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("zero", [0, 2048])
def test_whole_turns_against_their_definition(gear: float, direction: int, zero: int) -> None:
    """All numbers of turns are tried: those that bring the axis into its range."""
    given = servo(1, gear_ratio=gear, direction=direction, zero_counts=zero)
    [one] = match_servos(options_of(given), bus_of(spec(1)))
    scale = scale_of(one)
    for ends in ((-3.0, 3.0), (-0.1, 0.1), (0.5, 1.0), (2.0, 9.0)):
        for counts in range(-9000, 14_000, 333):

            def inside(turns: int, counts: int = counts, ends: tuple[float, float] = ends) -> bool:
                left = counts - 4096 * turns - zero
                return ends[0] <= direction * left * scale.position <= ends[1]

            fitting = [turns for turns in range(-60, 61) if inside(turns)]
            expected: int | None = 0
            if 0 not in fitting and fitting:
                expected = fitting[0] if len(fitting) == 1 else None
            assert whole_turns(scale, counts, ends) == expected


# -- what is read back after a gap ---------------------------------------------------------


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        (10, 1, "drive mode(10) reads 1 instead of 0"),
        (11, 1, "operating mode(11) reads 1 instead of 0"),
        (SHADOW, 2, "secondary id(12) reads 2 instead of 255"),
        (20, 512, "homing offset(20) reads 512 instead of 0"),
        (36, 100, "pwm limit(36) reads 100 instead of 885"),
        (servo_line.CURRENT_LIMIT, 5, "current limit(38) reads 5 instead of 1193"),
        (60, 3, "startup configuration(60) reads 3 instead of 0"),
        (63, 0, "shutdown(63) reads 0 instead of 52"),
        (servo_line.WATCHDOG, 0, "bus watchdog(98) reads 0 instead of 5"),
        (servo_line.WATCHDOG, -1, "its bus watchdog tripped"),
        (100, 20, "goal pwm(100) reads 20 instead of 885"),
    ],
)
@pytest.mark.parametrize(
    "baud",
    [4_000_000, pytest.param(1_000_000, marks=pytest.mark.slow)],  # no time is left there
)
def test_what_a_servo_holds_is_read_back_after_a_gap_before_it_is_seen(
    register: int, value: int, words: str, baud: int
) -> None:
    made = rig({}, {}, baud=baud)
    made.line.byte_ns = 10_000_000_000 // baud
    made.enable()
    made.cycle()
    other = made.line.servos[1]
    other.deaf = True
    for _ in range(30):
        made.cycle()
    other.deaf = False
    other.put(register, {10: 1, 11: 1, SHADOW: 1, 60: 1, 63: 1, 20: 4}.get(register, 2), value)
    if register == servo_line.WATCHDOG:
        other.put(register, 1, value)
        other.put(100, 2, 885)
    told, seen = "", False
    for _ in range(60):
        states, faults = made.cycle()
        seen |= states[1].valid
        told = next((fault.text for fault in faults if fault.fatal), "")
        if told:
            break
    assert words in told
    assert not seen
    made.driver.close()


def test_a_servo_that_forgot_nothing_is_seen_again_once_all_was_read() -> None:
    made = rig({}, {})
    made.enable()
    made.line.servos[1].deaf = True
    for _ in range(30):
        made.cycle()
    made.line.servos[1].deaf = False
    back = [made.cycle() for _ in range(30)]
    assert not any(faults for _, faults in back)
    assert not back[0][0][1].valid or made.line.byte_ns < 3000
    assert back[-1][0][1].valid
    assert all(states[0].valid for states, _ in back)
    made.driver.close()


# -- errors that are tolerated -------------------------------------------------------------

ERRORS = {"input_voltage": 0, "overheat": 2, "encoder": 3, "electrical_shock": 4, "overload": 5}


@pytest.mark.parametrize("status_block", [False, True])
@pytest.mark.parametrize("when", [pytest.param("before", marks=pytest.mark.slow), "in the run"])
@pytest.mark.parametrize(
    "name", ["overload", *(pytest.param(one, marks=pytest.mark.slow) for one in list(ERRORS)[:-1])]
)
def test_an_error_that_the_servo_does_not_stop_for_can_be_tolerated(
    name: str, when: str, status_block: bool
) -> None:
    bit = ERRORS[name]
    shutdown = {63: (1, 0x3D & ~(1 << bit))}

    def made_with(**more: Any) -> Rig:
        made = rig({}, shutdown, status_block=status_block, **more)
        if when == "before":
            made.line.servos[1].put(servo_line.ERROR, 1, 1 << bit)
        return made

    def run(made: Rig) -> tuple[str, list[str]]:
        made.enable()
        said: list[str] = []
        for _ in range(300):
            if when == "in the run":
                made.line.servos[1].put(servo_line.ERROR, 1, 1 << bit)
            states, faults = made.cycle()
            said += [fault.text for fault in faults if not fault.fatal]
            fatal = [fault.text for fault in faults if fault.fatal]
            if fatal:
                return fatal[0], said
            assert states[0].valid
        assert states[1].valid
        return "", said

    plain = made_with()
    with pytest.raises(DeviceFault) if when == "before" else pytest.MonkeyPatch.context():
        told, _ = run(plain)
        assert "its torque stays on (Shutdown(63) does not include this error)" in told
    plain.driver.close()
    made = made_with(tolerated_errors=[name])
    told, said = run(made)
    assert told == ""
    assert len(said) == 1
    assert "tolerated_errors names it" in said[0]
    other = 1 << (5 if bit != 5 else 2)
    made.line.servos[1].put(servo_line.ERROR, 1, 1 << bit | other)
    told = run_until_told(made, 250)
    assert "its torque is off until it is rebooted" in told
    made.driver.close()


def test_an_error_that_switches_torque_off_is_not_tolerated() -> None:
    made = rig({}, tolerated_errors=["overload", "input_voltage"])
    made.enable()
    assert any("without effect for overloaded for too long" in note for note in made.driver.notes)
    made.line.servos[0].put(servo_line.ERROR, 1, 1 << 5)
    assert "its torque is off until it is rebooted" in run_until_told(made, 5)
    made.driver.close()
