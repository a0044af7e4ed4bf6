"""Foreign servos on a pseudo-terminal and a foreign drive on TCP, on the real clock.

Samples may be late on a busy machine: nothing here counts them. What is asserted is what the
devices saw, and what was said. By default on the fake clock:
`tests/drivers/dynamixel/test_foreign.py`, `tests/drivers/modbus/test_foreign.py`.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from tautwave.clock import MonotonicClock
from tautwave.errors import DriverError
from tautwave.types import AxisCommand
from tautwave_drivers.dynamixel import plugin as servos
from tautwave_drivers.modbus import plugin as drives
from tautwave_drivers.modbus.scan import ScanOptions, scan
from tests.drivers.dynamixel import parts as dynamixel
from tests.drivers.modbus import parts as modbus
from tests.foreign import modbus_drive, servo_line
from tests.foreign.served import on_pty, on_tcp

pytestmark = [pytest.mark.slow, pytest.mark.realtime]
WATCHDOG_S = 0.4
RATES = pytest.mark.parametrize("rate_hz", [20.0, 50.0, 100.0])
KINDS = pytest.mark.parametrize("kind", ["pty", "pty, status block", "tcp", "rtu", "rtu over tcp"])


class Rig(NamedTuple):
    """A driver and the one device behind it, as it sees itself."""

    driver: Any
    clock: MonotonicClock
    rate_hz: float
    on: Callable[[], bool]
    armed: Callable[[], bool]
    moved: Callable[[], float]
    cut_power: Callable[[int], None]
    deafen: Callable[[], None]
    unguarded: Callable[[], bool]

    def enable(self) -> None:
        self.driver.open()
        until = self.clock.now_ns() + 20_000_000_000
        while not self.driver.enable_step():
            assert self.clock.now_ns() < until, "never enabled"
            self.clock.sleep_until(self.clock.now_ns() + 5_000_000)

    def run(self, seconds: float, effort: float = 0.1) -> str:
        """Run until a fault ends it, as the loop does; return the fault, '' if none came."""
        period = round(1e9 / self.rate_hz)
        until = self.clock.now_ns() + round(1e9 * seconds)
        while self.clock.now_ns() < until:
            began = self.clock.now_ns()
            self.driver.request()
            self.driver.read(began + period * 8 // 10)
            for fault in self.driver.faults():
                if fault.fatal:
                    return str(fault.text)
            self.driver.write([AxisCommand(effort, 0.0)])
            self.clock.sleep_until(began + period)
        return ""


@contextlib.contextmanager
def servo_rig(rate_hz: float, **more: Any) -> Iterator[Rig]:
    clock = MonotonicClock()
    one = servo_line.Servo(1)
    one.now_ns = one.heard_ns = clock.now_ns()
    with on_pty(servo_line.ServoLine(clock, one)) as path:
        block = dynamixel.block(dynamixel.servo(1), port=path, watchdog_s=WATCHDOG_S, **more)
        bus = dynamixel.bus_of(dynamixel.spec(1))._replace(rate_hz=rate_hz)
        driver = servos.make(servos.options.model_validate(block), bus, clock, None)
        yield Rig(
            driver,
            clock,
            rate_hz,
            lambda: bool(one.get(servo_line.TORQUE, 1)) and one.pushes,
            lambda: one.get(servo_line.WATCHDOG, 1, signed=True) != 0,
            lambda: abs(one.turn - 2048.0),
            lambda ms: one.cut_power(clock.now_ns(), ms * 1_000_000),
            lambda: setattr(one, "deaf", True),
            lambda: one.unguarded,
        )


@contextlib.contextmanager
def drive_rig(rate_hz: float, kind: str) -> Iterator[Rig]:
    clock = MonotonicClock()
    one = modbus_drive.Drive()
    one.now_ns = one.heard_ns = clock.now_ns()
    line = modbus_drive.DriveLine(clock, {1: one}, tcp=kind == "tcp")
    served = on_pty(line.port("")) if kind == "rtu" else on_tcp(lambda: line.port(""))
    with served as endpoint:
        axes = [modbus.spec(1)]
        block = modbus.options_of(
            axes,
            "generic",
            link="tcp" if kind == "tcp" else "rtu",
            endpoint=endpoint,
            turnaround_s=0.002,
            comm_timeout_s=WATCHDOG_S,
        )
        bus = modbus.bus_of(axes, rate_hz, allow_unwatched=False)
        driver = drives.make(drives.options.model_validate(block), bus, clock, None)
        yield Rig(
            driver,
            clock,
            rate_hz,
            lambda: one.on,
            lambda: bool(one.words[modbus_drive.TIMEOUT]),
            lambda: abs(one.position),
            lambda ms: one.cut_power(clock.now_ns(), ms * 1_000_000),
            lambda: setattr(line, "cut", True),
            lambda: one.unguarded,
        )


@contextlib.contextmanager
def rig_of(kind: str, rate_hz: float) -> Iterator[Rig]:
    if kind.startswith("pty"):
        with servo_rig(rate_hz, status_block="status" in kind) as made:
            yield made
    else:
        with drive_rig(rate_hz, kind) as made:
            yield made


@KINDS
@RATES
def test_it_runs_and_leaves_the_device_off(kind: str, rate_hz: float) -> None:
    with rig_of(kind, rate_hz) as made:
        try:
            made.enable()
            assert made.run(0.5) == ""
        finally:
            made.driver.close()
        assert made.moved() > 0.0
        assert not made.on()
        assert made.driver.unconfirmed == {}
        assert not made.unguarded()


@KINDS
@pytest.mark.parametrize(("rate_hz", "dip_ms"), [(20.0, 50), (100.0, 500)])
def test_a_dip_of_the_supply_is_told(kind: str, rate_hz: float, dip_ms: int) -> None:
    with rig_of(kind, rate_hz) as made:
        try:
            made.enable()
            assert made.run(0.3) == ""
            made.cut_power(dip_ms)
            told = made.run(dip_ms * 1e-3 + 3.0)
        finally:
            made.driver.close()
        assert told
        words = ("switched", "instead of", "fault", "no response")  # the last: a server of its own
        assert any(word in told for word in words)
        assert not made.on()
        assert not made.unguarded()


@KINDS
def test_a_device_that_cannot_be_switched_off_stops_by_its_own_watchdog(kind: str) -> None:
    with rig_of(kind, 50.0) as made:
        try:
            made.enable()
            assert made.run(0.3) == ""
            made.deafen()
        finally:
            made.driver.close()
        assert len(made.driver.unconfirmed) == 1
        assert made.armed()
        made.clock.sleep_until(made.clock.now_ns() + round(1.5e9 * WATCHDOG_S))
        assert not made.on()


def test_another_framing_is_named_on_tcp() -> None:
    clock = MonotonicClock()
    line = modbus_drive.DriveLine(clock, {1: modbus_drive.Drive()}, tcp=True)
    line.spoil = lambda frame: frame[6:] + modbus_drive.crc16(frame[6:])
    with on_tcp(lambda: line.port("")) as endpoint:
        axes = [modbus.spec(1)]
        block = modbus.options_of(axes, "generic", endpoint=endpoint)
        options = drives.options.model_validate(block)
        driver = drives.make(options, modbus.bus_of(axes, 50.0), clock, None)
        with pytest.raises(DriverError, match=r"no Modbus TCP frames.* link: rtu"):
            driver.open()


def test_a_scan_finds_a_drive_behind_a_serial_server() -> None:
    clock = MonotonicClock()
    line = modbus_drive.DriveLine(clock, {3: modbus_drive.Drive()}, tcp=False)
    with on_tcp(lambda: line.port("")) as endpoint:
        options = ScanOptions(endpoint=[endpoint], units="2-4", rtu=True, timeout_s=0.3)
        [row] = scan(options)
    assert (row["unit"], row["profile"]) == (3, "generic")


# -- the installed command -----------------------------------------------------------------

SLOW = (
    "rate_hz=20", "loop.missing_limit=20", "loop.overrun_limit=15",
    "coupling.pairs.lever.wave_filter_hz=4",
)  # fmt: skip


@pytest.mark.nightly
def test_a_servo_that_loses_its_supply_in_a_run_ends_it_with_5(tmp_path: Path) -> None:
    clock = MonotonicClock()
    pair = [servo_line.Servo(number) for number in (1, 2)]
    for one in pair:
        one.now_ns = one.heard_ns = clock.now_ns()
        one.put(servo_line.CURRENT_LIMIT, 2, 186)
        one.eeprom[servo_line.CURRENT_LIMIT] = (2, 186)
    line = servo_line.ServoLine(clock, *pair, baud=1_000_000)
    since: list[int] = []

    def dip(now_ns: int) -> None:
        if not since and pair[1].get(servo_line.TORQUE, 1):
            since.append(now_ns)
        if len(since) == 1 and now_ns - since[0] > 1_000_000_000:
            since.append(now_ns)
            pair[1].cut_power(now_ns, 150_000_000)

    line.on_advance = dip
    root = Path(__file__).parents[2]
    with on_pty(line) as path:
        words = [str(Path(sys.executable).with_name("tautwave")), "run"]
        words += [str(root / "configs/xm430-pair.yaml"), "--out", str(tmp_path / "run")]
        words += ["--allow-uncertified", "--duration", "6"]
        options = (f"port={path}", "watchdog_s=0.5")
        for one in (*SLOW, *(f"buses.servos.options.{option}" for option in options)):
            words += ["--set", one]
        done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    said = done.stdout + done.stderr
    assert len(since) == 2, said
    assert done.returncode == 5, said
    assert "torque enable(64) reads 0 instead of 1" in said
    assert pair[1].limp_goals <= 4, "two are normal before it is enabled"
    for one in pair:
        assert not one.get(servo_line.TORQUE, 1)
        assert not one.unguarded
