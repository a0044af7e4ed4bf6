"""The families of drives that can be simulated: tables that come along, and profiles."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path

from tautwave.config.messages import read_model
from tautwave.errors import ConfigError
from tautwave_sim.modbus.profile_device import load_profile
from tautwave_sim.modbus.profile_keys import TableKeys
from tautwave_sim.modbus.table import Table, make_register

FAMILIES = ("generic", "dsy-rs", "cia402")


@cache
def load_table(family: str) -> Table:
    """Return the table of a family.

    Raises
    ------
    ConfigError
        There is none.
    """
    if Path(family).suffix in (".yaml", ".yml"):
        return load_profile(Path(family))
    if family not in FAMILIES:
        raise ConfigError(
            f"modbus: no simulated drives of profile {family!r}; there are {', '.join(FAMILIES)}, "
            "and the path of a profile's .yaml file"
        )
    text = files("tautwave_sim.modbus").joinpath(f"tables/{family}.yaml").read_text("utf-8")
    keys: TableKeys
    _, keys = read_model(text, f"{family}.yaml", "table", TableKeys)
    return Table(
        family=keys.family,
        functions=keys.functions,
        registers={
            name: make_register(
                name, one.model_dump(exclude_none=True), keys.word_order == "low_first"
            )
            for name, one in keys.registers.items()
        },
        roles=keys.roles,
        modes=keys.modes,
        states=keys.states,
        faults=keys.faults,
        scale=keys.scale,
        counts_per_revolution=keys.counts_per_revolution,
        limit_bit=keys.limit_bit,
    )
