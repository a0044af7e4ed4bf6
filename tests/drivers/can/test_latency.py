"""What a USB adapter of python-can adds to an answer, by interface and channel."""

from __future__ import annotations

from pathlib import Path

import pytest

from tautwave import latency_timer
from tautwave.contracts import AxisSpec, BusSpec
from tautwave_drivers import adapter
from tautwave_drivers.can.keys import CanKeys
from tautwave_drivers.can.latency import latency_lines, latency_s
from tautwave_drivers.canopen import CanopenOptions
from tautwave_drivers.canopen.budget import budget
from tautwave_drivers.canopen.options import Node


@pytest.mark.parametrize(
    ("interface", "channel", "ms"),
    [
        ("socketcan", "can0", 0.0),
        ("virtual", "test", 0.0),
        ("udp_multicast", "239.0.0.1", 0.0),
        ("gs_usb", "0", 1.0),
        ("kvaser", "0", 1.0),
        ("pcan", "PCAN_USBBUS1", 1.0),
        ("pcan", "PCAN_PCIBUS1", 0.0),
        ("slcan", "/dev/pts/3", 0.0),
        ("slcan", "/dev/ttyACM0", 1.0),
        ("slcan", "/dev/ttyACM0@115200", 1.0),
        ("slcan", "/dev/serial/by-id/usb-FTDI_FT232R_A1-if00-port0", 16.0),
        ("robotell", "/dev/ttyUSB9", 1.0),
        ("one_that_nobody_knows", "0", 1.0),
    ],
)
def test_what_an_interface_adds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, interface: str, channel: str, ms: float
) -> None:
    monkeypatch.setattr(adapter, "SYSFS", tmp_path)
    keys = CanKeys(interface=interface, channel=channel)
    assert latency_s(keys) * 1e3 == pytest.approx(ms)
    stated = keys.model_copy(update={"usb_latency_s": 0.25e-3})
    assert latency_s(stated) == 0.25e-3


@pytest.mark.parametrize(("timer", "ms"), [("16", 16.0), ("4", 4.0), ("1", 1.0), ("0", 1.0)])
def test_a_latency_timer_counts_as_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, timer: str, ms: float
) -> None:
    monkeypatch.setattr(adapter, "SYSFS", tmp_path)
    path = tmp_path / "bus/usb-serial/devices/ttyUSB7"
    path.mkdir(parents=True)
    (path / "latency_timer").write_text(timer)
    keys = CanKeys(interface="slcan", channel="/dev/ttyUSB7")
    assert latency_s(keys) * 1e3 == pytest.approx(ms)


USB_PATH = "devices/pci0000:00/0000:00:14.0/usb1/1-2/1-2:1.0"
CHIP = "devices/platform/soc/spi0/spi0.0"


@pytest.mark.parametrize(
    ("driver", "place", "speed", "ms"),
    [
        ("gs_usb", USB_PATH, "12", 1.0),
        ("gs_usb", USB_PATH, "480", 0.125),
        ("peak_usb", USB_PATH, "480", 0.125),
        ("kvaser_usb", USB_PATH, "5000", 0.125),
        ("gs_usb", USB_PATH, None, 1.0),
        ("gs_usb", USB_PATH, "garbage", 1.0),
        ("one_that_nobody_knows", USB_PATH, "12", 1.0),
        (None, USB_PATH, "12", 1.0),
        ("mcp251xfd", CHIP, None, 0.0),
        ("peak_pci", "devices/pci0000:00/0000:03:00.0", None, 0.0),
    ],
)
def test_an_interface_of_the_kernel_is_judged_by_its_device(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    driver: str | None,
    place: str,
    speed: str | None,
    ms: float,
) -> None:
    monkeypatch.setattr(latency_timer, "SYSFS", tmp_path)
    device = tmp_path / place
    device.mkdir(parents=True)
    if speed is not None:
        (device.parent / "speed").write_text(f"{speed}\n")
    if driver is not None:
        (tmp_path / "drivers" / driver).mkdir(parents=True)
        (device / "driver").symlink_to(tmp_path / "drivers" / driver)
    net = tmp_path / "class/net/can0"
    net.mkdir(parents=True)
    (net / "device").symlink_to(device)
    keys = CanKeys(interface="socketcan", channel="can0")
    assert latency_s(keys) * 1e3 == pytest.approx(ms)
    assert latency_s(keys.model_copy(update={"usb_latency_s": 0.2e-3})) == 0.2e-3
    lines = latency_lines(keys)
    assert len(lines) == (ms > 0.0)
    assert all(f"({driver or 'USB'}): answers up to {ms:g} ms late" in line for line in lines)
    assert latency_s(CanKeys(interface="socketcan", channel="can1")) == 0.0
    assert latency_s(CanKeys(interface="socketcan", channel="slcan0")) == 1e-3


def test_the_budget_of_a_bus_counts_its_adapter() -> None:
    axes = (AxisSpec("master.a1", 1, "rotary", "impedance", 1.0, 10.0),)
    bus = BusSpec("can", axes, 500.0)
    nodes = (Node(id=1, rated_torque=0.5, counts_per_revolution=4096),)
    wired = budget(CanopenOptions(nodes=nodes), bus)
    usb = budget(CanopenOptions(nodes=nodes, interface="gs_usb", channel="0"), bus)
    stated = budget(
        CanopenOptions(nodes=nodes, interface="gs_usb", channel="0", usb_latency_s=0.0), bus
    )
    assert usb.time_s == pytest.approx(wired.time_s + 1e-3)
    assert 1.0 / usb.greatest_rate_hz > 1.0 / wired.greatest_rate_hz + 1e-3
    assert "USB adapter (gs_usb): answers up to 1 ms late" in usb.arithmetic
    assert stated == wired
