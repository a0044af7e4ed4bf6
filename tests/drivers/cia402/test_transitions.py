"""The machine against a drive written from the standard's diagram: every arrow, no surprises."""

from __future__ import annotations

import pytest

from tautwave_drivers.cia402.modes import Mode
from tautwave_drivers.cia402.routes import ROUTES, Route
from tautwave_drivers.cia402.states import TRANSITIONS, State, command_text, decode
from tautwave_drivers.cia402.terms import DisableMethod, Goal, Quirks
from tests.drivers.cia402.bench import QUICK, Bench
from tests.drivers.cia402.reference_drive import ARROWS, WORDS, Drive


def test_bring_up_sends_the_words_of_the_standard_in_order() -> None:
    bench = Bench(Drive())
    bench.come_up()
    order = list(dict.fromkeys(bench.words))
    assert order == [0x0000, 0x0006, 0x0007, 0x000F]
    assert bench.machine.done
    assert not bench.events


def test_every_one_of_the_16_transitions_is_taken() -> None:
    taken: set[int] = set()

    bench = Bench(Drive())
    bench.come_up()  # 1 2 3 4
    bench.machine.disable(DisableMethod.RAMP)  # 5 6 7
    bench.until(lambda: bench.machine.done)
    bench.come_up()
    bench.machine.disable(DisableMethod.SHUTDOWN)  # 8 7
    bench.until(lambda: bench.machine.done)
    bench.come_up()
    bench.machine.disable(DisableMethod.COAST)  # 9
    bench.until(lambda: bench.machine.done)
    bench.machine.enable(Mode.CSV)
    bench.until(lambda: bench.drive.state == "on")
    bench.machine.disable()  # 10
    bench.until(lambda: bench.machine.done)
    bench.come_up()
    bench.machine.quick_stop()  # 11, then 12 by itself
    bench.until(lambda: bench.drive.state == "stop")
    bench.until(lambda: bench.drive.state == "disabled")
    bench.machine.enable(Mode.CST)
    bench.drive.fail()  # 13 14, and 15 by the machine
    bench.until(lambda: bench.machine.commanding)
    taken |= bench.drive.taken

    bench = Bench(Drive(option=6), Quirks(quick_stop_option=6, resume=True, timeouts=QUICK))
    bench.come_up()
    bench.machine.quick_stop()
    bench.until(lambda: bench.drive.state == "stop")
    bench.come_up()  # 16
    assert bench.drive.taken == {1, 2, 3, 4, 11, 16}
    taken |= bench.drive.taken

    assert taken == set(range(1, 17))


def test_the_table_of_transitions_is_that_of_the_reference() -> None:
    names = {name: decode(word | 0x20 * (name in ("ready",))) for name, word in WORDS.items()}
    ours = {(entry.source, entry.target): entry.number for entry in TRANSITIONS if entry.source}
    assert ours == {(names[a], names[b]): number for (a, b), number in ARROWS.items()}


@pytest.mark.parametrize("route", ROUTES, ids=lambda route: route.value)
def test_every_route_leads_from_every_state_to_its_goal(route: Route) -> None:
    assert set(ROUTES[route]) == set(State)
    by_itself = {entry.source: entry.target for entry in TRANSITIONS if entry.command is None}
    by_itself[State.UNKNOWN] = State.NOT_READY
    for start, step in ROUTES[route].items():
        if step.transition is not None:
            entry = TRANSITIONS[step.transition]
            assert (entry.number, entry.source) == (step.transition, start)
            assert step.command == entry.command
        state, taken = start, [0]
        while not (step := ROUTES[route][state]).reached:
            if route is Goal.ENABLE and taken[-1] == 4:
                break
            assert len(taken) < 8, f"from {start} in circles: {taken}"
            number = step.transition
            state = by_itself[state] if number is None else TRANSITIONS[number].target
            taken.append(number or 0)


@pytest.mark.parametrize("option", [0, 1, 4, 5, 8, None, -1])
@pytest.mark.parametrize("resume", [False, True])
def test_quick_stop_is_left_the_way_the_option_code_allows(
    option: int | None, resume: bool
) -> None:
    real = 2 if option is None or option < 1 else option
    quirks = Quirks(quick_stop_option=option, resume=resume, timeouts=QUICK)
    bench = Bench(Drive(option=real, stop_time=20), quirks)
    bench.come_up()
    bench.machine.quick_stop()
    bench.until(lambda: bench.drive.state == "stop")
    begin = len(bench.words)
    bench.come_up()
    assert (16 in bench.drive.taken) == (resume and option in (5, 8))
    waited = bench.words[begin : begin + 15]
    if option in (1, 4):
        assert set(waited) == {0x02}, "voltage cut before the drive had come to rest"
    elif not (resume and option in (5, 8)):
        assert waited[0] == 0x00


def test_a_drive_found_enabled_is_taken_out_before_it_is_used() -> None:
    bench = Bench(Drive(state="enabled", display=10))
    bench.machine.enable(10)
    bench.cycle()
    assert bench.machine.mode_wanted == 10, "an enabled drive is asked for the mode it is in"
    bench.until(lambda: bench.machine.commanding)
    assert bench.drive.taken == {5, 4}
    assert not bench.events


def test_change_of_mode_disables_confirms_and_clears_halt() -> None:
    bench = Bench(Drive(mode_delay=9))
    bench.come_up(Mode.PV)
    bench.machine.halt(True)
    assert not bench.machine.commanding
    assert bench.cycle() == 0x10F
    bench.machine.enable(Mode.CST)
    assert not bench.machine.commanding
    seen = len(bench.words)
    bench.until(lambda: bench.machine.commanding)
    assert not any(word & 0x100 for word in bench.words[seen:])
    assert bench.drive.enabled_in == [Mode.PV, Mode.CST]


def test_halt_keeps_the_drive_enabled_but_commands_stop() -> None:
    bench = Bench(Drive())
    bench.come_up(Mode.PV)
    bench.machine.halt(True)
    for _ in range(5):
        assert bench.cycle() == 0x10F
        assert not bench.machine.commanding
    bench.machine.halt(False)
    assert bench.cycle() == 0x0F
    assert bench.machine.commanding


def test_bits_of_the_mode_flow_only_when_commanding_and_only_its_own() -> None:
    bench = Bench(Drive())
    bench.machine.enable(Mode.PP)
    while not bench.machine.commanding:
        assert bench.cycle(mode_bits=0xFF70) & 0x70 in (0, 0x70)
    assert bench.words[-1] == 0x0F | 0x70 | 0x300
    bench.machine.enable(Mode.CST)
    while not bench.machine.commanding:
        bench.cycle(mode_bits=0x70)
    assert bench.words[-1] == 0x0F


def test_fault_reset_is_an_edge_taken_back_and_given_again() -> None:
    bench = Bench(Drive(state="fault", resets_needed=2))
    bench.machine.enable(10)
    bench.until(lambda: bench.drive.state == "disabled")
    bits = [bool(word & 0x80) for word in bench.words]
    rises = [i for i in range(1, len(bits)) if bits[i] and not bits[i - 1]]
    assert len(rises) == 2
    assert not bits[0], "bit 7 has to be seen low first"
    bench.cycle()
    assert not bench.words[-1] & 0x80
    bench.until(lambda: bench.machine.commanding)
    assert [event.fatal for event in bench.events] == [False, False]
    assert bench.events[1].text.endswith("reset 2 of 3")


def test_states_of_every_statusword() -> None:
    known = {0x21: State.READY, 0x23: State.SWITCHED_ON, 0x27: State.OPERATION_ENABLED}
    known[0x07] = State.QUICK_STOP_ACTIVE
    loose = {0x00: State.NOT_READY, 0x40: State.SWITCH_ON_DISABLED, 0x08: State.FAULT}
    loose[0x0F] = State.FAULT_REACTION_ACTIVE
    for word in range(0x10000):
        expected = known.get(word & 0x6F) or loose.get(word & 0x4F) or State.UNKNOWN
        assert decode(word) is expected, hex(word)


def test_words_of_commands() -> None:
    assert command_text(0x000F) == "0x000F (enable operation)"
    assert command_text(0x010F) == "0x010F (enable operation, halt)"
    assert command_text(0x0006) == "0x0006 (shutdown)"
    assert command_text(0x0002) == "0x0002 (quick stop)"
    assert command_text(0x0080) == "0x0080 (fault reset)"
    assert command_text(0x0000) == "0x0000 (disable voltage)"


def test_python_canopen_knows_the_same_states_and_transitions() -> None:
    their = pytest.importorskip("canopen.profiles.p402").State402
    for word in range(0x10000):
        named = [name for name, (mask, value) in their.SW_MASK.items() if word & mask == value]
        state = decode(word)
        assert named == ([] if state is State.UNKNOWN else [state.value])
    for entry in TRANSITIONS:
        if entry.source is not None:
            command = their.TRANSITIONTABLE[entry.source.value, entry.target.value]
            assert (entry.command or 0) == command


def test_a_mode_is_not_changed_while_an_enabling_word_may_be_under_way() -> None:
    bench = Bench(Drive())
    bench.machine.enable(Mode.CST)
    bench.until(lambda: bench.words[-1:] == [0x0F])
    bench.machine.enable(Mode.CSP)  # the last statusword still says SWITCHED ON
    for now in range(bench.now, bench.now + 2 * QUICK.edge):
        assert bench.machine.step(0x0233, Mode.CST, now) == 0x07
        assert bench.machine.mode_wanted == Mode.CST
    bench.machine.step(0x0233, Mode.CST, bench.now + 2 * QUICK.edge)
    assert bench.machine.mode_wanted == Mode.CSP
