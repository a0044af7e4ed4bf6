"""How long a USB adapter keeps a CAN frame before the host has it.

Adapters on a serial port, such as those of the slcan kind, are judged as the port (`adapter.py`),
but their latency timer is not set. Others pass their data on with the next frame of the bus: 1 ms
at full speed, 125 us at high speed (USB 2.0, 5.3 and 5.12.4). An interface of the kernel
(SocketCAN) is looked up in sysfs: its device's driver has a name, and the device on USB a speed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

from tautwave import latency_timer
from tautwave_drivers.adapter import USB_S, adapter_of
from tautwave_drivers.can.keys import CanKeys

ON_SERIAL_PORTS = ("slcan", "seeedstudio", "robotell")
"""Interfaces of python-can whose channel is a serial port."""
WITHOUT_USB = ("virtual", "udp_multicast")
HIGH_SPEED_S = 125e-6
"""[s] A microframe of USB at 480 Mbit/s."""
USB_DRIVERS = (
    "gs_usb", "peak_usb", "kvaser_usb", "esd_usb", "ems_usb", "mcba_usb", "usb_8dev", "ucan",
    "etas_es58x", "f81604", "nct6694_canfd",
)  # fmt: skip
"""Drivers of Linux for CAN adapters on USB (drivers/net/can/usb)."""
UNSET_TIMER_S = 0.016
"""[s] Default latency timer of an FTDI chip (AN232B-04)."""


class KernelAdapter(NamedTuple):
    """What is behind a network interface: its driver, '' if unknown, and what it adds [s]."""

    driver: str
    latency_s: float


def kernel_adapter(channel: str) -> KernelAdapter:
    """Return what is behind an interface of the kernel; vcan and what is not there add nothing."""
    device = latency_timer.SYSFS / "class/net" / channel / "device"
    if "/" in channel or not device.exists():
        return _serial_line(channel)
    path = Path(os.path.realpath(device))
    link = path / "driver"
    driver = os.path.basename(os.path.realpath(link)) if link.exists() else ""
    speeds = (one / "speed" for one in (path, *path.parents))
    speed = next((one for one in speeds if one.is_file()), None)
    if driver not in USB_DRIVERS and "/usb" not in str(path):
        return KernelAdapter(driver, 0.0)
    rate = None if speed is None else latency_timer.read_integer(speed)  # [Mbit/s]; 1.5 is slow
    fast = rate is not None and rate >= 480
    return KernelAdapter(driver or "USB", HIGH_SPEED_S if fast else USB_S)


def _serial_line(channel: str) -> KernelAdapter:
    """Return what an interface without a device of its own adds: slcan has a serial port's."""
    is_line = channel.startswith("slcan")
    return KernelAdapter("slcan", USB_S) if is_line else KernelAdapter("", 0.0)


def latency_s(options: CanKeys) -> float:
    """Return how long an answer waits in the adapter [s]; an unknown interface is taken for USB."""
    if options.usb_latency_s is not None:
        return options.usb_latency_s
    if options.interface in WITHOUT_USB:
        return 0.0
    if options.interface == "socketcan":
        return kernel_adapter(options.channel).latency_s
    if options.interface == "pcan" and "USB" not in options.channel.upper():
        return 0.0  # PCAN_PCIBUS1 and the like
    if options.interface not in ON_SERIAL_PORTS:
        return USB_S
    port = adapter_of(options.channel.partition("@")[0])  # slcan: PORT@BAUD
    if port.kind == "ftdi":
        measured = port.found_s
        return UNSET_TIMER_S if measured is None else max(measured, USB_S)
    return port.latency_s


def latency_lines(options: CanKeys) -> list[str]:
    """Return what the adapter adds, as lines of a budget; none where it adds nothing."""
    kept = latency_s(options)
    if not kept:
        return []
    name = options.interface
    if name == "socketcan":
        name = kernel_adapter(options.channel).driver or name
    return [
        f"USB adapter ({name}): answers up to {kept * 1e3:g} ms late; measured less: usb_latency_s"
    ]
