"""A third party's drive, simulated from the profile that its driver reads.

Here both ends read the same file, so a wrong address in it agrees with itself; it shows that the
profile is whole and its sequences lead somewhere, and lets a rig run before the drive is there.
What is wrong with the file is refused as the driver refuses it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from tautwave.config.messages import read_model
from tautwave.config.text.document import nearest, read_text
from tautwave.config.text.yaml12 import KeyPath
from tautwave.errors import ConfigError
from tautwave_sim.modbus.profile_keys import ProfileKeys, RegisterKeys, StepKeys
from tautwave_sim.modbus.registers import TABLES, Register
from tautwave_sim.modbus.table import Sequences, Table, make_register

RATED_TORQUE = 1.0
"""[N m] Default rated torque."""


def load_profile(path: Path) -> Table:
    """Return the table of the drive that a profile describes.

    Raises
    ------
    ConfigError
        There is no such file, or a key is missing, unknown or wrong, or cannot be simulated.
    """
    keys: ProfileKeys
    document, keys = read_model(read_text(path, "profile"), str(path), "profile", ProfileKeys)
    for where, sentence in _mistakes(keys):
        document.report(where, sentence)
    if document.problems:
        raise ConfigError(document.sentences())
    return _table(keys)


def _mistakes(keys: ProfileKeys) -> Iterator[tuple[KeyPath, str]]:
    for where, name in keys.named():
        if name not in keys.registers:
            yield where, f"there is no register {name!r}{nearest(name, list(keys.registers))}"
            continue
        one = keys.registers[name]
        role = where[1] if where[0] == "roles" else ""
        if role in ("effort", "command_effort") and one.unit not in _EFFORTS:
            units = ", ".join(_EFFORTS)
            yield ("registers", name, "unit"), f"{units} can be simulated (got {one.unit!r})"
        if role in ("velocity", "command_velocity") and _velocity(one) is None:
            yield (
                ("registers", name, "unit"),
                f"rpm, or counts/s with scale 1, can be simulated (got {one.unit!r}, scale "
                f"{one.scale:g})",
            )
    for role in ("position", "status"):
        if role not in keys.roles:
            yield ("roles",), f"{role} is missing; every profile needs it"
    if keys.machine == "cia402":
        for role in ("control", "mode", "mode_display"):
            if role not in keys.roles:
                yield ("roles",), f"{role} is missing; machine: cia402 needs it"
    elif not keys.enable or not keys.disable or keys.states is None:
        yield (), "enable, disable and states are required, unless machine is cia402"
    if not {1, 2, 3, 4} & set(keys.functions) or not {5, 6, 15, 16} & set(keys.functions):
        yield ("functions",), "one that reads (3 or 4) and one that writes (6, 16) are required"


def _table(keys: ProfileKeys) -> Table:
    raw = keys.registers
    registers: dict[str, Register] = {}
    for name, one in raw.items():
        order = one.word_order or keys.word_order
        fields = {**one.model_dump(), "eeprom": one.lasting}
        registers[name] = make_register(name, fields, order == "low_first")
    roles: dict[str, str] = {str(role): name for role, name in keys.roles.items()}
    scale: dict[str, Any] = {}
    if "effort" in roles or "command_effort" in roles:
        one = raw[roles.get("command_effort") or roles["effort"]]
        scale[_EFFORTS[one.unit]] = one.scale
    if "velocity" in roles or "command_velocity" in roles:
        scale["velocity"] = _velocity(raw[roles.get("command_velocity") or roles["velocity"]])
    if "rated_torque" in roles:
        scale["rated_torque"] = raw[roles["rated_torque"]].scale
    if keys.comm_loss is not None:
        roles["comm_timeout"] = keys.comm_loss.register_name
        scale["comm_timeout"] = raw[roles["comm_timeout"]].scale
    off = keys.eeprom_off
    if off is not None:
        roles["eeprom"] = off.register_name
    roles.update(_limits(keys))
    states = keys.states
    return Table(
        family="cia402" if keys.machine == "cia402" else "steps",
        functions=keys.functions,
        registers=_with_defaults(registers, roles, keys),
        roles=roles,
        modes={value: kind for kind, value in keys.modes.items()},
        states={
            "off": _off(keys),
            "on": states.enabled.value if states else 0,
            "fault": states.fault.value if states else 0,
        },
        faults={"overcurrent": max(keys.faults or {1: ""})},
        scale={"velocity": "counts", "effort": 0.001, "rated_torque": 1.0, **scale},
        counts_per_revolution=keys.counts_per_revolution or COUNTS,
        limit_bit=states.limit.value if states is not None and states.limit is not None else 0,
        eeprom_off=off.value if off is not None else 0,
        gaps_read_zero=tuple(
            table
            for table in TABLES
            if (keys.gaps if isinstance(keys.gaps, str) else keys.gaps.get(table)) == "readable"  # type: ignore[call-overload]
        ),
        objects=keys.addressing == "objects",
        most=(
            dict.fromkeys(TABLES, keys.most_registers)
            if isinstance(keys.most_registers, int)
            else {str(table): most for table, most in keys.most_registers.items()}
        ),
        sequences=_sequences(keys),
    )


def _off(keys: ProfileKeys) -> int:
    """Return what the status shows of a drive that is off: what disabling waits for."""
    waits = [step for step in keys.disable if step.wait == keys.roles.get("status")]
    return waits[-1].value & waits[-1].mask if waits else 0


_EFFORTS = {"rated": "effort", "N m": "effort_nm", "N": "effort_n", "A": "effort_a"}
COUNTS = 65536
"""Default counts of a revolution."""


def _velocity(one: RegisterKeys) -> str | float | None:
    if one.unit == "rpm":
        return one.scale / 60.0
    return "counts" if one.unit == "counts/s" and one.scale == 1.0 else None


def _limits(keys: ProfileKeys) -> dict[str, str]:
    limits = {}
    for kind, names in (("effort", keys.limits.effort), ("velocity", keys.limits.velocity)):
        for way, name in zip(("forward", "backward"), (names * 2)[:2], strict=False):
            limits[f"{kind}_limit_{way}"] = name
    return limits


def _with_defaults(
    registers: dict[str, Register], roles: Mapping[str, str], keys: ProfileKeys
) -> dict[str, Register]:
    """Return registers with what such a drive would hold as delivered."""
    fresh = dict(registers)

    def hold(name: str, value: int) -> None:
        fresh[name] = fresh[name]._replace(default=value)

    for role, name in roles.items():
        if "_limit_" in role:
            hold(name, fresh[name].high)
    if "counts" in roles:
        hold(roles["counts"], round(keys.counts_per_revolution or COUNTS))
    if "rated_torque" in roles:
        scale = keys.registers[roles["rated_torque"]].scale
        hold(roles["rated_torque"], round(RATED_TORQUE / scale))
    if keys.eeprom_off is not None:
        hold(keys.eeprom_off.register_name, int(keys.eeprom_off.value == 0))
    for setting in (keys.identity, *keys.expected):
        if setting is not None and setting.value is not None:
            hold(setting.register_name, setting.value)
    return fresh


def _sequences(keys: ProfileKeys) -> Sequences:
    """Return which writes switch it on, and which of a fault reset's is the one that counts."""
    on, off, reset = (_writes(one) for one in (keys.enable, keys.disable, keys.fault_reset))
    resets = [one for one in reset if one not in off]
    return Sequences(dict(on), tuple(resets[:1] or reset[:1]))


def _writes(steps: tuple[StepKeys, ...]) -> list[tuple[str, int]]:
    return [(step.write, step.value) for step in steps if step.write is not None]
