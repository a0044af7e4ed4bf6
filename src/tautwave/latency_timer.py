"""The latency timer of a USB serial adapter: the file in which Linux shows and sets it.

FTDI hands bytes on when 62 have come or this timer runs out (ftdichip.com, AN232B-04), 16 ms unless
set. Drivers set it, and `tautwave doctor` says what it costs.
"""

from __future__ import annotations

import os
from pathlib import Path

SYSFS = Path("/sys")


def timer_file(port: str | Path, sysfs: Path = SYSFS) -> Path | None:
    """Return the file of a port's timer [ms], of the device that its name leads to; None without.

    Parameters
    ----------
    port : str or Path
        A serial device, or a link to one such as those in /dev/serial/by-id.
    sysfs : Path
        Where sysfs is mounted.
    """
    device = os.path.basename(os.path.realpath(port))
    path = sysfs / "bus/usb-serial/devices" / device / "latency_timer"
    return path if path.is_file() else None


def read_integer(path: Path) -> int | None:
    """Return what a file of sysfs shows, such as a timer [ms]; None where that is no integer."""
    try:
        return int(path.read_text())
    except (OSError, ValueError):
        return None
