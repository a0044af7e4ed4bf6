"""From what `tautwave scan modbus` found, or from a profile, to a bus of a rig file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tautwave.types import FoundBus, FoundDevice, Setting, Survey
from tautwave_drivers.assumed import assumed_axis
from tautwave_drivers.modbus.scan import ScanOptions

if TYPE_CHECKING:
    from tautwave_drivers.modbus.profile import Profile

RATED = 1.0
"""[N m] In place of the name plate's."""

COUNTS = 10_000
"""Per turn, in place of the manual's."""

PEAK = 3.0
"""Peak torque of a servo motor, in rated torques."""

SPEED = Setting(6.0, "[rad/s] TODO: the run stops above it")


def _places() -> Sequence[Mapping[str, Any]]:
    return []  # no way to find a TCP host; on a serial port the baud rate has to be known


def _propose(options: ScanOptions, rows: Sequence[Mapping[str, Any]]) -> Sequence[FoundBus]:
    from tautwave_drivers.modbus.profile import SHIPPED, load_profile

    known: dict[str, tuple[str, Profile]] = {}
    for name in (*SHIPPED, *options.profiles):
        profile = load_profile(name)
        known[profile.family] = (name, profile)
    usable = [row for row in rows if row.get("profile") in known]
    notes = [
        f"{row['endpoint']}, unit {row['unit']}, fits no profile: left out; write one and name it "
        "with --profiles"
        for row in rows
        if row.get("unit") is not None and row not in usable
    ]
    if not usable:
        return []
    endpoint = str(usable[0]["endpoint"])
    given = {"link": Setting("tcp"), "endpoint": Setting(endpoint)}
    if options.rtu and endpoint.startswith("tcp://"):
        given["link"] = Setting("rtu", "a serial server passes RTU frames on")
    elif not endpoint.startswith("tcp://"):
        given = {
            "link": Setting("rtu"),
            "endpoint": Setting(endpoint),
            "baud": Setting(options.baud),
            "parity": Setting(options.parity),
            "stop_bits": Setting(options.stop_bits),
        }
    devices = [
        _device(int(row["unit"]), *known[row["profile"]], own=_own(row, endpoint)) for row in usable
    ]
    return [FoundBus("drives", "modbus", given, "devices", devices, [*notes, *_notes(devices)])]


def _own(row: Mapping[str, Any], endpoint: str) -> dict[str, Any]:
    return {} if row["endpoint"] == endpoint else {"endpoint": row["endpoint"]}


def _describe(path: Path, ids: Sequence[int]) -> FoundBus:
    """Return a bus of drives that a profile describes.

    Raises
    ------
    ConfigError
        It is not a profile.
    """
    from tautwave_drivers.modbus.profile import load_profile

    profile = load_profile(str(path))
    given = {
        "link": Setting("tcp", "TODO: or rtu, with baud, parity and stop_bits"),
        "endpoint": Setting("tcp://192.168.1.20:502", "TODO: its address, or a serial port"),
    }
    devices = [_device(number, str(path), profile, {}) for number in ids]
    return FoundBus("drives", "modbus", given, "devices", devices, _notes(devices))


def _device(number: int, name: str, profile: Profile, own: Mapping[str, Any]) -> FoundDevice:
    entry: dict[str, Any] = {"unit": number, **own, "profile": name}
    used = [profile.register_of("effort"), profile.register_of("command_effort")]
    units = {register.unit for register in used if register is not None}
    if "rated" in units:
        entry["rated_torque"] = RATED
    if "A" in units:
        entry["torque_constant"] = RATED
    if profile.counts_per_revolution is None:
        entry["counts_per_revolution"] = COUNTS
    axis = assumed_axis(PEAK * RATED, RATED, "rated torque at the output", SPEED)
    return FoundDevice(number, profile.family, entry, axis)


def _notes(devices: Sequence[FoundDevice]) -> list[str]:
    guessed = {
        "rated_torque": "rated_torque [N m] is a guess: TODO the motor's name plate",
        "torque_constant": "torque_constant [N m/A] is a guess: TODO the motor's data sheet",
        "counts_per_revolution": "counts_per_revolution is a guess: TODO the drive's manual",
    }
    texts = [text for key, text in guessed.items() if any(key in one.options for one in devices)]
    return [*texts, "gear_ratio: motor turns per turn of the axis, direction: 1 or -1. TODO: both."]


survey = Survey(_places, _propose, _describe, "profile")
