"""Our driver drives a server that no pymodbus code touches: libmodbus, in C, compiled here."""

from __future__ import annotations

import contextlib
import os
import select
import shutil
import subprocess
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from tautwave.clock import MonotonicClock
from tautwave.types import AxisCommand, JointState
from tautwave_drivers.modbus import plugin
from tautwave_drivers.modbus.driver import ModbusDriver
from tests.drivers.modbus.parts import bus_of, options_of, spec

SOURCE = Path(__file__).with_name("drive.c")
CYCLES = 40


@pytest.fixture(scope="session")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the drive; skipped where libmodbus or gcc are missing, which CI does not allow."""
    header = Path("/usr/include/modbus/modbus.h")
    if shutil.which("gcc") is None or not header.exists():
        reason = "libmodbus or gcc is not installed: apt-get install gcc libmodbus-dev"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
    made = tmp_path_factory.mktemp("libmodbus") / "drive"
    words = ["gcc", "-O1", "-Wall", "-Werror", "-I", str(header.parent), "-o", str(made)]
    subprocess.run([*words, str(SOURCE), "-lmodbus"], check=True, capture_output=True)
    return made


@contextlib.contextmanager
def bridge() -> Iterator[tuple[str, str]]:
    """Two pseudo-terminals wired to each other: the paths of their ends."""
    pairs = [os.openpty() for _ in range(2)]
    (one, near), (other, far) = pairs
    for end in (near, far):
        tty.setraw(end)
    done = threading.Event()

    def relay() -> None:
        while not done.is_set():
            for end in select.select([one, other], [], [], 0.05)[0]:
                os.write(other if end == one else one, os.read(end, 4096))

    thread = threading.Thread(target=relay)
    thread.start()
    try:
        yield os.ttyname(near), os.ttyname(far)
    finally:
        done.set()
        thread.join()
        for end in (one, near, other, far):
            os.close(end)


@contextlib.contextmanager
def served(drive: Path, link: str) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """Run the drive; give the endpoint."""
    with contextlib.ExitStack() as stack:
        near, far = stack.enter_context(bridge()) if link == "rtu" else ("", "")
        words = [str(drive), link] + ([far] if far else [])
        child = stack.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE, bufsize=0))
        stack.callback(child.kill)
        assert child.stdout is not None
        port = int(child.stdout.readline())
        yield near or f"tcp://127.0.0.1:{port}", child


def run(driver: ModbusDriver, clock: MonotonicClock, period_ns: int) -> list[JointState]:
    """Open, enable, push until enough cycles had a sample, however busy the machine, and leave."""
    driver.open()
    deadline = clock.now_ns()
    for _ in range(400):
        if driver.enable_step():
            break
        deadline += period_ns
        clock.sleep_until(deadline)
    states: list[JointState] = []
    for cycle in range(20 * CYCLES):
        if cycle >= CYCLES and sum(state.valid for state in states) >= CYCLES // 2:
            break
        deadline = clock.now_ns() + period_ns
        driver.request()
        states += driver.read(deadline)
        driver.write([AxisCommand(0.2, 0.0)])
        clock.sleep_until(deadline)
    driver.close()
    return states


def last_left(child: subprocess.Popen[bytes]) -> tuple[int, int, int]:
    """Return control word, torque and requests answered when the last master left.

    A driver that lost its connection on the way has left more than once: what counts is the last.
    """
    assert child.stdout is not None
    left: list[bytes] = []
    while select.select([child.stdout], [], [], 0.2 if left else 30.0)[0]:
        line = child.stdout.readline()
        if not line:
            break
        left.append(line)
    control, torque, answered = map(int, left[-1].split())
    return control, torque, answered


@pytest.mark.sparse(6)
@pytest.mark.parametrize("functions", [[3, 4, 6, 16, 23], [3, 16], [3, 6]])
@pytest.mark.parametrize("link", ["tcp", "rtu"])
def test_our_driver_drives_a_server_of_libmodbus(
    drive: Path, link: str, functions: list[int]
) -> None:
    with served(drive, link) as (endpoint, child):
        # libmodbus ends a frame after 0.5 s of silence or when it is whole: no gap is needed.
        axes = [spec(1)]
        block = options_of(axes, "generic", link=link, endpoint=endpoint)
        block["devices"][0]["function_codes"] = functions
        # A second without a response: a machine that is held up is not a dead connection.
        slow = {"gap_s": 0.001, "late_s": 0.2, "silence_s": 1.0}
        options = plugin.options.model_validate(block | slow)
        bus = bus_of(axes, rate_hz=50.0)
        clock = MonotonicClock()
        driver = plugin.make(options, bus, clock, None)
        assert isinstance(driver, ModbusDriver)
        states = run(driver, clock, bus.period_ns)
        valid = [state for state in states if state.valid]
        assert len(valid) >= CYCLES // 2
        moved = [state.position for state in valid]
        assert moved == sorted(moved)
        # 200 counts a request, one of each two or three of a cycle at least
        assert moved[-1] - moved[0] > 1e-4 * 200 * (len(valid) - 2) / 2
        assert any("0.1 s without a request" in note for note in driver.notes)
        if link == "tcp":  # the line of the other one outlives its master
            control, torque, answered = last_left(child)
            assert (control, torque) == (0, 0)
            assert answered > CYCLES // 2
