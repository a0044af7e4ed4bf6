"""What a serial device is, by sysfs; one table for all drivers of serial lines."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import pytest

from tautwave_drivers import adapter
from tautwave_drivers.adapter import adapter_of, set_latency_timer
from tautwave_drivers.dynamixel.options import DynamixelOptions
from tautwave_drivers.modbus.options import ModbusOptions

USB = "devices/pci0000:00/usb1/1-2/1-2:1.0"


class Machine(NamedTuple):
    """A /dev and a /sys of our own."""

    root: Path

    def device(self, name: str, driver: str, place: str) -> Path:
        """Make a device with its driver at a place of the device tree; return its node."""
        node = self.root / "dev" / name
        node.parent.mkdir(parents=True, exist_ok=True)
        node.touch()
        here = self.root / "sys" / place
        here.mkdir(parents=True)
        drivers = self.root / "sys/drivers" / driver
        drivers.mkdir(parents=True, exist_ok=True)
        (here / "driver").symlink_to(drivers)
        tty = self.root / "sys/class/tty" / name
        tty.mkdir(parents=True)
        (tty / "device").symlink_to(here)
        return node

    def timer(self, name: str, ms: int) -> Path:
        path = self.root / "sys/bus/usb-serial/devices" / name / "latency_timer"
        path.parent.mkdir(parents=True)
        path.write_text(f"{ms}\n")
        return path

    def link(self, name: str, to: Path) -> str:
        path = self.root / "dev/serial/by-id" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(to)
        return str(path)


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    monkeypatch.setattr(adapter, "SYSFS", tmp_path / "sys")
    return Machine(tmp_path)


def latencies(port: str) -> set[float]:
    """What both drivers of serial lines make of a port."""
    servos = DynamixelOptions.model_validate({"port": port, "servos": [{"id": 1, "model": "X"}]})
    drives = ModbusOptions.model_validate(
        {"link": "rtu", "endpoint": port, "devices": [{"unit": 1}]}
    )
    return {servos.latency_s, drives.latency_s}


@pytest.mark.parametrize(
    ("name", "driver", "place", "kind", "latency_s"),
    [
        ("ttyUSB0", "ch341-uart", f"{USB}/ttyUSB0", "usb", 1e-3),
        ("ttyUSB3", "cp210x", f"{USB}/ttyUSB3", "usb", 1e-3),
        ("ttyACM0", "cdc_acm", USB, "cdc-acm", 1e-3),
        ("ttyS0", "serial8250", "devices/platform/serial8250", "uart", 0.0),
        ("ttyAMA0", "uart-pl011", "devices/platform/soc/fe201000.serial", "uart", 0.0),
        ("ttyTHS1", "serial-tegra", "devices/3100000.serial", "uart", 0.0),
    ],
)
@pytest.mark.parametrize("by_id", [False, True])
def test_a_device_is_told_by_sysfs_whatever_its_name(
    machine: Machine, name: str, driver: str, place: str, kind: str, latency_s: float, by_id: bool
) -> None:
    node = machine.device(name, driver, place)
    port = machine.link("usb-Some_Adapter_A1-if00-port0", node) if by_id else str(node)
    assert adapter_of(port).kind == kind
    assert latencies(port) == {latency_s}


@pytest.mark.parametrize("by_id", [False, True])
@pytest.mark.parametrize(
    ("ms", "may", "latency_s"), [(16, True, 1e-3), (16, False, 16e-3), (1, False, 1e-3)]
)
def test_the_timer_of_ftdi_counts_as_it_is_unless_a_run_may_set_it(
    machine: Machine,
    monkeypatch: pytest.MonkeyPatch,
    by_id: bool,
    ms: int,
    may: bool,
    latency_s: float,
) -> None:
    node = machine.device("ttyUSB0", "ftdi_sio", f"{USB}/ttyUSB0")
    machine.timer("ttyUSB0", ms)
    monkeypatch.setattr(adapter.os, "access", lambda path, mode: may)
    port = machine.link("usb-FTDI_FT232R_USB_UART_A10K-if00-port0", node) if by_id else str(node)
    assert adapter_of(port).kind == "ftdi"
    assert latencies(port) == {latency_s}
    assert adapter_of(port).found_s == ms * 1e-3


@pytest.mark.parametrize(
    ("port", "kind"),
    [
        ("/dev/ttyUSB77", "usb"), ("/dev/ttyACM77", "cdc-acm"), ("/dev/ttyS77", "uart"),
        ("/dev/pts/77", "pty"), ("/dev/serial/by-id/usb-FTDI_FT232H_X-if00-port0", "ftdi"),
        ("/dev/serial/by-id/usb-ROBOTIS_U2D2_X-if00-port0", "ftdi"),
        ("/dev/serial/by-id/usb-1a86_USB_Serial-if00-port0", "usb"),
        ("/dev/serial/by-path/pci-0000:00:14.0-usb-0:2:1.0-port0", "usb"),
    ],
)  # fmt: skip
def test_one_that_is_not_plugged_in_is_told_by_its_name(
    machine: Machine, port: str, kind: str
) -> None:
    assert adapter_of(port).kind == kind
    assert latencies(port) == {0.0 if kind in ("uart", "pty") else 1e-3}


def test_no_serial_device_has_none(machine: Machine) -> None:
    given = {"devices": [{"unit": 1}]}
    for more in ({}, {"endpoint": "tcp://a:1"}, {"link": "rtu", "endpoint": "tcp://a:1"}):
        assert ModbusOptions.model_validate({**given, **more}).latency_s == 0.0


def test_the_latency_timer_is_set_or_its_remedy_reported(machine: Machine) -> None:
    port = str(machine.device("ttyUSB7", "ftdi_sio", f"{USB}/ttyUSB7"))
    timer = machine.timer("ttyUSB7", 16)
    assert set_latency_timer(port, 0.001) == f"{port}: USB latency timer set from 16 to 1 ms"
    assert timer.read_text() == "1\n"
    assert set_latency_timer(port, 0.001).endswith("latency timer 1 ms")
    assert set_latency_timer("/dev/ttyAMA0", 0.001) == ""


def test_a_latency_timer_that_may_not_be_set(
    machine: Machine, monkeypatch: pytest.MonkeyPatch
) -> None:
    port = str(machine.device("ttyUSB7", "ftdi_sio", f"{USB}/ttyUSB7"))
    timer = machine.timer("ttyUSB7", 16)

    def refuse(*_: object, **__: object) -> int:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "write_text", refuse)
    reported = set_latency_timer(port, 0.001)
    assert "warning: USB latency timer 16 ms" in reported
    assert f"echo 1 | sudo tee {timer}" in reported
