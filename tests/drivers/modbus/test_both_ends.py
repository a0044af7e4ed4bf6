"""One profile, read by two: driver and simulator refuse the same, in the same sentences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from tautwave.errors import ConfigError
from tautwave_drivers.modbus.profile import SHIPPED, Profile, load_profile
from tautwave_sim.modbus.families import load_table
from tautwave_sim.modbus.profile_keys import ProfileKeys

FOLDER = Path(__file__).parents[3] / "drivers" / "tautwave_drivers" / "modbus" / "profiles"
GENERIC = (FOLDER / "generic.yaml").read_text("utf-8")


def sentences(read: Any, path: Path) -> list[str]:
    with pytest.raises(ConfigError) as found:
        read(str(path))
    return [one.replace(f"{path}:", "mine.yaml:") for one in found.value.problems]


def refused(tmp_path: Path, text: str) -> list[str]:
    """Return what both say."""
    path = tmp_path / "mine.yaml"
    path.write_text(text, encoding="utf-8")
    said = sentences(load_profile, path)
    assert sentences(load_table, path) == said
    return said


def line(start: str) -> int:
    return next(n for n, one in enumerate(GENERIC.splitlines(), 1) if one.startswith(start))


@pytest.mark.parametrize(
    ("old", "new", "at", "said"),
    [
        ("{address: 34,", "{address: 99999999,", "  torque_limit:",
         "registers.torque_limit.address: Input should be less than or equal to 65535 "
         "(got 99999999)"),
        ("{address: 34,", "{address: -4,", "  torque_limit:",
         "registers.torque_limit.address: Input should be greater than or equal to 0 (got -4)"),
        ("{address: 35, type: u32", "{address: 65535, type: u32", "  velocity_limit:",
         "registers.velocity_limit: a value of 32 bits takes two words; 0xffff is the last "
         "address"),
        ("{address: 34,", "{adress: 34,", "  torque_limit:",
         "registers.torque_limit.adress: unknown key 'adress'; did you mean 'address'? Allowed: "
         "address, type, word_order, table, scale, unit, access, lasting"),
        ("{address: 34,", "{address: [34],", "  torque_limit:",
         "registers.torque_limit.address: Input should be a valid integer (got a list)"),
        ("{address: 34,", "{address: 34.5,", "  torque_limit:",
         "registers.torque_limit.address: Input should be a valid integer (got 34.5)"),
        ("  rated_torque:    {", "  torque_limit:    {", "  rated_torque:    {",
         f"registers.torque_limit: duplicate key 'torque_limit', first at line "
         f"{line('  torque_limit:')}"),
        ("  effort: torque ", "  efort: torque ", "  effort: torque",
         "roles.efort: unknown key 'efort'; did you mean 'effort'? Allowed: position, velocity, "
         "effort, command_effort, command_velocity, command_position, mode, mode_display, "
         "status, fault, control, rated_torque, counts"),
        ("  effort: torque ", "  effort: trque ", "  effort: torque",
         "roles.effort: there is no register 'trque'; did you mean 'torque'?"),
        ("{address: 34,", "{<<: *base, address: 34,", "  torque_limit:",
         "registers.torque_limit.<<: aliases (*base) are not supported; write it out"),
        ("unit: s, lasting: true", "unit: s, lasting: on", "  comm_timeout:",
         "registers.comm_timeout.lasting: Input should be a valid boolean (got 'on'); write true "
         "or false"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_alike(
    tmp_path: Path, old: str, new: str, at: str, said: str
) -> None:
    assert GENERIC.count(old) == 1
    found = refused(tmp_path, GENERIC.replace(old, new))
    said = said.replace(".<<:", '."<<":')
    assert f"mine.yaml:{line(at)}: {said}" in found


def test_numbers_are_those_of_yaml_1_2(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    path.write_text(
        GENERIC.replace("{address: 34, scale: 0.001", "{address: 0034, scale: 1e-3").replace(
            "  6: overloaded", "  0x10: overloaded"
        )
    )
    assert load_profile(str(path)).registers["torque_limit"].address == 34
    assert load_profile(str(path)).registers["torque_limit"].scale == 1e-3
    assert 16 in load_profile(str(path)).faults
    assert load_table(str(path)).registers["torque_limit"].address == 34
    assert load_table(str(path)).faults == {"overcurrent": 16}


BOMB = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"a{n + 1}: &a{n + 1} [{', '.join([f'*a{n}'] * 9)}]\n" for n in range(12)
)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB + GENERIC, "mine.yaml:1: a0: anchors (&a0) are not supported; write it out"),
        ("family: " + "[" * 50_000, "mine.yaml:1:33: nested deeper than 24 levels"),
        ("family: " + "{a: " * 50_000, "mine.yaml:1:105: nested deeper than 24 levels"),
        (GENERIC + "#" * 300_000, "mine.yaml: larger than 256 KiB, so not a profile"),
        (
            "- 3",
            "mine.yaml:1: a profile must be a mapping such as 'name: bench', but this is a list",
        ),
        ("", "mine.yaml: the file is empty"),
    ],
    ids=["aliases", "lists", "mappings", "large", "list", "empty"],
)
def test_what_is_no_profile_is_a_sentence_at_once(tmp_path: Path, text: str, said: str) -> None:
    assert said in refused(tmp_path, text)


def test_both_know_the_same_keys() -> None:
    assert keys_of(ProfileKeys) == keys_of(Profile)


def keys_of(model: type[BaseModel]) -> Any:
    return {
        field.alias or name: sorted(map(repr, map(keys_of, models_in(field.annotation))))
        for name, field in model.model_fields.items()
    }


def models_in(kind: Any) -> list[type[BaseModel]]:
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        return [kind]
    return [one for part in getattr(kind, "__args__", ()) for one in models_in(part)]


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_profiles_can_be_simulated_from_their_files_too(name: str) -> None:
    table = load_table(str(FOLDER / f"{name}.yaml"))
    assert set(table.registers) == set(load_profile(name).registers)
