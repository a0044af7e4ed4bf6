"""The driver before servos that were written apart from it: power cycles, shadows, torque lost."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from tautwave.clock import FakeClock
from tautwave.errors import DeviceFault, DriverError
from tautwave.types import AxisCommand, Fault, JointState
from tautwave_drivers.dynamixel import driver as driver_module
from tautwave_drivers.dynamixel import plugin
from tests.drivers.dynamixel.parts import block, bus_of, servo, spec
from tests.foreign import servo_line
from tests.foreign.servo_line import ServoLine

MS = 1_000_000
DIPS = pytest.mark.parametrize(
    "dip_ms", [50, *(pytest.param(each, marks=pytest.mark.slow) for each in (500, 5000))]
)
EVERY = pytest.mark.parametrize("every", [12, pytest.param(1, marks=pytest.mark.slow)])
"""Which of the moments are tried."""


class Rig(NamedTuple):
    driver: Any
    line: ServoLine
    clock: FakeClock
    period_ns: int

    def enable(self) -> None:
        self.driver.open()
        for _ in range(3000):
            if self.driver.enable_step():
                return
            self.clock.sleep_until(self.clock.now_ns() + self.period_ns)
        raise AssertionError("never enabled")

    def cycle(self, effort: float = 0.1) -> tuple[list[JointState], list[Fault]]:
        began = self.clock.now_ns()
        self.driver.request()
        states = list(self.driver.read(began + self.period_ns * 8 // 10))
        self.driver.write([AxisCommand(effort, 0.0)] * len(states))
        self.clock.sleep_until(began + self.period_ns)
        return states, list(self.driver.faults())


def rig(*registers: dict[int, tuple[int, int]], rate_hz: float = 1000.0, **more: Any) -> Rig:
    registers = registers or ({}, {})
    clock = FakeClock(1_000_000_000)
    ids = range(1, len(registers) + 1)
    line = ServoLine(
        clock, *(servo_line.Servo(one, each) for one, each in zip(ids, registers, strict=True))
    )
    configure = more.pop("configure", False)
    unwatched = more.pop("allow_unwatched", False)
    given = more.pop("servos", [servo(one) for one in ids])
    axes = [spec(one["id"]) for one in given]
    bus = bus_of(*axes, configure=configure)._replace(rate_hz=rate_hz, allow_unwatched=unwatched)
    options = plugin.options.model_validate(block(*given, **more))
    return Rig(plugin.make(options, bus, clock, line), line, clock, round(1e9 / rate_hz))


def run_until_told(made: Rig, cycles: int) -> str:
    """Run as the loop does, until a fault ends it; return it, '' if none came."""
    for _ in range(cycles):
        _, faults = made.cycle()
        fatal = [fault.text for fault in faults if fault.fatal]
        if fatal:
            return fatal[0]
    return ""


def whole_run(made: Rig, cycles: int) -> str:
    """Bring up, run, leave; return why it ended early, '' if it did not."""
    try:
        made.enable()
    except DriverError as err:
        return str(err)
    else:
        return run_until_told(made, cycles)
    finally:
        made.driver.close()


def assert_safe(made: Rig, *, left: bool = True) -> None:
    """What the devices themselves saw: none was driven without its watchdog, none is left on."""
    for each in made.line.servos:
        assert not each.unguarded
        assert not each.came_on_unwatched
        if left and made.driver.unconfirmed == {}:
            assert not each.get(servo_line.TORQUE, 1)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_a_servo_that_answers_less_is_told_to_answer_all(level: int) -> None:
    made = rig({servo_line.LEVEL: (1, level)})
    made.enable()
    assert made.line.servos[0].get(servo_line.LEVEL, 1) == 2
    made.driver.close()


def test_a_servo_that_rejects_to_answer_all_is_refused_before_anything_else_is_written() -> None:
    made = rig({})
    (one,) = made.line.servos
    taken: list[int] = []

    def write(at: int, data: bytes) -> int:
        if at == servo_line.LEVEL:
            return servo_line.RANGE
        taken.append(at)
        return 0

    one.write = write  # type: ignore[method-assign]
    with pytest.raises(DriverError, match=r"status return level\(68\) rejects 2: .*range"):
        made.driver.open()
    assert not taken


def test_it_runs_them() -> None:
    made = rig()
    assert whole_run(made, 200) == ""
    assert made.line.servos[0].turn > 2100.0
    assert_safe(made)


def cut_power_at(made: Rig, victim: servo_line.Servo, number: int, dip_ms: int) -> None:
    """Cut a servo's power before the host's instruction with this number."""

    def hit(count: int) -> None:
        if count == number:
            victim.cut_power(made.clock.now_ns(), dip_ms * MS)

    made.line.on_instruction = hit


def instructions_of_bring_up() -> int:
    made = rig()
    made.enable()
    return made.line.instructions


@pytest.mark.parametrize("status_block", [False, pytest.param(True, marks=pytest.mark.slow)])
@DIPS
@EVERY
def test_a_power_cycle_at_each_moment_of_bring_up_is_refused_or_harmless(
    every: int, dip_ms: int, status_block: bool
) -> None:
    """Where it changes nothing (torque was off and nothing set yet) the run goes on as if new."""
    refused = 0
    for number in range(0, instructions_of_bring_up(), every if dip_ms == 50 else 5 * every):
        made = rig(status_block=status_block)
        victim = made.line.servos[1]
        cut_power_at(made, victim, number, dip_ms)
        ended = whole_run(made, 60)
        refused += bool(ended)
        assert_safe(made)
        assert victim.limp_goals <= 1, (number, ended)
        if not ended:
            assert victim.turn > 2048.0, "it was driven to the end"
    assert refused * every > 10


@pytest.mark.parametrize("rate_hz", [1000.0, 100.0, 50.0, 20.0])
@pytest.mark.parametrize("dip_ms", [21, 50, 80])
def test_a_servo_that_comes_back_while_torque_is_switched_on_does_not_come_on_unwatched(
    rate_hz: float, dip_ms: int
) -> None:
    """Also while another bus is brought up, between its own bring-up and its first step."""
    before = rig(rate_hz=rate_hz, watchdog_s=0.5)
    before.driver.open()
    opened = before.line.instructions
    refused = 0
    for number in range(opened - 1, opened + 9):
        made = rig(rate_hz=rate_hz, watchdog_s=0.5)
        cut_power_at(made, made.line.servos[1], number, dip_ms)
        made.driver.open()
        if number % 2:
            made.clock.sleep_until(made.clock.now_ns() + 200 * MS)
        try:
            enable_steps(made, 20 + 150 * MS // made.period_ns)
        except DeviceFault as err:
            assert "instead of" in str(err)  # noqa: PT017
            refused += 1
        made.driver.close()
        assert_safe(made)
    assert refused > 5


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 50.0, 90.0, 100.0, 1000.0])
def test_torque_comes_on_at_every_rate_although_orders_are_lost(rate_hz: float) -> None:
    made = rig({}, {}, {}, rate_hz=rate_hz, watchdog_s=1.0)
    made.driver.open()
    opened = made.line.instructions

    def lose(count: int) -> None:
        made.line.servos[2].deaf = opened + 2 < count < opened + 13

    made.line.on_instruction = lose
    for _ in range(100):
        if made.driver.enable_step():
            break
        made.clock.sleep_until(made.clock.now_ns() + made.period_ns)
    assert all(each.get(servo_line.TORQUE, 1) for each in made.line.servos)
    assert run_until_told(made, 20) == ""
    made.driver.close()
    assert_safe(made)


@pytest.mark.parametrize("led", [True, False])
def test_a_servo_without_a_watchdog_that_restarts_before_torque_is_told(led: bool) -> None:
    """At each instruction from the marker on: torque that is off says nothing then."""

    def made(at: int) -> tuple[Rig, servo_line.Servo]:
        made = rig({6: (1, 37)}, rate_hz=200.0, allow_unwatched=True)
        victim = made.line.servos[0]
        if not led:  # as the XW models
            victim.read = without_led(victim.read)  # type: ignore[method-assign]

        def strike(count: int) -> None:
            if count == at:
                victim.cut_power(made.clock.now_ns(), 0)

        made.line.on_instruction = strike
        return made, victim

    whole, victim = made(-1)
    whole.driver.open()
    opened = whole.line.instructions
    assert victim.get(servo_line.LED, 1) == led
    whole.driver.close()
    told = []
    for number in range(opened - 8, opened + 5):
        each, victim = made(number)
        told.append(whole_run(each, 3))
        assert each.line.instructions > number
        assert not victim.get(servo_line.TORQUE, 1)
        assert not victim.get(servo_line.LED, 1)
    assert all(told) is led, told
    assert (
        any("led(65) reads 0 instead of 1: it was switched off and on" in one for one in told)
        is led
    )


def without_led(read: Callable[[int, int], bytes]) -> Callable[[int, int], bytes]:
    return lambda address, size: b"" if address == servo_line.LED else read(address, size)


@pytest.mark.parametrize("rate_hz", [1000.0, pytest.param(100.0, marks=pytest.mark.slow), 20.0])
@pytest.mark.parametrize("status_block", [False, True])
@DIPS
@EVERY
def test_a_power_cycle_in_a_run_is_a_fault_of_that_device(
    every: int, dip_ms: int, status_block: bool, rate_hz: float
) -> None:
    moments = [*range(50), *random.Random(3).sample(range(50, 300), 20)]
    if dip_ms > 50 or rate_hz < 1000.0:
        moments = moments[:: 7 if dip_ms < 5000 else 23]
    for moment in moments[::every]:
        made = rig(rate_hz=rate_hz, status_block=status_block, watchdog_s=0.3)
        made.enable()
        victim = made.line.servos[1]
        for _ in range(moment):
            _, faults = made.cycle()
            assert not faults
        # Anywhere in the period, not only at its ends.
        cut_ns = made.clock.now_ns() + made.period_ns * (moment % 5) // 5
        pending = [cut_ns]

        def strike(now_ns: int, pending: Any = pending, victim: Any = victim) -> None:
            if pending and now_ns >= pending[0]:
                victim.cut_power(pending.pop(), dip_ms * MS)

        made.line.on_advance = strike
        told = run_until_told(made, int(dip_ms * rate_hz / 1000.0) + 40)
        assert "torque enable(64) reads 0 instead of 1" in told, (moment, told)
        assert victim.limp_goals <= 2, moment
        made.driver.close()
        assert_safe(made)


def test_no_sample_of_a_servo_that_may_have_forgotten_is_used() -> None:
    made = rig()
    made.enable()
    made.cycle()
    made.line.servos[1].cut_power(made.clock.now_ns(), 50 * MS)
    for _ in range(80):
        states, faults = made.cycle()
        assert not states[1].valid
        if any(fault.fatal for fault in faults):
            break
    else:
        raise AssertionError("never told")


def test_a_servo_that_was_only_off_the_line_goes_on() -> None:
    made = rig()
    made.enable()
    made.cycle()
    victim = made.line.servos[1]
    victim.deaf = True
    for _ in range(40):
        made.cycle()
    victim.deaf = False
    back = [made.cycle() for _ in range(10)]
    assert not any(faults for _, faults in back)
    assert back[-1][0][1].valid
    made.driver.close()
    assert_safe(made)


@pytest.mark.parametrize("dead", [0, 1, 2])
@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 40.0, 50.0, 100.0, 500.0])
def test_a_dead_servo_costs_no_sample_of_the_others_at_any_rate(rate_hz: float, dead: int) -> None:
    """Where a period is longer than a restart takes, the others are read in each of them."""
    made = rig({}, {}, {}, rate_hz=rate_hz, watchdog_s=2.5)
    made.enable()
    made.cycle()
    made.line.servos[dead].deaf = True
    for _ in range(20):
        states, faults = made.cycle()
        assert [state.valid for state in states] == [index != dead for index in range(3)]
        assert not faults
    made.line.servos[dead].deaf = False
    for _ in range(10):
        states, faults = made.cycle()
        assert not faults
    assert all(state.valid for state in states)
    made.driver.close()
    assert_safe(made)


@pytest.mark.parametrize("dead", [0, 1, 2])
@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 40.0])
def test_a_servo_that_dies_within_a_cycle_costs_one_sample_of_the_others(
    rate_hz: float, dead: int
) -> None:
    for number in range(6):
        made = rig({}, {}, {}, rate_hz=rate_hz, watchdog_s=2.5)
        made.enable()
        made.cycle()
        until = made.line.instructions + number

        def hit(count: int, made: Rig = made, until: int = until) -> None:
            if count == until:
                made.line.servos[dead].deaf = True

        made.line.on_instruction = hit
        made.cycle()
        for _ in range(15):
            states, faults = made.cycle()
            assert [state.valid for state in states] == [index != dead for index in range(3)]
            assert not faults
        made.driver.close()


@pytest.mark.parametrize("status_block", [False, True])
@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        (servo_line.TORQUE, 0, "torque enable(64) reads 0 instead of 1"),
        (servo_line.WATCHDOG, 0, "bus watchdog(98) reads 0 instead of 5"),
        (servo_line.WATCHDOG, 9, "bus watchdog(98) reads 9 instead of 5"),
        (servo_line.WATCHDOG, -1, "its bus watchdog tripped"),
    ],
)
def test_what_reads_otherwise_than_it_was_set_is_a_fault_whenever_it_is_read(
    register: int, value: int, words: str, status_block: bool
) -> None:
    made = rig(status_block=status_block)
    made.enable()
    for _ in range(5):
        made.cycle()
    made.line.servos[1].put(register, 1, value)
    if not status_block:  # nothing but a look shows it
        made.clock.sleep_until(made.clock.now_ns() + 101 * MS)
        for each in made.line.servos:
            each.heard_ns = made.clock.now_ns()
    told = run_until_told(made, 10)
    assert words in told
    made.driver.close()


def test_a_watchdog_that_another_program_wrote_while_enabling_is_a_fault() -> None:
    made = rig()
    made.driver.open()
    made.line.servos[0].put(servo_line.WATCHDOG, 1, 0)
    with pytest.raises(DeviceFault, match=r"bus watchdog\(98\) reads 0 instead of 5"):
        enable_steps(made, 100)


def enable_steps(made: Rig, count: int) -> None:
    for _ in range(count):
        made.driver.enable_step()
        made.clock.sleep_until(made.clock.now_ns() + made.period_ns)


@pytest.mark.parametrize("shadow", [0, 1, 7, 252])
def test_a_servo_that_obeys_a_second_id_is_refused_and_configure_ends_it(shadow: int) -> None:
    registers = {servo_line.SHADOW: (1, shadow)}
    with pytest.raises(
        DriverError, match=rf"servo 2\): secondary id\(12\) {shadow} -> 255 \(until"
    ):
        rig({}, registers).driver.open()
    made = rig({}, registers, configure=True)
    made.enable()
    assert made.line.servos[1].get(servo_line.SHADOW, 1) == 255
    made.driver.close()


@pytest.mark.parametrize(
    ("register", "wrong", "right", "words"),
    [
        (10, 8, 0, r"drive mode\(10\) 8 -> 0 \(no torque by a goal alone"),
        (
            10,
            9,
            0,
            r"drive mode\(10\) 9 -> 0 \(it turns the other way than reverse_mode of the rig",
        ),
        (10, 1, 0, r"drive mode\(10\) 1 -> 0 \(it turns the other way"),
        (20, -1024, 0, r"homing offset\(20\) -1024 -> 0 \(as homing_offset of the rig"),
        (11, 3, 0, r"operating mode\(11\) 3 \(position\) -> 0 \(current\)"),
        (servo_line.SHADOW, 3, 255, r"secondary id\(12\) 3 -> 255"),
        (36, 0, 885, r"pwm limit\(36\) 0 -> 885 \(its motor gets no voltage"),
        (60, 1, 0, r"startup configuration\(60\) 1 -> 0 \(else torque or old goals"),
        (60, 3, 0, r"startup configuration\(60\) 3 -> 0 "),
    ],
)
def test_what_changes_who_obeys_what_is_refused_by_name_and_written_back(
    register: int, wrong: int, right: int, words: str
) -> None:
    size, _ = servo_line.EEPROM[register]
    registers = {register: (size, wrong)}
    with pytest.raises(DriverError, match=words):
        rig({}, registers).driver.open()
    made = rig({}, registers, configure=True)
    made.enable()
    assert made.line.servos[1].get(register, size) == right
    made.line.servos[1].unguarded = False  # it came on by itself, before anybody asked
    for _ in range(100):
        made.cycle()
    assert made.line.servos[1].turn > 2060.0, "it obeys"
    made.driver.close()
    assert_safe(made)


def test_a_goal_pwm_that_another_program_left_is_taken_back() -> None:
    made = rig()
    made.line.servos[1].put(100, 2, 0)
    assert whole_run(made, 100) == ""
    assert made.line.servos[1].turn > 2060.0


@pytest.mark.parametrize(
    ("register", "value", "words"),
    [
        (36, 300, "pwm limit(36) is 300 of 885: its motor gets at most 34 % of the supply"),
    ],
)
def test_what_may_be_meant_is_said(register: int, value: int, words: str) -> None:
    size, _ = servo_line.EEPROM[register]
    made = rig({}, {register: (size, value)})
    made.enable()
    assert any(f"servo 2): {words}" in note for note in made.driver.notes)
    made.driver.close()


@pytest.mark.parametrize("none", [253, 254, 255])
def test_a_second_id_that_is_none_is_fine(none: int) -> None:
    made = rig({}, {servo_line.SHADOW: (1, none)})
    assert whole_run(made, 5) == ""


def test_on_a_slow_bus_the_reads_in_each_period_are_in_the_budget() -> None:
    options = plugin.options.model_validate(block(servo(1), servo(2)))
    bus = bus_of(spec(1), spec(2))
    fast, slow = (plugin.budget(options, bus._replace(rate_hz=rate)) for rate in (1000.0, 40.0))
    reads = 2 * (14 + 11 + 7) * 10 / 4e6 / 0.8  # of 2 servos, in 80 % of the period
    assert slow.time_s == pytest.approx(fast.time_s + reads)
    assert "2 x 0.080 ms to check that none did" in slow.arithmetic
    block_of = options.model_copy(update={"status_block": True})
    assert "none did" not in plugin.budget(block_of, bus._replace(rate_hz=40.0)).arithmetic


# -- leaving ---------------------------------------------------------------------------------


def running() -> Rig:
    made = rig()
    made.enable()
    for _ in range(20):
        made.cycle()
    return made


def test_a_servo_that_says_it_is_still_on_is_not_taken_for_off() -> None:
    made = running()
    stubborn = made.line.servos[1]
    write = stubborn.write
    stubborn.write = lambda at, data: 0 if at == servo_line.TORQUE else write(at, data)  # type: ignore[method-assign]
    made.driver.close()
    assert made.driver.unconfirmed == {
        "master.a2": "servo 2 did not confirm torque off: torque enable(64) still reads 1"
    }
    assert stubborn.get(servo_line.WATCHDOG, 1) == 5, "it stays armed"
    assert not made.line.servos[0].get(servo_line.TORQUE, 1)


def test_a_servo_that_is_back_within_half_a_second_is_told_again() -> None:
    made = running()
    victim = made.line.servos[1]
    victim.deaf = True
    back_ns = made.clock.now_ns() + 350 * MS

    def listen(now_ns: int) -> None:
        victim.deaf = now_ns < back_ns

    made.driver.disable()
    assert "no answer" in made.driver.unconfirmed["master.a2"]
    made.line.on_advance = listen
    made.driver.close()
    assert made.driver.unconfirmed == {}
    assert_safe(made)


def test_the_second_try_ends_after_half_a_second() -> None:
    made = running()
    for each in made.line.servos:
        each.deaf = True
    made.driver.disable()
    began = made.clock.now_ns()
    made.driver.close()
    assert made.clock.now_ns() - began < 700 * MS
    assert list(made.driver.unconfirmed) == ["master.a1", "master.a2"]


class Adapter:
    """A serial port to a line, until it is pulled out."""

    def __init__(self, line: ServoLine) -> None:
        self._line = line
        self.gone = False

    def __getattr__(self, name: str) -> Any:
        if self.gone and name in ("write", "read"):
            raise DriverError("/dev/ttyUSB0: the adapter was unplugged")
        return getattr(self._line, name)


def test_a_port_that_was_lost_is_opened_anew_for_torque_off(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    base = rig()
    adapters: list[Adapter] = []

    def open_port(path: str, baud: int) -> Adapter:
        adapters.append(Adapter(base.line))
        return adapters[-1]

    monkeypatch.setattr(driver_module, "SerialPort", open_port)
    options = plugin.options.model_validate(block(servo(1), servo(2), port="/dev/ttyUSB0"))
    driver = plugin.make(options, base.driver._bus, base.clock, None)
    made = base._replace(driver=driver)
    made.enable()
    for _ in range(20):
        made.cycle()
    adapters[0].gone = True
    _, faults = made.cycle()
    assert faults[0].fatal
    driver.disable()
    assert list(driver.unconfirmed) == ["master.a1", "master.a2"]
    driver.close()
    assert len(adapters) == 2
    assert driver.unconfirmed == {}
    assert_safe(made)


# -- somebody else's words -------------------------------------------------------------------


def of_servo(number: int) -> Callable[[bytes], bytes]:
    return lambda frame: servo_line.packet(number, frame[7:-2])


SPOILT: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "checksum": (
        lambda frame: frame[:-1] + bytes((frame[-1] ^ 1,)),
        "all with a wrong checksum; check cable",
    ),
    "another servo": (of_servo(9), "all of servo 9, which was not asked"),
    "length": (
        lambda frame: servo_line.packet(frame[4], frame[7:-3]),
        "all of another length; is another program on the line",
    ),
    "twice": (lambda frame: frame + frame, "all from two servos with one id"),
    "another protocol": (
        lambda frame: b"\xff\xff\x01\x04\x00\x20\x03\xd7",
        "all no packets of protocol 2.0; check baud; servos of other makers",
    ),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_wrong_answers_are_counted_and_named(kind: str) -> None:
    made = rig({})
    made.enable()
    for _ in range(5):
        made.cycle()
    assert made.driver.misses == {}
    made.line.spoil, words = SPOILT[kind]
    for _ in range(12):
        states, _ = made.cycle()
        assert not states[0].valid
    said = made.driver.misses["master.a1"]
    assert words in said
    assert re.match(r"servo 1: 1[12] answers, ", said)
    made.line.spoil = bytes
    for _ in range(3):
        made.cycle()
    assert made.driver.misses == {}
    made.driver.close()


def test_a_servo_that_is_silent_says_nothing_wrong() -> None:
    made = rig()
    made.enable()
    made.line.servos[1].deaf = True
    for _ in range(12):
        made.cycle()
    assert made.driver.misses == {}
    made.driver.close()
