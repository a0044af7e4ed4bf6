"""Every way out of a run on a serial device: what the servos see, on the real clock."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tautwave.clock import MonotonicClock
from tautwave.errors import DriverError
from tautwave_drivers.feetech import FeetechDriver
from tautwave_drivers.feetech.keeper import Keeper
from tautwave_drivers.feetech.leaving import stop_packet
from tests.drivers.feetech.benches import block, bus_of, driver_options, servo
from tests.foreign.feetech_line import Line, Servo
from tests.foreign.served import on_pty

RIG = Path(__file__).parents[3] / "configs" / "bench-feetech-sim.yaml"
COMMAND = [sys.executable, "-c", "from tautwave.cli import main; main()", "run"]
STOP = stop_packet(0)
LIMIT_S = 60.0

pytestmark = [pytest.mark.slow, pytest.mark.realtime]


def until(done: Callable[[], bool]) -> None:
    end = time.monotonic() + LIMIT_S
    while not done():
        assert time.monotonic() < end
        time.sleep(0.01)


@contextlib.contextmanager
def running(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[bytes], Line]]:
    """A run of the shipped rig on two foreign servos, with torque on."""
    clock = MonotonicClock()
    line = Line(clock, Servo(1), Servo(2))
    for one in line.servos:
        one.volts = 12.0
        one.now_ns = clock.now_ns()
    with on_pty(line) as path:
        changes = (
            f"buses.servos.options.port={path}", "simulation=null", "loop.missing_limit=400",
            "loop.overrun_limit=400", "coupling.pairs.lever.wave_filter_hz=10", "duration_s=600",
            "rate_hz=40", "coupling.pairs.lever.offset=at_engage",
        )  # fmt: skip
        words = [word for change in changes for word in ("--set", change)]
        words += ["--allow-unwatched", "--allow-uncertified", "--out", str(tmp_path / "out")]
        child = subprocess.Popen(
            [*COMMAND, str(RIG), *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        try:
            until(
                lambda: all(one.memory[40] == 1 for one in line.servos) or child.poll() is not None
            )
            assert child.poll() is None, child.communicate()[0].decode()
            time.sleep(0.5)
            yield child, line
        finally:
            if child.poll() is None:
                child.kill()
            child.communicate()


def off(line: Line) -> bool:
    return all(one.memory[40] == 0 for one in line.servos)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_signal_ends_it_with_all_servos_off(tmp_path: Path, number: signal.Signals) -> None:
    with running(tmp_path) as (child, line):
        child.send_signal(number)
        until(lambda: off(line))


def test_a_run_that_is_halted_is_switched_off(tmp_path: Path) -> None:
    with running(tmp_path) as (child, line):
        child.send_signal(signal.SIGSTOP)
        until(lambda: off(line))
        child.send_signal(signal.SIGCONT)
        child.send_signal(signal.SIGTERM)


def test_a_line_that_was_lost_is_opened_anew_and_all_are_switched_off() -> None:
    """The process beside the run has it open too, which would keep it from being opened."""
    clock = MonotonicClock()
    line = Line(clock, Servo(1), Servo(2))
    for one in line.servos:
        one.now_ns = clock.now_ns()
    with on_pty(line) as path:
        options = block(servo(1), servo(2), port=path, host_watchdog_s=5.0)
        driver = FeetechDriver(driver_options(options), bus_of(options, 40.0), clock, None)
        driver.open()
        try:
            until(driver.enable_step)
            assert not off(line)
            driver._lose(DriverError("the line was lost"))
        finally:
            driver.close()
        assert not driver.unconfirmed
        assert off(line)


def keeper(limit_s: float) -> tuple[Keeper, int]:
    """Return a keeper and the other end of its line."""
    ours, theirs = os.openpty()

    tty.setraw(theirs)
    os.set_blocking(ours, False)
    made = Keeper(theirs, STOP, limit_s)
    os.close(theirs)
    return made, ours


def heard(end: int) -> bytes:
    with contextlib.suppress(BlockingIOError, OSError):
        return os.read(end, 100)
    return b""


def test_it_says_nothing_before_it_is_fed_and_after_it_may_rest() -> None:
    made, end = keeper(0.05)
    time.sleep(0.3)
    assert heard(end) == b""
    made.feed()
    made.rest()
    time.sleep(0.3)
    assert heard(end) == b""
    made.end()
    os.close(end)


def test_it_stops_all_once_it_is_not_fed_any_more() -> None:
    made, end = keeper(0.2)
    made.feed()
    said = b""

    def stopped() -> bool:
        nonlocal said
        said += heard(end)
        return said == 2 * STOP

    until(stopped)
    made.end()
    os.close(end)


@pytest.mark.parametrize("stop", [False, True])
def test_its_end_stops_all_only_where_that_is_asked_for(stop: bool) -> None:
    made, end = keeper(0.05)
    made.end(stop)
    assert heard(end) == (2 * STOP if stop else b"")
    os.close(end)


def test_one_that_has_died_is_noticed() -> None:
    made, end = keeper(0.2)
    made._child.kill()
    made._child.wait()
    until(lambda: not made.feed())
    made.end()
    os.close(end)
