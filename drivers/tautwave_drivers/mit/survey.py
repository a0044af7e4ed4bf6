"""From what `tautwave scan mit` found to a bus of a rig file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.types import FoundBus, FoundDevice, Setting, Survey
from tautwave_drivers.assumed import assumed_axis
from tautwave_drivers.can.places import can_places
from tautwave_drivers.mit.scan import ScanOptions

SHARE = 0.2
"""Of the range of torque, to begin with: rated torque of these motors is a third of it."""
DAMPING_S = 11.0
"""[1/s] Damping over inertia of a bare 10:1 motor of this kind: 0.02 N m s/rad and 0.0018 kg m2."""
NEEDED = ("p_max", "v_max", "t_max")


def _propose(options: ScanOptions, rows: Sequence[Mapping[str, Any]]) -> Sequence[FoundBus]:
    notes, usable = [], []
    for row in rows:
        if row.get("errors", "none") != "none":
            notes.append(f"motor {row['id']}: {row['errors']}; left out until that is changed")
        elif not all(row.get(key) for key in NEEDED):
            notes.append(f"motor {row['id']} does not say its ranges: left out")
        else:
            usable.append(row)
    if not usable:
        return []
    given = {
        "interface": Setting(options.interface),
        "channel": Setting(options.channel),
        "bitrate": Setting(options.bitrate, "as the motors answered"),
    }
    if options.data_bitrate:
        given["data_bitrate"] = Setting(options.data_bitrate, "CAN FD")
    notes.append(
        "zero: 0 is where the motor was set to zero; direction: -1 mirrors an axis. TODO: check "
        "both."
    )
    return [FoundBus("can", "mit", given, "motors", [_device(row) for row in usable], notes)]


def _device(row: Mapping[str, Any]) -> FoundDevice:
    number = int(row["id"])
    entry: dict[str, Any] = {"id": number, "feedback_id": int(row["feedback_id"])}
    entry |= {key: float(row[key]) for key in NEEDED}
    torque, fastest = float(row["t_max"]), float(row["v_max"])
    speed = Setting(
        float(f"{0.5 * fastest:.3g}"), "[rad/s] TODO: half of its VMAX; the run stops above it"
    )
    axis = assumed_axis(torque, SHARE * torque, "a fifth of TMAX", speed)
    gear, rotor = row.get("gear"), row.get("rotor_inertia")
    if gear and rotor:
        # Registers: the rotor's inertia, seen through the gear.
        inertia = float(f"{float(rotor) * float(gear) ** 2:.2g}")
        source = "registers 12 and 20: the bare motor"
        axis["inertia"] = Setting(
            {"value": inertia, "lower": float(f"{0.9 * inertia:.2g}"), "source": source},
            "[kg m^2] TODO: add what it moves; measure it with `tautwave identify`",
        )
        damping = float(f"{DAMPING_S * inertia:.2g}")
        axis["damping"] = Setting(
            {"value": damping, "lower": float(f"{0.5 * damping:.2g}"), "source": "assumed"},
            "[N m s/rad] TODO: likewise",
        )
    name = f"motor of {torque:g} N m, firmware {row.get('firmware')}"
    return FoundDevice(number, name, entry, axis)


survey = Survey(can_places, _propose)
