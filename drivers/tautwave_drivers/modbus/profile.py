"""What a family of drives has in which register, as data: YAML files, ours and other people's.

A profile says where position, effort and commands are, how the drive is enabled and disabled, what
it watches, and what wears it out. `profiles/generic.yaml` is written to be copied; every key is
explained here, and a file of one's own is named by its path in `devices: [{profile: ...}]`.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from tautwave.errors import ConfigError
from tautwave_drivers.modbus.registers import KINDS

SHIPPED = ("generic", "dsy-rs", "cia402")

Word = Annotated[int, Field(ge=0, le=0xFFFF)]
Value = Annotated[int, Field(ge=-(2**31), le=2**32 - 1)]
Positive = Annotated[float, Field(gt=0.0)]
Role = Literal[
    "position", "velocity", "effort", "command_effort", "command_velocity", "command_position",
    "mode", "mode_display", "status", "fault", "control", "rated_torque", "counts",
]  # fmt: skip
Unit = Literal["", "counts", "counts/s", "rpm", "rated", "N m", "s", "V", "A", "degC"]
Functions = tuple[Literal[3, 4, 6, 16, 23], ...]


class Keys(BaseModel):
    """Strict and frozen, like a rig file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Register(Keys):
    """One value; `value * scale` is in `unit`, where `rated` is a share of the rated torque."""

    address: Word
    type: Literal["u16", "i16", "u32", "i32"] = "u16"
    word_order: Literal["high_first", "low_first"] | None = None
    """Of a 32-bit value; the profile's own if not given."""
    scale: Positive = 1.0
    unit: Unit = ""
    access: Literal["r", "w", "rw"] = "rw"
    lasting: bool = False
    """A write to it goes to the EEPROM, unless `eeprom_off` says how to keep it out."""

    @property
    def words(self) -> int:
        """Words that it takes."""
        return KINDS[self.type][0]


class Step(Keys):
    """One step of a sequence: `write: NAME, value: V`, or `wait: NAME, mask: M, value: V`."""

    write: str | None = None
    wait: str | None = None
    value: Value
    mask: Value = 0xFFFFFFFF
    timeout_s: Positive = 1.0

    @model_validator(mode="after")
    def _one(self) -> Step:
        if (self.write is None) == (self.wait is None):
            raise ValueError("should have either write or wait, the name of a register")
        return self

    @property
    def register_name(self) -> str:
        """The register that is written or waited for."""
        return self.write if self.write is not None else self.wait or ""


class Pattern(Keys):
    """What the status register shows: `status & mask == value`."""

    mask: Value = 0xFFFFFFFF
    value: Value

    def fits(self, status: int) -> bool:
        """Return whether a status shows this."""
        return status & self.mask == self.value


class States(Keys):
    """How the status register tells what the drive does."""

    enabled: Pattern
    fault: Pattern
    limit: Pattern | None = None


class Setting(Keys):
    """A register that has to hold a value; `why` is told where it does not."""

    register_name: Annotated[str, Field(alias="register")]
    value: Value
    mask: Value = 0xFFFFFFFF
    why: str = ""


class CommLoss(Keys):
    """The register that has the drive stop when nobody speaks to it."""

    register_name: Annotated[str, Field(alias="register")]
    reaction: str
    """What the drive does then, in words."""
    off: Value = 0
    """What switches it off."""


class Identity(Keys):
    """Which register tells that a drive is of this family, and with which value."""

    register_name: Annotated[str, Field(alias="register")]
    value: Value | None = None
    """Nothing is compared if not given; it is told."""


class Limits(Keys):
    """Registers that get the rig's limits, forward and backward where there are two."""

    effort: tuple[str, ...] = ()
    velocity: tuple[str, ...] = ()


class Profile(Keys):
    """One family of drives."""

    family: Annotated[str, Field(min_length=1)]
    source: Annotated[str, Field(min_length=1)]
    """Where the table is from, for whoever doubts it."""
    functions: Annotated[Functions, Field(min_length=1)]
    """Function codes that the drive accepts."""
    word_order: Literal["high_first", "low_first"] = "high_first"
    gaps: Literal["refused", "readable"] = "refused"
    """Whether addresses between its registers can be read."""
    machine: Literal["steps", "cia402"] = "steps"
    """Who enables it: the sequences below, or the state machine of CiA 402."""
    object_address: str | None = None
    """For the reader: how the family makes addresses."""
    registers: Annotated[dict[str, Register], Field(min_length=1)]
    roles: dict[Role, str]
    modes: dict[Literal["effort", "velocity"], int]
    """What the mode register holds for torque and velocity command."""
    counts_per_revolution: Positive | None = None
    """Of the motor, as delivered; `counts_per_revolution` of a device goes first."""
    states: States | None = None
    prepare: tuple[Step, ...] = ()
    """Before anything else, torque off: make it forget an earlier master."""
    enable: tuple[Step, ...] = ()
    disable: tuple[Step, ...] = ()
    fault_reset: tuple[Step, ...] = ()
    faults: dict[int, str] = Field(default_factory=dict)
    """Codes of the fault register in words."""
    eeprom_off: Setting | None = None
    """What keeps writes out of the EEPROM; written first, and read back."""
    settings: tuple[Setting, ...] = ()
    """Written and read back before enabling; lasting ones only with --configure."""
    settings_effort: tuple[Setting, ...] = ()
    """The same, of a drive that takes torque."""
    settings_velocity: tuple[Setting, ...] = ()
    """The same, of a drive that takes velocity."""
    expected: tuple[Setting, ...] = ()
    """Only compared: what the table above takes for granted."""
    comm_loss: CommLoss | None = None
    identity: Identity | None = None
    limits: Limits = Limits()
    told: dict[str, str] = Field(default_factory=dict)
    """Registers that are read before enabling and told, with a word for each."""
    caveats: tuple[str, ...] = ()
    """What somebody who uses the drive has to know; told in the notes of each run."""

    @model_validator(mode="after")
    def _whole(self) -> Profile:
        problems = list(self._unknown_names())
        problems += [
            f"roles: {role} is missing; every drive has to tell it"
            for role in ("position", "status")
            if role not in self.roles
        ]
        problems += self._without_mode()
        if self.machine == "cia402":
            lacking = {"control", "mode", "mode_display"} - set(self.roles)
            if lacking:
                problems.append(f"roles: {', '.join(sorted(lacking))} missing for machine: cia402")
        elif not self.enable or not self.disable or self.states is None:
            problems.append("enable, disable and states are required, unless machine is cia402")
        if not {3, 4} & set(self.functions) or not {6, 16} & set(self.functions):
            problems.append(
                "functions: it takes one that reads (3 or 4) and one that writes (6, 16)"
            )
        if problems:
            raise ValueError("; ".join(problems))
        return self

    def _without_mode(self) -> list[str]:
        problems = []
        for kind in ("effort", "velocity"):
            register = self.register_of(
                "command_effort" if kind == "effort" else "command_velocity"
            )
            if register is None:
                continue
            if kind not in self.modes and "mode" in self.roles:
                problems.append(f"modes: {kind} is missing, but roles has command_{kind}")
            if register.lasting and self.eeprom_off is None:
                problems.append(
                    f"roles: command_{kind} is a lasting register, and there is no eeprom_off: "
                    "each cycle would wear the drive's EEPROM"
                )
        return problems

    def _unknown_names(self) -> list[str]:
        named = [(f"roles.{role}", name) for role, name in self.roles.items()]
        for key in ("prepare", "enable", "disable", "fault_reset"):
            named += [(key, step.register_name) for step in getattr(self, key)]
        for key in ("settings", "settings_effort", "settings_velocity", "expected"):
            named += [(key, setting.register_name) for setting in getattr(self, key)]
        for key in ("eeprom_off", "comm_loss", "identity"):
            part = getattr(self, key)
            if part is not None:
                named.append((key, part.register_name))
        named += [("limits", one) for one in (*self.limits.effort, *self.limits.velocity)]
        named += [("told", one) for one in self.told]
        return [
            f"{where}: there is no register {name!r}"
            for where, name in named
            if name not in self.registers
        ]

    def register_of(self, role: Role) -> Register | None:
        """Return the register of a role, None where the drive has none."""
        name = self.roles.get(role)
        return None if name is None else self.registers[name]

    def low_first(self, register: Register) -> bool:
        """Return whether the low word of a 32-bit value comes first."""
        return (register.word_order or self.word_order) == "low_first"

    @property
    def readable(self) -> frozenset[int]:
        """Addresses that are known to be readable."""
        return frozenset(
            address
            for one in self.registers.values()
            if "r" in one.access
            for address in range(one.address, one.address + one.words)
        )


def parse_profile(text: str, where: str) -> Profile:
    """Return a profile from YAML.

    Raises
    ------
    ConfigError
        It is none: file, key and what is wrong, one sentence for each mistake.
    """
    try:
        keys: Any = yaml.safe_load(text)
    except yaml.YAMLError as err:
        raise ConfigError(f"{where}: is no YAML: {err}") from err
    if not isinstance(keys, dict):
        raise ConfigError(f"{where}: should hold keys such as family and registers")
    try:
        return Profile.model_validate(_hashable(keys))
    except ValidationError as err:
        raise ConfigError([_sentence(where, problem) for problem in err.errors()]) from err


@cache
def load_profile(name: str) -> Profile:
    """Return a shipped profile by name, or somebody's by the path of its file.

    Raises
    ------
    ConfigError
        There is no such profile, or its file is wrong.
    """
    if name in SHIPPED:
        text = files("tautwave_drivers.modbus").joinpath(f"profiles/{name}.yaml").read_text("utf-8")
        return parse_profile(text, f"{name}.yaml")
    path = Path(name)
    if path.suffix not in (".yaml", ".yml"):
        raise ConfigError(
            f"modbus: there is no profile {name!r}; shipped are {', '.join(SHIPPED)}, and the path "
            "of a .yaml file is another"
        )
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as err:
        raise ConfigError(f"modbus: profile {name}: cannot be read: {err}") from err
    return parse_profile(text, name)


def _hashable(value: Any) -> Any:
    """Return YAML's lists as tuples, as strict models want them."""
    if isinstance(value, dict):
        return {key: _hashable(one) for key, one in value.items()}
    if isinstance(value, list):
        return tuple(_hashable(one) for one in value)
    return value


def _sentence(where: str, problem: Any) -> str:
    key = ".".join(str(part) for part in problem["loc"])
    got = problem.get("input")
    shown = f" (got {got!r})" if isinstance(got, str | int | float) else ""
    message = problem["msg"].removeprefix("Value error, ")
    return f"{where}: {key + ': ' if key else ''}{message}{shown}"
