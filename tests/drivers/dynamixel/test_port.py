"""Real file descriptors: a pty as the line, pulled out and put back."""

from __future__ import annotations

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace

import pytest
import serial  # type: ignore[import-untyped]

from tautwave.clock import MonotonicClock
from tautwave.errors import DriverError
from tautwave_drivers import serial_port
from tautwave_drivers.dynamixel import plugin
from tautwave_drivers.dynamixel.driver import DynamixelDriver
from tautwave_drivers.dynamixel.scan import ScanOptions, scan
from tautwave_drivers.serial_port import SerialPort
from tests.drivers.dynamixel.parts import bus_of, options_of, servo, spec

pytestmark = pytest.mark.realtime

MAIN = "from tautwave.cli import main; main(prog_name='tautwave')"
PERIOD_NS = 20_000_000
TIOCGEXCL = 0x80045440  # asm-generic/ioctls.h


@contextmanager
def served(*words: str) -> Iterator[str]:
    """Simulated servos on a pty, as other people's software meets them."""
    command = [sys.executable, "-c", MAIN, "sim", "dynamixel", *words]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert child.stdout is not None
        yield json.loads(child.stdout.readline())["endpoint"]
    finally:
        child.send_signal(signal.SIGTERM)
        child.communicate(timeout=60)


@pytest.fixture
def line() -> Iterator[tuple[int, str]]:
    master, slave = os.openpty()
    path = os.ttyname(slave)
    os.close(slave)
    try:
        yield master, path
    finally:
        with suppress(OSError):
            os.close(master)


def test_bytes_go_through_as_they_are(line: tuple[int, str]) -> None:
    master, path = line
    port = SerialPort(path, 1_000_000)
    every = bytes(range(256))
    port.write(every)
    assert os.read(master, 1000) == every
    assert port.read() == b""
    os.write(master, every)
    assert MonotonicClock().wait(port, MonotonicClock().now_ns() + 30 * 10**9)
    assert port.read() == every
    os.write(master, 7 * every)
    assert MonotonicClock().wait(port, MonotonicClock().now_ns() + 30 * 10**9)
    assert port.read() == 7 * every
    for baud in (9600, 4_500_000):
        port.set_baud(baud)
    port.close()
    port.close()


def test_a_line_is_raw_whatever_it_was_before(line: tuple[int, str]) -> None:
    master, path = line
    cooked = termios.tcgetattr(master)
    cooked[0] = termios.IGNBRK | termios.ISTRIP | termios.ICRNL
    cooked[1] = termios.OPOST | termios.ONLCR
    cooked[3] = termios.ISIG | termios.ICANON | termios.ECHO
    cooked[6][termios.VTIME] = 5
    termios.tcsetattr(master, termios.TCSANOW, cooked)
    port = SerialPort(path, 57_600)
    given = termios.tcgetattr(port.fileno())
    port.close()
    assert [given[0], given[1], given[3]] == [0, 0, 0]  # of input, of output, of a terminal
    assert [given[6][termios.VMIN], given[6][termios.VTIME]] == [1, 0]


def test_a_port_is_ours_alone(line: tuple[int, str]) -> None:
    port = SerialPort(line[1], 57_600)
    exclusive = fcntl.ioctl(port.fileno(), TIOCGEXCL, bytes(4))
    assert int.from_bytes(exclusive, sys.byteorder) == 1
    fcntl.ioctl(port.fileno(), termios.TIOCNXCL)  # root is let in anyway
    with pytest.raises(DriverError, match="another program has it open, or another bus"):
        SerialPort(line[1], 57_600)
    with pytest.raises(serial.SerialException, match="lock"):
        serial.Serial(line[1], exclusive=True)
    port.close()
    SerialPort(line[1], 57_600).close()


def test_another_program_that_reads_the_line_is_reported(line: tuple[int, str]) -> None:
    _, path = line
    other = os.open(path, os.O_RDWR | os.O_NOCTTY)
    port = SerialPort(path, 57_600)
    keys = termios.tcgetattr(other)
    keys[6][termios.VMIN] = 0  # as pyserial sets it: from then on an empty line reads as closed
    termios.tcsetattr(other, termios.TCSANOW, keys)
    with pytest.raises(DriverError, match=r"unplugged, .* or another program reads the same line"):
        port.read()
    port.close()
    os.close(other)


def test_a_closed_other_end_is_reported(line: tuple[int, str]) -> None:
    master, path = line
    port = SerialPort(path, 57_600)
    os.close(master)
    with pytest.raises(DriverError, match=r"disconnected|unplugged"):
        port.read()
    with pytest.raises(DriverError, match="disconnected"):
        port.write(b"x")
    port.close()


def test_devices_that_are_none() -> None:
    with pytest.raises(DriverError, match="no such device"):
        SerialPort("/dev/ttyNONE", 57_600)
    with pytest.raises(DriverError, match="is not a serial device"):
        SerialPort("/dev/null", 57_600)


@pytest.mark.parametrize(
    ("code", "remedy"),
    [
        (errno.EACCES, "permission denied; add yourself to its group: sudo usermod -aG dialout"),
        (errno.EBUSY, "another program has it open, or another bus of this rig"),
        (errno.EIO, "cannot be opened: Input/output error"),
    ],
)
def test_a_device_that_does_not_open_is_named_with_its_remedy(
    code: int, remedy: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: str, flags: int) -> int:
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(serial_port, "os", SimpleNamespace(**vars(os) | {"open": refuse}))
    driver = driver_on("/dev/ttyUSB7")
    with pytest.raises(DriverError) as reported:
        driver.open()
    assert str(reported.value).startswith(f"bus hand: /dev/ttyUSB7: {remedy}")


def driver_on(path: str) -> DynamixelDriver:
    options = options_of(servo(1), servo(2), baud=1_000_000).model_copy(update={"port": path})
    bus = bus_of(spec(1), spec(2), configure=True)._replace(rate_hz=50.0)
    made = plugin.make(options, bus, MonotonicClock(), None)
    assert isinstance(made, DynamixelDriver)
    return made


def run(driver: DynamixelDriver, cycles: int) -> int:
    """Enable and run some cycles; return how many samples of both servos came."""
    clock = MonotonicClock()
    driver.open()
    for _ in range(200):
        if driver.enable_step():
            break
        clock.sleep_until(clock.now_ns() + 5_000_000)
    whole = 0
    for _ in range(cycles):
        began = clock.now_ns()
        driver.request()
        whole += all(state.valid for state in driver.read(began + 15_000_000))
        clock.sleep_until(began + PERIOD_NS)
    return whole


@pytest.mark.slow
def test_pulled_out_in_a_run_and_put_back() -> None:
    """The served simulator ends, which is what an adapter that is pulled out looks like."""
    with served("--ids", "1,2") as path:
        driver = driver_on(path)
        assert run(driver, 10) >= 1  # a busy machine's simulator may be late for the others
    for _ in range(3):
        driver.request()
        assert not any(state.valid for state in driver.read(0))
    [fault] = driver.faults()
    assert fault.fatal
    assert path in fault.text
    assert "run again" in fault.text
    driver.disable()
    driver.close()
    with served("--ids", "1,2") as path:
        again = driver_on(path)
        assert run(again, 10) >= 1
        again.close()


@pytest.mark.slow
def test_a_scan_finds_them_at_their_baud_rate() -> None:
    with served("--ids", "1,42", "--model", "XL330-M288", "--baud", "57600") as path:
        # a busy machine may take longer to answer than a scan waits
        scans = (scan(ScanOptions(port=path, protocol=2.0, baud=57_600)) for _ in range(5))
        found = next((one for one in scans if len(one) == 2), [])
        assert scan(ScanOptions(port=path, protocol=2.0, baud=1_000_000)) == []
    assert [one["id"] for one in found] == [1, 42]
    for one in found:
        assert one["model"] == "XL330-M288"
        assert (one["firmware"], one["baud"], one["protocol"]) == (53, 57_600, 2.0)
        assert one["voltage"] == 5.0
        assert (one["errors"], one["return_delay_us"]) == ("", 500)


@pytest.mark.slow
def test_a_scan_reads_position_and_load_in_protocol_1() -> None:
    with served("--ids", "3", "--model", "AX-12A") as path:
        scans = (scan(ScanOptions(port=path, protocol=1.0, baud=1_000_000, ids=[2, 3]))
                 for _ in range(5))  # fmt: skip
        found = next((one for one in scans if one), [])
    [one] = found
    assert (one["id"], one["model"], one["protocol"]) == (3, "AX-12A", 1.0)
    assert 0 <= one["position_counts"] <= 1023
    assert one["load_percent"] == 0.0
