"""How long a USB adapter of python-can keeps a frame before the host has it.

Adapters on a serial port, such as those of the slcan kind, are judged as the port (`adapter.py`),
but their latency timer is not set. Others pass their data on with the next frame of the bus, 1 ms
at full speed (USB 2.0, 5.3). Interfaces of the kernel (SocketCAN) are not distinguished.
"""

from __future__ import annotations

from tautwave_drivers.adapter import USB_S, adapter_of
from tautwave_drivers.can.keys import CanKeys

ON_SERIAL_PORTS = ("slcan", "seeedstudio", "robotell")
"""Interfaces of python-can whose channel is a serial port."""
WITHOUT_USB = ("virtual", "socketcan", "udp_multicast")
UNSET_TIMER_S = 0.016
"""[s] Default latency timer of an FTDI chip (AN232B-04)."""


def latency_s(options: CanKeys) -> float:
    """Return how long an answer waits in the adapter [s]; an unknown interface is taken for USB."""
    if options.usb_latency_s is not None:
        return options.usb_latency_s
    if options.interface in WITHOUT_USB:
        return 0.0
    if options.interface == "pcan" and "USB" not in options.channel.upper():
        return 0.0  # PCAN_PCIBUS1 and the like
    if options.interface not in ON_SERIAL_PORTS:
        return USB_S
    adapter = adapter_of(options.channel.partition("@")[0])  # slcan: PORT@BAUD
    if adapter.kind == "ftdi":
        found = adapter.found_s
        return UNSET_TIMER_S if found is None else max(found, USB_S)
    return adapter.latency_s


def latency_lines(options: CanKeys) -> list[str]:
    """Return what the adapter adds, as lines of a budget; none where it adds nothing."""
    kept = latency_s(options)
    if not kept:
        return []
    return [
        f"USB adapter ({options.interface}): answers up to {kept * 1e3:g} ms late; measured less: "
        "usb_latency_s"
    ]
