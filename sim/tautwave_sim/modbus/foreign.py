"""A third party's drive, simulated from the profile that its driver reads.

Here both ends read the same file, so a wrong address in it agrees with itself; it shows that the
profile is whole and its sequences lead somewhere, and lets a rig run before the drive is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from tautwave.errors import ConfigError
from tautwave_sim.modbus.registers import Register
from tautwave_sim.modbus.table import Sequences, Table, make_register

_LIMITS = ("forward", "backward")


def load_profile(path: Path) -> Table:
    """Return the table of the drive that a profile describes.

    Raises
    ------
    ConfigError
        There is no such file, or a key that the simulation needs is missing or wrong.
    """
    try:
        keys = yaml.safe_load(path.read_text("utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as err:
        raise ConfigError(f"modbus: profile {path}: cannot be read: {err}") from err
    try:
        return _table(keys)
    except (KeyError, TypeError, ValueError, AttributeError) as err:
        raise ConfigError(
            f"modbus: profile {path}: cannot be simulated: {type(err).__name__}: {err}"
        ) from err


def _table(keys: Mapping[str, Any]) -> Table:
    default_order = keys.get("word_order", "high_first")
    raw: Mapping[str, Mapping[str, Any]] = keys["registers"]
    registers: dict[str, Register] = {}
    for name, one in raw.items():
        order = one.get("word_order") or default_order
        told = {**one, "type": one.get("type", "u16"), "eeprom": one.get("lasting", False)}
        registers[name] = make_register(name, told, order == "low_first")
    roles = dict(keys["roles"])
    scale: dict[str, Any] = {}
    if "effort" in roles or "command_effort" in roles:
        scale.update(_effort(raw[roles.get("command_effort") or roles["effort"]]))
    if "velocity" in roles or "command_velocity" in roles:
        scale["velocity"] = _velocity(raw[roles.get("command_velocity") or roles["velocity"]])
    if "rated_torque" in roles:
        scale["rated_torque"] = float(raw[roles["rated_torque"]].get("scale", 1.0))
    if keys.get("comm_loss"):
        roles["comm_timeout"] = keys["comm_loss"]["register"]
        scale["comm_timeout"] = float(raw[roles["comm_timeout"]].get("scale", 1.0))
    off = keys.get("eeprom_off")
    if off:
        roles["eeprom"] = off["register"]
    roles.update(_limits(keys.get("limits") or {}))
    registers = _with_defaults(registers, roles, keys)
    states = keys.get("states") or {}
    return Table(
        family="cia402" if keys.get("machine") == "cia402" else "steps",
        functions=tuple(keys["functions"]),
        registers=registers,
        roles=roles,
        modes={value: kind for kind, value in (keys.get("modes") or {}).items()},
        states={
            "off": 0,
            "on": states["enabled"]["value"] if states else 0,
            "fault": states["fault"]["value"] if states else 0,
        },
        faults={"overcurrent": max(keys.get("faults") or {1: ""})},
        scale={"velocity": "counts", "effort": 0.001, "rated_torque": 1.0, **scale},
        counts_per_revolution=keys.get("counts_per_revolution") or 65536,
        limit_bit=(states.get("limit") or {}).get("value", 0),
        eeprom_off=off["value"] if off else 0,
        sequences=_sequences(keys),
    )


def _effort(one: Mapping[str, Any]) -> dict[str, float]:
    scale = float(one.get("scale", 1.0))
    if one.get("unit") == "rated":
        return {"effort": scale}
    if one.get("unit") == "N m":
        return {"effort_nm": scale}
    if one.get("unit") == "A":
        return {"effort_a": scale}
    raise ValueError(f"effort in {one.get('unit')!r}; rated, N m and A can be simulated")


def _velocity(one: Mapping[str, Any]) -> str | float:
    scale = float(one.get("scale", 1.0))
    if one.get("unit") == "rpm":
        return scale / 60.0
    if one.get("unit") == "counts/s" and scale == 1.0:
        return "counts"
    raise ValueError(f"velocity in {scale} {one.get('unit')!r}; rpm and counts/s can be simulated")


def _limits(keys: Mapping[str, Any]) -> dict[str, str]:
    found = {}
    for kind in ("effort", "velocity"):
        names = list(keys.get(kind) or ())
        for way, name in zip(_LIMITS, (names * 2)[:2] if names else (), strict=False):
            found[f"{kind}_limit_{way}"] = name
    for end in ("position_low", "position_high"):
        if keys.get(end):
            found[end] = keys[end]
    return found


def _with_defaults(
    registers: dict[str, Register], roles: Mapping[str, str], keys: Mapping[str, Any]
) -> dict[str, Register]:
    """Return registers with what such a drive would hold as delivered."""
    fresh = dict(registers)
    for role, name in roles.items():
        if "_limit_" in role or role == "position_high":
            fresh[name] = fresh[name]._replace(default=fresh[name].high)
        elif role == "position_low":
            fresh[name] = fresh[name]._replace(default=fresh[name].low)
    identity = keys.get("identity") or {}
    for setting in (identity, *(keys.get("expected") or ())):
        if setting.get("value") is not None:
            name = setting["register"]
            fresh[name] = fresh[name]._replace(default=setting["value"])
    return fresh


def _sequences(keys: Mapping[str, Any]) -> Sequences:
    """Return which writes switch it on, and which of a fault reset's is the one that counts."""
    writes = {
        name: [(step["write"], step["value"]) for step in keys.get(name) or () if "write" in step]
        for name in ("enable", "disable", "fault_reset")
    }
    resets = [one for one in writes["fault_reset"] if one not in writes["disable"]]
    return Sequences(dict(writes["enable"]), tuple(resets[:1] or writes["fault_reset"][:1]))
