"""On a host that comes late a device, or the program that simulates it, is waited for longer."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tautwave.clock import FakeClock
from tautwave.errors import BusTimeout
from tautwave_drivers.dynamixel.line.transactions import RESPONSE_S, TRIES, PacketLine
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.modbus.line.client import Client
from tautwave_drivers.patience import LATER, SLOWEST_NS, SPARE, Patience
from tests.commands import keep_in_one_process, tautwave
from tests.drivers.canopen.foreign import foreign
from tests.drivers.modbus.test_foreign import rig as modbus_rig
from tests.foreign.modbus_drive import Drive
from tests.session.newcomers import TAUTWAVE, Talk

ANSWER = packet.build(1, packet.STATUS, b"\x00\x01\x02\x03")
MS = 1_000_000


def host_late(monkeypatch: pytest.MonkeyPatch, late_ms: int) -> None:
    """Have the host called late whenever time is up."""
    wait = FakeClock.wait

    def late_wait(clock: FakeClock, transport: Any, deadline_ns: int) -> bool:
        found = wait(clock, transport, deadline_ns)
        if not found:
            clock._now_ns += MS * late_ms
        return found

    monkeypatch.setattr(FakeClock, "wait", late_wait)


class SlowServo:
    """Answers each request after a time, the newest only."""

    def __init__(self, clock: FakeClock, after_ns: int | None) -> None:
        self._clock = clock
        self._after_ns = after_ns
        self._at_ns: int | None = None
        self.asked = 0

    def next_event_ns(self) -> int | None:
        return None if self.readable() else self._at_ns

    def advance(self, to_ns: int) -> None:
        """Nothing happens by itself."""

    def readable(self) -> bool:
        return self._at_ns is not None and self._clock.now_ns() >= self._at_ns

    def read(self) -> bytes:
        if not self.readable():
            return b""
        self._at_ns = None
        return ANSWER

    def write(self, data: bytes) -> None:
        self.asked += 1
        self._at_ns = None if self._after_ns is None else self._clock.now_ns() + self._after_ns

    def close(self) -> None:
        """Nothing to close."""


def servo_answers(_: pytest.MonkeyPatch, after_ms: int) -> bool:
    clock = FakeClock()
    return PacketLine(SlowServo(clock, MS * after_ms), clock, 57600).ping(1) is not None


def node_answers(_: pytest.MonkeyPatch, after_ms: int) -> bool:
    rig = foreign(options={"sdo_timeout_s": 0.02})
    rig.bus.response_ns = MS * after_ms
    return opens(rig.driver)


def opens(driver: Any) -> bool:
    try:
        driver._bring_up()  # `open` alone closes what failed, and takes longer to
    except BusTimeout:
        return False
    finally:
        driver._release()
    return True


@pytest.mark.parametrize(
    ("answers", "late_ms", "after_ms", "found"),
    [
        (servo_answers, 0, 20, True),
        (servo_answers, 0, 100, False),
        (servo_answers, 2, 100, False),
        (servo_answers, 25, 100, True),
        (servo_answers, 200, 400, True),
        (node_answers, 0, 70, True),  # it adapts to a slow drive by itself, four times
        (node_answers, 0, 200, False),
        (node_answers, 2, 200, False),
        (node_answers, 60, 200, True),
    ],
)
def test_the_wait_grows_with_the_lateness_that_was_measured(
    monkeypatch: pytest.MonkeyPatch,
    answers: Callable[[pytest.MonkeyPatch, int], bool],
    late_ms: int,
    after_ms: int,
    found: bool,
) -> None:
    host_late(monkeypatch, late_ms)
    assert answers(monkeypatch, after_ms) is found


@pytest.mark.parametrize(
    ("tcp", "late_ms", "after_ms", "found"),
    [
        (True, 0, 60, True),
        (True, 0, 300, False),
        (True, 100, 300, True),
        (False, 0, 60, True),
        (False, 0, 700, False),
        (False, 100, 300, True),
    ],
)
def test_so_does_a_modbus_drive(
    monkeypatch: pytest.MonkeyPatch, tcp: bool, late_ms: int, after_ms: int, found: bool
) -> None:
    made = modbus_rig(monkeypatch, Drive(), tcp=tcp)
    links = made.driver._links = made.driver._make_links()
    ((link, (station,)),) = links.groups
    links.connect(link)
    made.line.more_ns = MS * after_ms
    host_late(monkeypatch, late_ms)
    client = Client(link, made.clock, 0.1)
    try:
        found_it = bool(client.request(station, station.codec.read("status")))
    except BusTimeout:
        found_it = False
    assert found_it is found
    links.close()


@pytest.mark.parametrize(("late_ms", "asked"), [(0, TRIES), (1, TRIES), (1000, TRIES + SPARE)])
def test_who_is_not_there_is_not_waited_for_for_ever(
    monkeypatch: pytest.MonkeyPatch, late_ms: int, asked: int
) -> None:
    host_late(monkeypatch, late_ms)
    clock = FakeClock()
    servo = SlowServo(clock, None)
    assert PacketLine(servo, clock, 57600).ping(1) is None
    assert servo.asked == asked


def test_one_deadline_stays_one_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    host_late(monkeypatch, 50)
    clock = FakeClock()
    servo = SlowServo(clock, None)
    limit_ns = clock.now_ns() + round(1e9 * RESPONSE_S)
    line = PacketLine(servo, clock, 57600)
    assert line.read(1, 0, 2, limit_ns) is None
    assert servo.asked == 1


def test_the_rule_itself() -> None:
    patience = Patience()
    assert patience.more_ns == 0
    assert not patience.note(4, 10)
    assert patience.note(6, 10)
    assert not patience.note(1, 10)  # the worst counts for the waits
    assert patience.more_ns == LATER * 6
    patience.note(10**12, 10)
    assert patience.more_ns == SLOWEST_NS


@pytest.mark.slow
@pytest.mark.realtime
@pytest.mark.parametrize("name", ["bench-dynamixel-sim", "bench-modbus-tcp-sim"])
def test_a_simulator_that_was_stopped_for_two_seconds_answers_the_next_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    keep_in_one_process(monkeypatch)
    rig = Path(__file__).parents[2] / "configs" / f"{name}.yaml"
    sim = Talk((*TAUTWAVE, "sim", str(rig)), tmp_path)
    try:
        sim.hears("served by process")
        os.kill(sim.child.pid, signal.SIGSTOP)
        going_on = threading.Timer(2.0, os.kill, (sim.child.pid, signal.SIGCONT))
        going_on.start()
        try:
            done = tautwave(
                "run", str(rig), "--attach", "--duration", "0.3", "--out", "first", cwd=tmp_path
            )
            going_on.join()
            # a loaded machine may be too late to run (6), or its simulator too late to answer (5)
            for attempt in range(4):
                again = tautwave(
                    "run", str(rig), "--attach", "--duration", "0.3", "--out", f"next-{attempt}",
                    cwd=tmp_path,
                )  # fmt: skip
                if again.exit_code in (0, 6):
                    break
        finally:
            going_on.join()
        assert "Traceback" not in done.output
        assert again.exit_code in (0, 6), again.output
        assert "no answer" not in again.output
    finally:
        sim.kill()
