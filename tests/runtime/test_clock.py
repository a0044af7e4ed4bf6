"""Clocks: absolute deadlines on the real one, jumps on the fake one."""

from __future__ import annotations

import itertools
import os
import time

import pytest

from tautwave.clock import LAG_NS, FakeClock, MonotonicClock, PacedClock

MS = 1_000_000


class Mailbox:
    """An in-memory transport on which something arrives at given times."""

    def __init__(self, arrivals: list[int], empty: tuple[int, ...] = ()) -> None:
        self._events = sorted([*arrivals, *empty])
        self._arrivals = set(arrivals)
        self._full = False
        self.advanced: list[int] = []

    def next_event_ns(self) -> int | None:
        return self._events[0] if self._events else None

    def advance(self, to_ns: int) -> None:
        self.advanced.append(to_ns)
        while self._events and self._events[0] <= to_ns:
            self._full = self._events.pop(0) in self._arrivals or self._full

    def readable(self) -> bool:
        return self._full


def test_the_fake_clock_jumps_to_the_deadline_and_never_back() -> None:
    clock = FakeClock(start_ns=5)
    assert (clock.now_ns(), clock.real) == (5, False)
    clock.sleep_until(100)
    assert clock.now_ns() == 100
    clock.sleep_until(50)
    assert clock.now_ns() == 100


def test_oversleeping_is_added_to_the_deadline() -> None:
    clock = FakeClock(oversleep=lambda deadline: 7 if deadline == 200 else 0)
    for deadline, now in ((100, 100), (200, 207), (300, 300)):
        clock.sleep_until(deadline)
        assert clock.now_ns() == now


def test_waiting_stops_at_the_event_that_brings_data() -> None:
    clock, box = FakeClock(), Mailbox([400], empty=(100, 250))
    assert clock.wait(box, 1000)
    assert clock.now_ns() == 400
    assert box.advanced == [100, 250, 400]
    assert clock.wait(box, 2000)
    assert clock.now_ns() == 400  # there already


@pytest.mark.parametrize("arrivals", [[], [1500]])
def test_waiting_in_vain_ends_at_the_deadline(arrivals: list[int]) -> None:
    clock, box = FakeClock(), Mailbox(arrivals)
    assert not clock.wait(box, 1000)
    assert clock.now_ns() == 1000
    assert box.advanced == [1000]


def test_waiting_with_a_deadline_that_passed_does_not_turn_time_back() -> None:
    clock = FakeClock(start_ns=2000)
    assert not clock.wait(Mailbox([1500]), 1000) or clock.now_ns() == 2000
    assert clock.now_ns() == 2000


def test_the_real_clock_keeps_absolute_deadlines() -> None:
    clock = MonotonicClock()
    assert clock.real
    start = clock.now_ns()
    for k in range(1, 11):
        clock.sleep_until(start + k * 2 * MS)
        assert clock.now_ns() >= start + k * 2 * MS  # never early, and errors do not add up
    clock.sleep_until(start)  # long past: returns at once


def test_the_real_clock_waits_for_a_file_or_the_deadline() -> None:
    clock = MonotonicClock()
    reader, writer = os.pipe()
    try:
        before = clock.now_ns()
        assert not clock.wait(reader, before + 3 * MS)
        assert clock.now_ns() >= before + 3 * MS
        assert not clock.wait(reader, 0)
        os.write(writer, b"x")
        assert clock.wait(reader, clock.now_ns() + 10_000 * MS)
    finally:
        os.close(reader)
        os.close(writer)


def test_time_is_that_of_the_machine() -> None:
    clock = MonotonicClock()
    times = [time.monotonic_ns(), clock.now_ns(), time.monotonic_ns()]
    assert all(one <= other for one, other in itertools.pairwise(times))


class Machine:
    """Real time for a clock: it passes by sleeping, or by `stall`."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now = 7 * MS
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.now)
        monkeypatch.setattr(time, "sleep", lambda seconds: self.stall(round(seconds * 1e9)))

    def stall(self, ns: int) -> None:
        self.now += ns


def test_simulated_time_that_is_watched_passes_with_real_time_and_leaves_no_slot_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = Machine(monkeypatch)
    clock = PacedClock()
    start = clock.now_ns()
    machine.stall(9 * LAG_NS)  # the rig is built meanwhile
    clock.sleep_until(start)
    behind = machine.now - start
    for slot in range(1, 11):
        clock.sleep_until(start + slot * MS)
        assert clock.now_ns() == machine.now - behind == start + slot * MS
    machine.stall(6 * MS + MS // 2)  # made up at once, slot after slot
    for slot in range(11, 17):
        clock.sleep_until(start + slot * MS)
        assert clock.now_ns() == start + slot * MS
        assert machine.now == behind + start + 16 * MS + MS // 2
    clock.sleep_until(start + 17 * MS)
    assert machine.now == behind + start + 17 * MS
    assert clock.sentence() == "simulated time kept up with real time: no slot was skipped"


def test_simulated_time_waits_for_a_machine_that_stands_still(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    machine = Machine(monkeypatch)
    clock = PacedClock()
    start = machine.now
    clock.sleep_until(start)
    machine.stall(3 * LAG_NS)
    clock.sleep_until(start + MS)
    assert clock.now_ns() == start + MS
    clock.sleep_until(start + 2 * MS)  # from here on as before, later by the stall
    assert clock.now_ns() == start + 2 * MS
    assert machine.now == start + 3 * LAG_NS + MS
    assert clock.sentence() == (
        "simulated time waited 0.15 s for this machine, in 1 piece: no slot was skipped"
    )
