"""Families of drives as data: their registers and what each is for."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from tautwave.errors import ConfigError
from tautwave_sim.modbus.registers import Register, bounds

FAMILIES = ("generic", "dsy-rs", "cia402")


class Sequences(NamedTuple):
    """Which values of which registers switch a drive on, and which writes reset its fault."""

    on: Mapping[str, int]
    resets: tuple[tuple[str, int], ...] = ()


class Table(NamedTuple):
    """One family.

    `roles` names the register of each purpose (position, command_effort, ...), `modes` what each
    value of the mode register does, `states` what the status register shows, `faults` the codes of
    the fault register, `scale` what a count of a role is worth: for velocity a unit (rpm, decirpm,
    counts, for counts/s; a number is turns a second), for effort a share of rated torque (or
    `effort_nm` in N m, `effort_a` in A), for the rest SI. `eeprom_off`, in the register of that
    role, keeps writes out of the EEPROM.
    """

    family: str
    functions: tuple[int, ...]
    registers: Mapping[str, Register]
    roles: Mapping[str, str]
    modes: Mapping[int, str]
    states: Mapping[str, int]
    faults: Mapping[str, int]
    scale: Mapping[str, Any]
    counts_per_revolution: int
    limit_bit: int = 0
    eeprom_off: int = 0
    sequences: Sequences | None = None
    """Of a drive that is told by a third party's profile."""


def make_register(name: str, keys: Mapping[str, Any], low_first: bool) -> Register:
    """Return a register from its keys in a table."""
    kind = keys["type"]
    low, high = bounds(kind)
    return Register(
        name,
        keys["address"],
        kind,
        low_first,
        keys.get("access", "rw"),
        keys.get("low", low),
        keys.get("high", high),
        keys.get("default", 0),
        keys.get("eeprom", False),
    )


@cache
def load_table(family: str) -> Table:
    """Return the table of a family.

    Raises
    ------
    ConfigError
        There is none.
    """
    if Path(family).suffix in (".yaml", ".yml"):
        from tautwave_sim.modbus.foreign import load_profile

        return load_profile(Path(family))
    if family not in FAMILIES:
        raise ConfigError(
            f"modbus: no simulated drives of profile {family!r}; there are {', '.join(FAMILIES)}, "
            "and the path of a profile's .yaml file"
        )
    text = files("tautwave_sim.modbus").joinpath(f"tables/{family}.yaml").read_text("utf-8")
    keys = yaml.safe_load(text)
    low_first = keys["word_order"] == "low_first"
    return Table(
        family=keys["family"],
        functions=tuple(keys["functions"]),
        registers={
            name: make_register(name, one, low_first) for name, one in keys["registers"].items()
        },
        roles=keys["roles"],
        modes=keys["modes"],
        states=keys.get("states", {}),
        faults=keys.get("faults", {}),
        scale=keys["scale"],
        counts_per_revolution=keys["counts_per_revolution"],
        limit_bit=keys.get("limit_bit", 0),
    )
