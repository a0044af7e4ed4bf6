"""What stands between a serial device and the host: FTDI, another USB chip, CDC-ACM, a UART, a pty.

Identified by the device itself, wherever a name such as /dev/serial/by-id leads: sysfs has its
driver and whether it is on USB. With FTDI every response waits for the latency timer. The other USB
devices pass their data on with the next frame of the bus, 1 ms at full speed (USB 2.0, 5.3).
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal, NamedTuple

from tautwave.latency_timer import SYSFS, read_integer, timer_file

USB_S = 0.001
"""[s] Latency timer of an FTDI adapter as it should be set, and a frame of the bus."""

Kind = Literal["ftdi", "usb", "cdc-acm", "uart", "pty"]


class Adapter(NamedTuple):
    """What a serial device is: its kind, and the file of its latency timer where it has one."""

    kind: Kind
    timer: Path | None = None

    @property
    def found_s(self) -> float | None:
        """[s] The latency timer as it is; None without one."""
        found_ms = None if self.timer is None else read_integer(self.timer)
        return None if found_ms is None else found_ms * 1e-3

    @property
    def latency_s(self) -> float:
        """[s] How long it keeps a response in a run, which sets the timer where it may."""
        if self.kind in ("uart", "pty"):
            return 0.0
        measured = self.found_s
        if measured is None or self.timer is None or os.access(self.timer, os.W_OK):
            return USB_S
        return max(measured, USB_S)


def adapter_of(port: str) -> Adapter:
    """Return the kind of a serial device; one that is not plugged in is judged by its name."""
    device = os.path.realpath(port)
    name = os.path.basename(device)
    if device.startswith("/dev/pts/"):
        return Adapter("pty")
    timer = timer_file(device, SYSFS)
    if timer is not None:
        return Adapter("ftdi", timer)
    node = SYSFS / "class/tty" / name / "device"
    if node.exists():
        driver = os.path.basename(os.path.realpath(node / "driver"))
        if driver == "cdc_acm":
            return Adapter("cdc-acm")
        if driver == "ftdi_sio":
            return Adapter("ftdi")
        return Adapter("usb" if "/usb" in os.path.realpath(node) else "uart")
    if name.startswith("ttyACM"):
        return Adapter("cdc-acm")
    by_usb = device.startswith("/dev/serial/") and "usb-" in name
    if by_usb and ("FTDI" in name or "ROBOTIS" in name):
        return Adapter("ftdi")
    return Adapter("usb" if by_usb or name.startswith("ttyUSB") else "uart")


def set_latency_timer(port: str, wanted_s: float) -> str:
    """Set the latency timer to `wanted_s` [s]; return a note, '' where there is no timer.

    Where that is not permitted, the note has the command that does it.
    """
    path = adapter_of(port).timer
    if path is None:
        return ""
    wanted_ms = max(1, round(wanted_s * 1e3))
    try:
        found_ms = int(path.read_text())
        if found_ms <= wanted_ms:
            return f"{port}: USB latency timer {found_ms} ms"
        path.write_text(f"{wanted_ms}\n")
        found_ms, before_ms = int(path.read_text()), found_ms
    except PermissionError:
        return (
            f"{port}: warning: USB latency timer {found_ms} ms, every cycle waits for it; "
            f"set it with: echo {wanted_ms} | sudo tee {path}"
        )
    except (OSError, ValueError) as err:
        return f"{port}: warning: USB latency timer unknown ({err})"
    return f"{port}: USB latency timer set from {before_ms} to {found_ms} ms"
