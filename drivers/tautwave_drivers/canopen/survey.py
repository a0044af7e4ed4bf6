"""From what `tautwave scan canopen` found, or from an EDS, to a bus of a rig file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tautwave.types import FoundBus, FoundDevice, Setting, Survey
from tautwave_drivers.assumed import assumed_axis
from tautwave_drivers.canopen.files.belonging import identity_of
from tautwave_drivers.canopen.files.reading import read_device_file
from tautwave_drivers.canopen.scan import MOTOR, ScanOptions
from tautwave_drivers.cia402.units import MAXON, MICRO, MILLI

PEAK = 3.0
"""Peak torque of a servo motor, in rated torques."""

NETS = Path("/sys/class/net")
ARPHRD_CAN = "280"
SPEED = Setting(20.0, "[rad/s] TODO: the run stops above it")


def _places() -> Sequence[Mapping[str, Any]]:
    found = []
    for net in sorted(NETS.glob("*")):
        try:
            if (net / "type").read_text().strip() == ARPHRD_CAN:
                found.append({"interface": "socketcan", "channel": net.name})
        except OSError:
            continue  # it has gone meanwhile
    return found


def _propose(options: ScanOptions, rows: Sequence[Mapping[str, Any]]) -> Sequence[FoundBus]:
    answering = [row for row in rows if "vendor" in row]
    notes = [f"node {row['node']} sends, but does not respond: left out" for row in rows]
    notes = [note for note, row in zip(notes, rows, strict=True) if row not in answering]
    if not answering:
        return []
    given = {
        "interface": Setting(options.interface),
        "channel": Setting(options.channel),
        "bitrate": Setting(options.bitrate, "as the drives are set"),
    }
    devices = [
        _device(int(row["node"]), row, str(row.get("device") or "drive")) for row in answering
    ]
    return [FoundBus("can", "canopen", given, "nodes", devices, [*notes, *_notes(answering)])]


def _describe(path: Path, ids: Sequence[int]) -> FoundBus:
    """Return a bus of drives that an EDS describes.

    Raises
    ------
    ConfigError
        It is not an EDS or DCF file.
    """
    file = read_device_file(str(path))
    row: dict[str, Any] = {
        **identity_of(file),
        **{column: file.number(entry) for column, entry in MOTOR.items()},
    }
    name = file.info.get("productname") or file.info.get("vendorname") or path.stem
    given = {
        "interface": Setting("socketcan"),
        "channel": Setting("can0", "TODO: `ip link` lists the available ones"),
        "bitrate": Setting(1_000_000, "TODO: as the drives are set"),
    }
    devices = [_device(number, row, name, str(path)) for number in ids]
    return FoundBus("can", "canopen", given, "nodes", devices, _notes([row]))


def _device(number: int, row: Mapping[str, Any], name: str, eds: str = "") -> FoundDevice:
    vendor, product = (_number(row.get(key)) for key in ("vendor", "product"))
    entry: dict[str, Any] = {"id": number}
    if vendor is not None and product is not None:
        entry["identity"] = {"vendor": vendor, "product": product}
    raw = _number(row.get("rated_torque"))
    rated = 0.1 if not raw else raw * (MICRO if vendor == MAXON else MILLI)
    turns = _number(row.get("revolutions")) or 1
    counts = round((_number(row.get("increments")) or 4096) / turns)
    gear = (_number(row.get("gear_motor")) or 1) / (_number(row.get("gear_shaft")) or 1)
    entry |= {"rated_torque": rated, "counts_per_revolution": counts, "gear_ratio": gear}
    if eds:
        entry["eds"] = eds
    fastest = _number(row.get("max_speed"))
    speed = SPEED
    if fastest and fastest < 100_000:
        radians = float(f"{fastest * math.tau / 60.0 / gear:.3g}")
        speed = Setting(radians, "[rad/s] TODO: the drive's limit (6080h); choose yours")
    axis = assumed_axis(PEAK * rated * gear, rated * gear, "rated torque at the output", speed)
    return FoundDevice(number, name, entry, axis)


def _notes(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    unknown = {
        "rated_torque": "rated_torque [N m] is a guess: TODO the motor's name plate",
        "increments": "counts_per_revolution is a guess: TODO encoder lines times 4",
        "gear_motor": "gear_ratio is a guess: TODO motor turns per turn of the lever",
    }
    found = [
        text for key, text in unknown.items() if any(not _number(row.get(key)) for row in rows)
    ]
    return [*found, "direction: -1 where the motor turns against the axis. TODO: check each."]


def _number(value: Any) -> int | None:
    """Return a number of a scan or an EDS, None where there is none."""
    if isinstance(value, int):
        return value
    try:
        return int(str(value), 0)
    except ValueError:
        return None


survey = Survey(_places, _propose, _describe, "eds")
