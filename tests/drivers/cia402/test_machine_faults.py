"""What a machine tells of drives that hang or fall, and what it does then."""

from __future__ import annotations

import pytest

from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.states import State
from tautwave_drivers.cia402.terms import DisableMethod, Quirks, Timeouts
from tests.drivers.cia402.bench import QUICK, Bench
from tests.drivers.cia402.reference_drive import Drive


def fall(bench: Bench, most: int = 3000) -> str:
    """Run until the machine gives up; return its sentence."""
    bench.until(lambda: bool(bench.machine.failure), most)
    assert bench.events[-1].fatal
    assert not bench.machine.commanding
    assert not bench.machine.done or bench.drive.state != "enabled"
    return bench.machine.failure


@pytest.mark.parametrize(
    ("drive", "parts"),
    [
        (Drive(boot=500), ("NOT READY", "logic supply")),
        (Drive(slowness=900), ("SWITCH ON DISABLED", "0x0006 (shutdown)", "STO", "RPDO")),
        (Drive(slowness=900, remote=False), ("remote, bit 9", "local control")),
        (
            Drive(voltage=False),
            ("READY TO SWITCH ON", "0x0007", "no main supply voltage", "DC link"),
        ),
        (Drive(refuses_mode=True), ("SWITCHED ON", "CST", "6061h shows no mode", "6502h")),
        (Drive(state="fault", resets_needed=9), ("FAULT", "after 3 fault resets")),
    ],
)
def test_a_hanging_drive_is_reported_with_state_command_and_remedy(
    drive: Drive, parts: tuple[str, ...]
) -> None:
    bench = Bench(drive)
    bench.machine.enable(10)
    text = fall(bench)
    for part in ("axis (node 5)", *parts):
        assert part in text
    assert 0x0F not in bench.words
    for _ in range(5):
        assert bench.cycle() == 0x00


def test_faults_are_left_alone_where_the_rig_says_so() -> None:
    bench = Bench(Drive(state="fault"), Quirks(fault_resets=0, timeouts=QUICK))
    bench.machine.enable(10)
    assert "fault reset is off" in fall(bench)
    assert not any(word & 0x80 for word in bench.words)


@pytest.mark.parametrize(
    ("upset", "words"),
    [
        (lambda drive: drive.fail(), "FAULT REACTION ACTIVE"),
        (lambda drive: drive.drop_power(), "power stage was switched off"),
        (lambda drive: drive.restart(), "was reset or lost its logic supply"),
        (lambda drive: drive.go("stop"), "quick stop by the drive itself"),
        (
            lambda drive: setattr(drive, "display", 8),
            "changed from CST cyclic synchronous torque to CSP",
        ),
        (lambda drive: setattr(drive, "remote", False), "no longer follows the bus"),
    ],
)
def test_falling_out_of_operation_is_fatal_and_never_repaired_unasked(upset, words) -> None:  # type: ignore[no-untyped-def]
    bench = Bench(Drive())
    bench.come_up()
    bench.drive.mode_delay = 10**6  # a lost mode stays lost
    upset(bench.drive)
    word = bench.cycle()
    assert not bench.machine.commanding
    assert word == (0x02 if bench.machine.state is State.QUICK_STOP_ACTIVE else 0x00)
    assert bench.events[-1].fatal
    assert words in bench.events[-1].text
    ups = len(bench.drive.enabled_in)
    for _ in range(200):
        bench.cycle()
    assert len(bench.drive.enabled_in) == ups
    assert sum(event.fatal for event in bench.events) == 1
    bench.drive.mode_delay, bench.drive.remote, bench.drive.resets_needed = 2, True, 1
    bench.come_up()
    assert bench.machine.failure == ""


def test_the_fault_code_is_reported_as_text() -> None:
    machine = Machine("wrist", Quirks(timeouts=QUICK))
    machine.enable(10)
    for now, status in enumerate([0x0240, 0x0231, 0x0233, 0x0237, 0x021F]):
        machine.step(status, 10, now, error_code=0x8611 if status == 0x021F else 0)
    (event,) = machine.take_events()
    assert "0x8611: following error" in event.text
    assert machine.take_events() == ()


def test_silence_keeps_the_command_for_a_while_then_gives_up() -> None:
    bench = Bench(Drive())
    bench.come_up()
    for _ in range(5):
        assert bench.cycle(heard=False) == 0x0F
    assert bench.machine.commanding
    for _ in range(10):
        bench.cycle(heard=False)
    assert not bench.machine.commanding
    assert bench.words[-1] == 0x00
    assert [event.fatal for event in bench.events] == [True]
    assert "no statusword for 11 cycles" in bench.events[0].text


def test_a_machine_that_never_hears_anything_says_so_and_never_enables() -> None:
    machine = Machine("wrist", Quirks(timeouts=QUICK))
    machine.enable(10)
    words = {machine.step(None, None, now) for now in range(100)}
    assert words == {0x00}
    assert "TPDO" in machine.failure


@pytest.mark.parametrize(
    ("method", "word"),
    [(DisableMethod.COAST, 0x00), (DisableMethod.SHUTDOWN, 0x06), (DisableMethod.RAMP, 0x07)],
)
def test_a_stop_asked_in_silence_is_sent_in_silence(method: DisableMethod, word: int) -> None:
    bench = Bench(Drive())
    bench.come_up()
    bench.machine.disable(method)
    assert bench.cycle(heard=False) == word
    assert not bench.machine.commanding


def test_quick_stop_halt_and_change_of_mode_in_silence() -> None:
    bench = Bench(Drive())
    bench.come_up()
    bench.machine.halt(True)
    assert bench.cycle(heard=False) == 0x10F
    bench.machine.enable(8)
    assert bench.cycle(heard=False) == 0x07
    bench = Bench(Drive())
    bench.come_up()
    bench.machine.quick_stop()
    assert bench.cycle(heard=False) == 0x02


def test_a_mode_shown_before_it_was_asked_for_confirms_nothing() -> None:
    machine = Machine("wrist", Quirks(timeouts=QUICK))
    machine.step(0x0240, 10, 0)
    machine.enable(10)
    for now in range(1, 40):
        word = machine.step(0x0233, None, now)
        assert word & 0x0F != 0x0F
    assert machine.step(0x0233, 10, 40) == 0x0F


def test_a_drive_that_ignores_quick_stop_or_disable_is_reported() -> None:
    bench = Bench(Drive())
    bench.come_up()
    bench.drive.slowness = 10**6
    bench.machine.quick_stop()
    assert "ignores the quick stop" in fall(bench)
    bench.until(lambda: len(bench.events) == 2)
    assert "cut its power" in bench.events[1].text
    assert bench.words[-1] == 0x00
    for _ in range(300):
        bench.cycle()
    assert len(bench.events) == 2


def test_warnings_are_reported_once_and_are_not_fatal() -> None:
    machine = Machine("wrist", Quirks(timeouts=QUICK))
    machine.enable(10)
    for now, status in enumerate([0x0240, 0x0231, 0x0233, 0x1237, 0x12B7, 0x0AB7, 0x0AB7]):
        machine.step(status, 10, now)
    events = machine.take_events()
    assert [event.fatal for event in events] == [False, False, False]
    assert "warns" in events[0].text
    assert "internal limit" in events[1].text
    assert "bit 12" in events[2].text
    assert machine.commanding


def test_timeouts_scale_with_the_rate() -> None:
    assert Timeouts.at_rate(1000.0) == Timeouts()
    assert Timeouts.at_rate(500.0).transition == Timeouts().transition // 2
    assert min(Timeouts.at_rate(1.0)) == 2


def test_a_drive_that_starts_again_has_to_show_its_mode_again() -> None:
    machine = Machine("wrist", Quirks(timeouts=QUICK))
    machine.enable(10)
    machine.step(0x0240, 10, 0)
    machine.step(0x0200, None, 1)
    assert machine.step(0x0233, None, 2) == 0x07
    assert machine.step(0x0233, 10, 3) == 0x0F


def test_waiting_for_the_mode_takes_no_time_from_the_next_step() -> None:
    shown_late = QUICK.mode + 20  # just inside the patience for the mode
    bench = Bench(Drive(mode_delay=shown_late, slowness=10))
    bench.come_up()
    assert not bench.events


def test_a_drive_that_falls_back_again_and_again_is_given_up_in_the_end() -> None:
    bench = Bench(Drive())
    bench.machine.enable(10)
    for _ in range(QUICK.total + 10):
        if bench.drive.state == "on":
            bench.drive.drop_power()
        bench.cycle()
    assert f"for {QUICK.total + 1} cycles" not in bench.machine.failure  # the state's own time
    assert bench.machine.failure
    assert f"after {QUICK.total + 1} cycles in all" in bench.machine.failure


def test_each_enable_has_its_own_fault_resets() -> None:
    bench = Bench(Drive(state="fault", resets_needed=4))
    bench.machine.enable(10)
    fall(bench)
    bench.come_up()
    assert not bench.machine.failure


def test_a_halt_does_not_outlive_a_new_enable() -> None:
    bench = Bench(Drive())
    bench.machine.halt(True)
    bench.come_up()
    bench.machine.halt(True)
    bench.machine.disable()
    bench.until(lambda: bench.machine.done)
    bench.come_up()
    assert bench.words[-1] == 0x0F


def test_a_second_fault_is_reset_by_an_edge_of_its_own() -> None:
    bench = Bench(Drive(state="fault"))
    bench.machine.enable(10)
    bench.until(lambda: bench.drive.state == "ready")
    bench.drive.fail()
    bench.drive.resets_needed = 1
    bench.until(lambda: bench.drive.state == "fault")
    seen = len(bench.words)
    bench.come_up()
    assert bench.words[seen] == 0x00
    assert [event.text[-12:] for event in bench.events] == ["reset 1 of 3", "reset 2 of 3"]
