"""From what `tautwave scan canopen` found, or from an EDS, to a bus of a rig file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tautwave.contracts import AxisSpec
from tautwave.errors import ConfigError
from tautwave.types import FoundBus, FoundDevice, Hexadecimal, Setting, Survey
from tautwave_drivers.assumed import assumed_axis
from tautwave_drivers.can.places import can_places
from tautwave_drivers.canopen.files.belonging import KIND, identity_of, why_refused
from tautwave_drivers.canopen.files.reading import DeviceFile, read_device_file
from tautwave_drivers.canopen.foresight import of_file
from tautwave_drivers.canopen.mapping import mappings_of
from tautwave_drivers.canopen.options import CanopenOptions
from tautwave_drivers.canopen.scan import MOTOR, ScanOptions
from tautwave_drivers.canopen.setup.meaning import counts_per_turn
from tautwave_drivers.cia402 import objects as o
from tautwave_drivers.cia402.modes import Mode
from tautwave_drivers.cia402.units import MAXON, MICRO, MILLI

PEAK = 3.0
"""Peak torque of a servo motor, in rated torques."""

SPEED = Setting(20.0, "[rad/s] TODO: the run stops above it")


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
        It is not an EDS or DCF file, describes no drive that takes torque, or has a default that
        a rig needs and that is no integer.
    """
    file = read_device_file(str(path))
    if problems := file.unreadable((*KIND, *MOTOR.values())):
        raise ConfigError(problems)
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
    notes = [*_notes([row]), *(f"TODO: {one}" for one in _foreseen(file, devices[0]))]
    return FoundBus("can", "canopen", given, "nodes", devices, [*file.remarks, *notes])


def _foreseen(file: DeviceFile, device: FoundDevice) -> list[str]:
    """Return the sentences of a run on a drive as its file describes it.

    Raises
    ------
    ConfigError
        It would refuse any such drive.
    """
    options = CanopenOptions.model_validate({"nodes": [dict(device.options)]})
    (node,) = options.nodes
    reasons = why_refused(
        file, Mode.CST, (o.TARGET_TORQUE, o.POSITION), mappings_of("impedance", node)
    )
    if reasons:
        raise ConfigError(reasons)
    keys = (device.axis[key].value for key in ("effort_limit", "velocity_limit"))
    return list(
        of_file(file, AxisSpec("", node.id, "rotary", "impedance", *keys), node, options, 1e3)
    )


def _device(number: int, row: Mapping[str, Any], name: str, eds: str = "") -> FoundDevice:
    vendor, product = (_number(row.get(key)) for key in ("vendor", "product"))
    entry: dict[str, Any] = {"id": number}
    if vendor is not None and product is not None:
        entry["identity"] = {
            "vendor": Hexadecimal(vendor),
            "product": Hexadecimal(product),
        }
    raw = _number(row.get("rated_torque"))
    rated = 0.1 if not raw else raw * (MICRO if vendor == MAXON else MILLI)
    counts = max(1, round(_increments(row) or 4096))
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


def _increments(row: Mapping[str, Any]) -> float | None:
    """Return counts per motor turn, None where they are not stated."""
    return counts_per_turn({entry: _number(row.get(name)) for name, entry in MOTOR.items()})


def _notes(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    unknown = (
        ("rated_torque [N m]", "the motor's name plate, or 6076h in the drive's tool"),
        ("counts_per_revolution", "encoder lines times 4, or 6064h over one turn by hand"),
        ("gear_ratio", "motor turns per turn of the lever"),
    )
    values = [
        (_number(row.get("rated_torque")), _increments(row), _number(row.get("gear_motor")))
        for row in rows
    ]
    texts = [
        f"{key} is a guess: TODO {how}"
        for (key, how), stated in zip(unknown, zip(*values, strict=True), strict=True)
        if not all(stated)
    ]
    return [*texts, "direction: -1 where the motor turns against the axis. TODO: check each."]


def _number(value: Any) -> int | None:
    """Return a number of a scan or an EDS, None where there is none."""
    if isinstance(value, int):
        return value
    try:
        return int(str(value), 0)
    except ValueError:
        return None


survey = Survey(can_places, _propose, _describe, "eds")
