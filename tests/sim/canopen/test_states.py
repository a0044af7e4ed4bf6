"""The drive's own state machine against the table of CiA 402-2, transition by transition."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_sim.cia402 import State, StateMachine
from tests.sim.canopen.master import Master

SHUTDOWN, SWITCH_ON, ENABLE, NO_VOLTAGE, QUICK, RESET = 0x06, 0x07, 0x0F, 0x00, 0x02, 0x80
UP = (SHUTDOWN, SWITCH_ON, ENABLE)


def machine(*words: int, **options: int) -> StateMachine:
    made = StateMachine()
    made.restart()
    made.transitions.clear()
    for name, value in options.items():
        setattr(made, name, value)
    for word in words:
        made.control(word, 0)
    return made


@pytest.mark.parametrize(
    ("words", "last", "state"),
    [
        (UP[:1], 2, State.READY),
        (UP[:2], 3, State.SWITCHED_ON),
        (UP, 4, State.ENABLED),
        ((*UP, SHUTDOWN), 8, State.READY),
        ((*UP, NO_VOLTAGE), 9, State.SWITCH_ON_DISABLED),
        ((*UP[:2], SHUTDOWN), 6, State.READY),
        ((SHUTDOWN, NO_VOLTAGE), 7, State.SWITCH_ON_DISABLED),
        ((SHUTDOWN, QUICK), 7, State.SWITCH_ON_DISABLED),
        ((*UP[:2], NO_VOLTAGE), 10, State.SWITCH_ON_DISABLED),
        ((*UP[:2], QUICK), 10, State.SWITCH_ON_DISABLED),
        ((*UP, QUICK), 11, State.QUICK_STOP),
        ((*UP, QUICK, NO_VOLTAGE), 12, State.SWITCH_ON_DISABLED),
        ((SHUTDOWN, ENABLE), 4, State.ENABLED),  # 3 and 4 in one go
    ],
)
def test_commands(words: tuple[int, ...], last: int, state: State) -> None:
    made = machine(*words)
    assert (made.transitions[-1], made.state) == (last, state)


def test_power_on_goes_through_0_and_1() -> None:
    made = StateMachine()
    made.restart()
    assert made.transitions == [0, 1]
    assert made.state is State.SWITCH_ON_DISABLED


def test_disable_operation_waits_until_the_motor_stands() -> None:
    made = machine(*UP, SWITCH_ON)
    assert (made.transitions[-1], made.state, made.braking) == (5, State.ENABLED, "ramp")
    made.come_to_rest()
    assert made.state is State.SWITCHED_ON
    assert machine(*UP, SWITCH_ON, disable_option=0).state is State.SWITCHED_ON


@pytest.mark.parametrize("option", range(9))
def test_quick_stop_brakes_and_stays_or_leaves(option: int) -> None:
    made = machine(*UP, QUICK, quick_stop_option=option)
    braking = {0: "", 1: "ramp", 5: "ramp"}.get(option, "quick")
    assert made.braking == braking
    if option == 0:
        assert made.state is State.SWITCH_ON_DISABLED
        return
    made.come_to_rest()
    stays = option >= 5
    assert made.state is (State.QUICK_STOP if stays else State.SWITCH_ON_DISABLED)
    made.control(ENABLE, 0)
    if stays:
        assert (made.transitions[-1], made.state) == (16, State.ENABLED)


@pytest.mark.parametrize("words", [UP[:1], UP[:2], UP, (*UP, QUICK), ()])
def test_a_fault_ends_in_fault_and_takes_an_edge_to_leave(words: tuple[int, ...]) -> None:
    made = machine(*words, RESET) if words == () else machine(*words)
    made.fault()
    if made.state is State.FAULT_REACTION:
        assert made.braking == "quick"
        made.control(NO_VOLTAGE, 0)
        assert made.state is State.FAULT_REACTION
        made.come_to_rest()
    assert made.state is State.FAULT
    assert 13 in made.transitions
    if words == ():
        made.control(RESET, 0)  # was set before: no edge
        assert made.state is State.FAULT
    for word in (*UP, NO_VOLTAGE):
        made.control(word, 0)
        assert made.state is State.FAULT
    made.control(RESET, 0)
    assert (made.transitions[-1], made.state) == (15, State.SWITCH_ON_DISABLED)


def test_lost_voltage_is_at_once() -> None:
    made = machine(*UP, QUICK)
    made.drop()
    assert (made.state, made.braking) == (State.SWITCH_ON_DISABLED, "")


def test_slow_transitions_take_their_time_one_by_one() -> None:
    made = StateMachine(delay_ns=1000)
    made.restart()
    made.control(SHUTDOWN, 0)
    assert made.state is State.SWITCH_ON_DISABLED
    assert made.next_event_ns() == 1000
    made.control(ENABLE, 500)
    made.run(1000)
    assert made.state is State.READY
    made.run(2000)
    assert made.state is State.SWITCHED_ON
    made.run(3000)
    assert made.state is State.ENABLED
    assert made.next_event_ns() is None


@given(st.lists(st.tuples(st.integers(0, 0xFFFF), st.integers(0, 3)), max_size=40))
def test_no_word_leads_where_no_transition_does(steps: list[tuple[int, int]]) -> None:
    allowed = {
        (State.SWITCH_ON_DISABLED, State.READY),
        (State.READY, State.SWITCHED_ON),
        (State.READY, State.ENABLED),  # 3 and 4
        (State.SWITCHED_ON, State.ENABLED),
        (State.ENABLED, State.SWITCHED_ON),
        (State.SWITCHED_ON, State.READY),
        (State.ENABLED, State.READY),
        (State.ENABLED, State.QUICK_STOP),
        (State.QUICK_STOP, State.ENABLED),
        (State.FAULT, State.SWITCH_ON_DISABLED),
        (State.FAULT_REACTION, State.FAULT),
    }
    made = machine()
    for word, what in steps:
        before = made.state
        if what == 0:
            made.control(word, 0)
        elif what == 1:
            made.control(word & 0x8F, 0)
        elif what == 2:
            made.come_to_rest()
        else:
            made.fault()
            assert made.state in (State.FAULT, State.FAULT_REACTION)
            continue
        drops = made.state is State.SWITCH_ON_DISABLED and before not in (
            State.FAULT,
            State.FAULT_REACTION,
        )
        assert made.state is before or drops or (before, made.state) in allowed


def test_the_statusword_of_every_state() -> None:
    node = Master((1,))
    node.bring_up()
    drive = node.device().drive
    for state in State:
        drive.machine.state = state
        assert drive.statusword() & 0x6F == int(state)
        assert bool(drive.statusword() & 0x1000) == (state is State.ENABLED)
    drive.lose_voltage()
    assert not drive.statusword() & 0x10


@pytest.mark.parametrize("segments", [("0B6400",), ("0C64", "1D00")])
def test_a_command_written_in_segments_acts_with_the_last_one(segments: tuple[str, ...]) -> None:
    node = Master()
    node.bring_up()
    for _ in range(3):
        node.torque(50)
    motor = node.device().drive.motor
    node.ask("601#2171600002000000")
    for segment in segments:
        assert motor.torque_counts == 50
        node.ask(f"601#{segment:0<16}")
    assert motor.torque_counts == 100
