"""Random drives and random upsets: the machine comes up where the drive permits, and never early.

What may never happen is asserted in `Bench.cycle`, at every cycle of every case.
"""

from __future__ import annotations

from collections import deque

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tautwave_drivers.cia402.machine import Machine
from tautwave_drivers.cia402.states import State
from tautwave_drivers.cia402.terms import DisableMethod, Quirks
from tests.drivers.cia402.bench import QUICK, Bench
from tests.drivers.cia402.reference_drive import Drive

DRIVES = st.builds(
    Drive,
    slowness=st.integers(1, 12),
    boot=st.integers(0, 60),
    mode_delay=st.integers(0, 30),
    stop_time=st.integers(0, 30),
    option=st.integers(1, 8),
    resets_needed=st.integers(1, 2),
    state=st.sampled_from(["start", "disabled", "ready", "on", "enabled", "stop", "fault"]),
    display=st.sampled_from([0, 8, 10]),
)
UPSETS = st.lists(
    st.tuples(st.integers(0, 150), st.sampled_from(["fail", "drop_power", "restart", "silent"])),
    max_size=3,
)
BOUND = 900  # QUICK.total


@given(drive=DRIVES, upsets=UPSETS, resume=st.booleans())
def test_comes_up_whatever_happens_on_the_way(
    drive: Drive, upsets: list[tuple[int, str]], resume: bool
) -> None:
    option = drive.option
    resets = 8  # up to three faults and one at power-on, two edges each
    bench = Bench(drive, Quirks(option, resume, resets, QUICK))
    bench.machine.enable(10)
    by_cycle = dict(upsets)
    silent = 0
    for now in range(BOUND):
        what = by_cycle.get(now, "")
        if bench.machine.commanding:
            break
        if what == "silent":
            silent = 3  # three in a row are still within the patience
        elif what:
            getattr(drive, what)()
            if what == "fail":
                drive.resets_needed = max(drive.resets_needed, 1)
        bench.cycle(heard=silent == 0)
        silent = max(0, silent - 1)
    assert bench.machine.commanding, (bench.machine.failure, bench.events)
    assert bench.machine.failure == ""
    assert bench.machine.done


@given(
    drive=st.builds(
        Drive,
        deaf_to=st.integers(0, 1),
        on_changes=st.just(True),
        boot=st.integers(0, 9),
        mode_delay=st.integers(0, 9),
    ),
    after=st.integers(0, 6),
)
def test_a_command_that_the_drive_missed_is_given_again(drive: Drive, after: int) -> None:
    missed, drive.deaf_to = drive.deaf_to, 0
    bench = Bench(drive)
    bench.machine.enable(10)
    for _ in range(after):
        bench.cycle()
    drive.deaf_to = missed
    bench.come_up(most=BOUND)
    assert not bench.events


@given(
    drive=DRIVES,
    plan=st.lists(
        st.tuples(
            st.integers(1, 60),
            st.sampled_from(
                ["enable", "csp", "coast", "shutdown", "ramp", "quick", "halt", "go", "fail", "sto"]
            ),
        ),
        max_size=12,
    ),
)
def test_no_order_of_wishes_and_upsets_enables_a_drive_early(
    drive: Drive, plan: list[tuple[int, str]]
) -> None:
    bench = Bench(drive, Quirks(drive.option, resume=True, timeouts=QUICK))
    machine = bench.machine
    wishes = {
        "enable": lambda: machine.enable(10),
        "csp": lambda: machine.enable(8),
        "coast": machine.disable,
        "shutdown": lambda: machine.disable(DisableMethod.SHUTDOWN),
        "ramp": lambda: machine.disable(DisableMethod.RAMP),
        "quick": machine.quick_stop,
        "halt": lambda: machine.halt(True),
        "go": lambda: machine.halt(False),
        "fail": drive.fail,
        "sto": drive.drop_power,
    }
    for cycles, wish in plan:
        wishes[wish]()
        if wish in ("coast", "shutdown", "ramp", "quick", "halt"):
            assert not machine.commanding
        for _ in range(cycles):
            bench.cycle(mode_bits=0x10)
    drive.resets_needed = 1
    machine.disable()
    bench.until(lambda: machine.done and drive.state in ("disabled", "fault", "start"), 400)
    assert machine.state in (State.SWITCH_ON_DISABLED, State.FAULT, State.NOT_READY)


@given(data=st.lists(st.tuples(st.integers(0, 0xFFFF), st.integers(-128, 127)), max_size=200))
def test_any_statusword_is_survived_and_none_enables_without_the_mode(
    data: list[tuple[int, int]],
) -> None:
    bench = Bench(Drive())
    bench.machine.enable(10)
    for now, (status, display) in enumerate(data):
        word = bench.machine.step(status, display, now)
        if display != 10:
            assert word & 0x0F != 0x0F
            assert not bench.machine.commanding


def test_several_drives_come_up_together_without_waiting_for_each_other() -> None:
    benches = [Bench(Drive(slowness=n, boot=10 * n)) for n in range(1, 5)]
    alone = [Bench(Drive(slowness=n, boot=10 * n)).come_up() for n in range(1, 5)]
    for bench in benches:
        bench.machine.enable(10)
    cycles = 0
    while not all(bench.machine.commanding for bench in benches):
        for bench in benches:
            bench.cycle()
        cycles += 1
    assert cycles == max(alone)


@pytest.mark.parametrize("slowness", range(6, 18))
def test_a_pause_on_its_way_to_a_slow_drive_is_no_fall(slowness: int) -> None:
    drive = Drive(slowness=slowness)
    machine = Machine("axis", Quirks(timeouts=QUICK))
    machine.enable(10)
    out = deque([(0, 0)] * 3)
    home = deque([(drive.statusword, drive.display)] * 4)
    for now in range(400):
        home.append((drive.statusword, drive.display))
        out.append((machine.step(*home.popleft(), now), machine.mode_wanted))
        drive.cycle(*out.popleft())
    assert machine.commanding
    assert not machine.take_events()


@given(
    drive=DRIVES,
    there=st.integers(0, 2),
    back=st.integers(0, 2),
    goals=st.lists(
        st.tuples(st.sampled_from([8, 9, 10, "off", "stop"]), st.integers(0, 70)), max_size=6
    ),
)
def test_frames_on_their_way_change_nothing_about_it(
    drive: Drive, there: int, back: int, goals: list[tuple[int | str, int]]
) -> None:
    """Words reach the drive `there` cycles late, its answers come `back` cycles late."""
    machine = Machine("axis", Quirks(drive.option, resume=True, timeouts=QUICK))
    out = deque([(0, 0)] * there)
    home = deque([(drive.statusword, drive.display)] * back)
    now = 0

    def run(cycles: int) -> None:
        nonlocal now
        for _ in range(cycles):
            home.append((drive.statusword, drive.display))
            out.append((machine.step(*home.popleft(), now), machine.mode_wanted))
            drive.cycle(*out.popleft())
            now += 1
            assert not drive.changed_with_torque

    for goal, cycles in goals:
        if goal == "off":
            machine.disable(DisableMethod.RAMP)
        elif goal == "stop":
            machine.quick_stop()
        else:
            machine.enable(int(goal))
        run(cycles)
    machine.disable()
    run(150)
    begun = len(drive.enabled_in)
    drive.resets_needed = 1
    machine.enable(10)
    run(600)
    assert machine.commanding, machine.failure
    assert set(drive.enabled_in[begun:]) == {10}
    assert not machine.failure
