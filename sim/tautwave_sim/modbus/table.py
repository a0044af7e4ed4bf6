"""What is known of a family of drives: its registers and what each is for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from tautwave_sim.modbus.registers import Register, bounds


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
    counts_per_revolution: float
    limit_bit: int = 0
    eeprom_off: int = 0
    gaps_read_zero: tuple[str, ...] = ()
    """Tables of which words between registers can be read."""
    objects: bool = False
    most: Mapping[str, int] = {}
    sequences: Sequences | None = None
    """Of a drive that a third party's profile describes."""


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
        keys.get("table") or "",
    )
