"""The latency timer of an FTDI adapter (U2D2 and most others): read it, set it where permitted.

FTDI hands bytes on when 62 have come or the timer runs out (ftdichip.com, AN232B-04), 16 ms unless
set: every response waits for it. Linux shows it in sysfs.
"""

from __future__ import annotations

import os
from pathlib import Path

SYSFS = Path("/sys/bus/usb-serial/devices")


def timer_file(port: str, sysfs: Path = SYSFS) -> Path | None:
    """Return the sysfs file of a serial device's latency timer; None where there is none."""
    name = os.path.basename(os.path.realpath(port))
    path = sysfs / name / "latency_timer"
    return path if path.is_file() else None


def latency_timer_s(port: str, sysfs: Path = SYSFS) -> float | None:
    """Return the latency timer of a serial device [s]; None if unknown."""
    path = timer_file(port, sysfs)
    try:
        return None if path is None else int(path.read_text()) * 1e-3
    except (OSError, ValueError):
        return None


def set_latency_timer(port: str, wanted_s: float, sysfs: Path = SYSFS) -> str:
    """Set the latency timer to `wanted_s` [s]; return a note, '' where there is no timer.

    Where that is not permitted, the note has the command that does it.
    """
    path = timer_file(port, sysfs)
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
