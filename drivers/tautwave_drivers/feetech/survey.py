"""From what `tautwave scan feetech` found to a bus of a rig file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.types import FoundBus, FoundDevice, Setting, Survey
from tautwave_drivers.adapter import USB_S, adapter_of
from tautwave_drivers.assumed import assumed_axis
from tautwave_drivers.feetech.models import MODELS, Model
from tautwave_drivers.feetech.options import STEADY_A
from tautwave_drivers.feetech.scan import ScanOptions
from tautwave_drivers.serial_ports import port_names

SHARE = 0.3
"""Of what a servo gives at stall, to begin with."""
FASTEST = 6.0
"""[rad/s] Velocity limit to begin with."""


def _places() -> Sequence[Mapping[str, Any]]:
    return [{"port": port} for port in port_names()]


def _propose(options: ScanOptions, rows: Sequence[Mapping[str, Any]]) -> Sequence[FoundBus]:
    notes, usable = [], []
    for row in rows:
        model = MODELS.get(str(row["model"]))
        if row.get("errors"):
            notes.append(f"id {row['id']}: {row['errors']}: left out")
        elif row["series"] not in ("STS", "SMS", "HLS") or model is None:
            notes.append(f"id {row['id']}, {row['model']} ({row['series']}): left out")
        elif not model.torque_constant:
            notes.append(
                f"id {row['id']}, {row['model']}: its torque constant is not known: left out"
            )
        else:
            usable.append(row)
    if not usable:
        return []
    baud = Counter(row["baud"] for row in usable).most_common(1)[0][0]
    notes += [
        f"id {row['id']} answers at {row['baud']} baud only: left out until it is set to {baud}"
        for row in usable
        if row["baud"] != baud
    ]
    usable = [row for row in usable if row["baud"] == baud]
    given: dict[str, Setting] = {
        "port": Setting(options.port, "a name in /dev/serial/by-id stays the same"),
        "baud": Setting(baud, "as the servos answered"),
        "power_cut": Setting(
            "TODO", "how their power is cut by hand; a run is refused until it says so"
        ),
    }
    latency_s = adapter_of(options.port).found_s
    if latency_s is not None:
        given["usb_latency_s"] = Setting(
            min(latency_s, USB_S), "of the adapter; `tautwave doctor` checks it"
        )
    delays = [row["return_delay_us"] for row in usable if row.get("return_delay_us")]
    if delays:
        given["return_delay_s"] = Setting(
            max(delays) * 1e-6,
            "[s] the longest that was read; 0 is quicker, and set at every start",
        )
    volts = [row["voltage"] for row in usable if row.get("voltage")]
    if volts:
        given["supply_v"] = Setting(round(sum(volts) / len(volts), 1), "[V] as the servos measured")
    notes += [
        "gear: an SO-101's leader has servos of 1:147 and 1:191, which no register says. TODO: "
        "state each.",
        "damping includes the motor's back-EMF, by data of one servo. TODO: measure yours with "
        "`tautwave identify`.",
        "direction: -1 mirrors an axis. TODO: check each.",
    ]
    return [FoundBus("servos", "feetech", given, "servos", [_device(row) for row in usable], notes)]


def _device(row: Mapping[str, Any]) -> FoundDevice:
    model = MODELS[str(row["model"])]
    torque = _stall(model, row)
    speed = Setting(FASTEST, "[rad/s] TODO: the run stops above it")
    axis = assumed_axis(torque, SHARE * torque, f"{SHARE:.0%} of stall", speed)
    if model.inertia:
        damping = model.friction + model.torque_constant**2 / model.resistance
        for key, value, what in (
            ("inertia", model.inertia, "[kg m^2] TODO: of the bare servo, add what it moves"),
            ("damping", damping, "[N m s/rad] TODO: with the back-EMF of its gear"),
        ):
            belief = {"value": _round(value), "lower": _round(0.6 * value)}
            axis[key] = Setting({**belief, "source": "identified by others"}, what)
    entry: dict[str, Any] = {"id": row["id"], "model": model.name, "zero_counts": 2048}
    if row.get("offset"):
        entry["offset"] = row["offset"]
    if model.gear:
        entry["gear"] = model.gear
    return FoundDevice(
        int(row["id"]), f"{model.name}, firmware {row['firmware']} ({row['series']})", entry, axis
    )


def _stall(model: Model, row: Mapping[str, Any]) -> float:
    """Return the torque to begin from [N m]: at stall by the supply, or at the safe current."""
    if not model.resistance:
        return model.torque_constant * STEADY_A
    volts = float(row.get("voltage") or model.voltage)
    return model.torque_constant * volts / model.resistance


def _round(value: float) -> float:
    return float(f"{value:.2g}")


survey = Survey(_places, _propose)
