"""From what `tautwave scan dynamixel` found to a bus of a rig file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.types import FoundBus, FoundDevice, Setting, Survey
from tautwave_drivers.adapter import USB_S, adapter_of
from tautwave_drivers.assumed import assumed_axis
from tautwave_drivers.dynamixel.protocol.models import CAVEAT, MODELS, Model
from tautwave_drivers.dynamixel.scan import ScanOptions
from tautwave_drivers.serial_ports import port_names

ADVISED_SHARE = 0.2
"""Of the stall torque, which ROBOTIS advises for long life."""

FASTEST = 15.0
"""[rad/s] Velocity limit to begin with, where the servo has no lower one."""


def _places() -> Sequence[Mapping[str, Any]]:
    return [{"port": port, "protocol": 2.0} for port in port_names()]


def _propose(options: ScanOptions, rows: Sequence[Mapping[str, Any]]) -> Sequence[FoundBus]:
    notes, usable = [], []
    for row in rows:
        model = MODELS.get(str(row["model"]))
        if row["protocol"] < 1.5 or model is None or not model.current_unit:
            notes.append(f"id {row['id']}, {row['model']}, has no current control: left out")
        else:
            usable.append(row)
    if not usable:
        return []
    baud = Counter(row["baud"] for row in usable).most_common(1)[0][0]
    notes += [
        f"id {row['id']} responds at {row['baud']} baud only: left out until it is set to {baud}"
        for row in usable
        if row["baud"] != baud
    ]
    given: dict[str, Setting] = {
        "port": Setting(options.port, "a name in /dev/serial/by-id stays the same"),
        "baud": Setting(baud, "as the servos answered"),
    }
    latency_s = adapter_of(options.port).found_s
    if latency_s is not None:
        given["usb_latency_s"] = Setting(
            min(latency_s, USB_S), "of the adapter; `tautwave doctor` checks it"
        )
    devices = [_device(row) for row in usable if row["baud"] == baud]
    notes += [
        f"Torque constants are {CAVEAT}: TODO measure yours (torque_constant, N m/A).",
        "zero_counts: 2048 is mid-turn; direction: -1 mirrors an axis. TODO: check both.",
    ]
    return [FoundBus("servos", "dynamixel", given, "servos", devices, notes)]


def _device(row: Mapping[str, Any]) -> FoundDevice:
    model = MODELS[str(row["model"])]
    speed = row.get("velocity_limit")
    limit = Setting(FASTEST, "[rad/s] TODO: the run stops above it")
    if speed and speed < FASTEST:
        limit = Setting(speed, "[rad/s] the servo's own Velocity Limit(44); the run stops above it")
    axis = assumed_axis(model.stall_torque, _limit(model, row), "a fifth of stall", limit)
    entry = {"id": row["id"], "model": model.name, "zero_counts": 2048}
    return FoundDevice(int(row["id"]), f"{model.name}, firmware {row['firmware']}", entry, axis)


def _limit(model: Model, row: Mapping[str, Any]) -> float:
    """Return a fifth of stall [N m], or what the servo's own current limit leaves."""
    current = row.get("current_limit")
    most = model.stall_torque if current is None else current * model.torque_constant
    return min(ADVISED_SHARE * model.stall_torque, most)


survey = Survey(_places, _propose)
