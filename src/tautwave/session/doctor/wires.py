"""Serial ports and CAN interfaces: permissions, latency timers, bit rates, queues."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from tautwave.config.guard import parse_json
from tautwave.latency_timer import read_integer, timer_file
from tautwave.session.doctor.finding import BARS, COSTS, GOOD, UNKNOWN, Finding

LONGEST_TIMER_MS = 1
MIN_QUEUE = 20
"""Frames; a cycle of six axes and SYNC sends seven, and two cycles may wait after a hiccup."""

ARPHRD_CAN = "280"
Links = Callable[[str], Mapping[str, Any]]


def serial_ports(root: Path) -> list[str]:
    """Return the USB serial ports there are."""
    names = [*root.glob("dev/ttyUSB*"), *root.glob("dev/ttyACM*")]
    return sorted(f"/{name.relative_to(root)}" for name in names)


def can_interfaces(root: Path) -> list[str]:
    """Return the CAN interfaces there are."""
    nets = sorted((root / "sys/class/net").glob("*"))
    return [net.name for net in nets if _read(net / "type") == ARPHRD_CAN]


def serial_port(port: str, root: Path) -> Iterator[Finding]:
    """Look at one serial port: is it there, may this user open it, how long does it hold bytes."""
    path = root / port.lstrip("/")
    if not path.exists():
        yield Finding(
            port, BARS, "is not there", "the run cannot open it",
            "plug in the adapter; `ls /dev/serial/by-id` lists the adapters present",
        )  # fmt: skip
        return
    if not os.access(path, os.R_OK | os.W_OK):
        yield Finding(
            port, BARS, "no permission", "the run cannot open it",
            f"sudo usermod -aG {_group(path)} $USER   # then log in again",
        )  # fmt: skip
    timer = timer_file(path, root / "sys")
    found_ms = None if timer is None else read_integer(timer)
    if timer is None or found_ms is None:
        yield Finding(port, GOOD, "no latency timer")
    elif found_ms <= LONGEST_TIMER_MS:
        yield Finding(port, GOOD, f"latency timer {found_ms} ms")
    else:
        yield Finding(
            port, COSTS, f"latency timer {found_ms} ms",
            f"every exchange waits up to {found_ms} ms for its last bytes",
            f"echo 1 | sudo tee /{timer.relative_to(root)}",
        )  # fmt: skip


def can_interface(channel: str, root: Path, bitrate: int | None, links: Links) -> Iterator[Finding]:
    """Look at one CAN interface; `bitrate` [bit/s] is what the rig wants, None: not known."""
    net = root / "sys/class/net" / channel
    if not net.exists():
        yield Finding(
            channel, BARS, "is not there", "the run cannot open it",
            "plug in the adapter and load its driver; `ip link` lists the interfaces present",
        )  # fmt: skip
        return
    details = links(channel)
    rate = details.get("linkinfo", {}).get("info_data", {}).get("bittiming", {}).get("bitrate")
    wanted = bitrate or rate or 1_000_000
    up = f"sudo ip link set {channel} up type can bitrate {wanted}"
    if channel.startswith(("vcan", "vxcan")):
        up = f"sudo ip link set {channel} up"
    if _read(net / "flags") and not int(_read(net / "flags"), 16) & 1:
        yield Finding(channel, BARS, "down", "no frame passes", up)
    elif rate is not None and bitrate is not None and rate != bitrate:
        yield Finding(
            channel, BARS, f"{rate} bit/s, but the rig states {bitrate}", "drives see errors only",
            f"sudo ip link set {channel} down; {up}",
        )  # fmt: skip
    else:
        yield Finding(channel, GOOD, "up" if rate is None else f"up, {rate} bit/s")
    state = details.get("linkinfo", {}).get("info_data", {}).get("state", "")
    if state in ("ERROR-PASSIVE", "BUS-OFF"):
        yield Finding(
            channel, BARS, f"state {state}", "no node acknowledges its frames: wiring, termination",
            f"sudo ip link set {channel} down; {up} restart-ms 100",
        )  # fmt: skip
    queue = _read(net / "tx_queue_len")
    yield from _waiting(channel, details.get("queue", {}).get("qlen", 0), queue, up)
    if queue.isdigit() and int(queue) < MIN_QUEUE:
        yield Finding(
            channel, COSTS, f"queue of {queue} frames",
            "frames beyond that in one cycle are lost",
            f"sudo ip link set {channel} txqueuelen 100",
        )  # fmt: skip
    elif not queue.isdigit():
        yield Finding(channel, UNKNOWN, "queue length: not reported by the kernel")


def _waiting(channel: str, frames: int, room: str, up: str) -> Iterator[Finding]:
    """Say of frames in the transmit queue that they do not leave, or not yet."""
    if not frames:
        return
    full = room.isdigit() and frames >= int(room)
    yield Finding(
        channel, BARS if full else COSTS,
        f"transmit queue {'full' if full else 'not empty'}, frames waiting: {frames}",
        "where nothing sends now, no node acknowledges: cable, power, bit rate",
        f"sudo ip link set {channel} down; {up}   # drops them",
    )  # fmt: skip


def link_details(channel: str) -> Mapping[str, Any]:
    """Return what `ip` knows of a CAN interface, and `tc` of its queue; {} where neither is."""
    link = _first_object("ip", "-details", "-json", "link", "show", channel)
    queue = _first_object("tc", "-statistics", "-json", "qdisc", "show", "dev", channel)
    return {**link, "queue": queue} if queue else link


def _first_object(*command: str) -> Mapping[str, Any]:
    """Return the first object that a command prints as JSON; {} where it prints none."""
    try:
        done = subprocess.run(command, capture_output=True, timeout=5, check=True)
        parsed = parse_json(done.stdout.decode("utf-8", "replace"))
    except (OSError, subprocess.SubprocessError, ValueError):
        return {}
    return parsed[0] if isinstance(parsed, list) and parsed and isinstance(parsed[0], dict) else {}


def _group(path: Path) -> str:
    import grp

    try:
        return grp.getgrgid(path.stat().st_gid).gr_name
    except (KeyError, OSError):
        return "dialout"


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace").strip()
    except OSError:
        return ""
