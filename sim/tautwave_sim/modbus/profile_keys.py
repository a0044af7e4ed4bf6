"""Keys of a drive's profile, for its simulation: a model of its own, as for everything on a wire.

`drivers/tautwave_drivers/modbus/profiles/generic.yaml` explains them. What a simulated drive has no
use for is here too, so that a misspelt key is refused by either reader.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from tautwave.config.text.yaml12 import KeyPath, read_scalar
from tautwave_sim.modbus.registers import TYPES

LAST = 0xFFFF

Positive = Annotated[float, Field(gt=0.0)]
Value = Annotated[int, Field(ge=-(2**31), le=2**32 - 1)]
Order = Literal["high_first", "low_first"]
Role = Literal[
    "position", "velocity", "effort", "command_effort", "command_velocity", "command_position",
    "mode", "mode_display", "status", "fault", "control", "rated_torque", "counts",
]  # fmt: skip
Unit = Literal["", "counts", "counts/s", "rpm", "rated", "N m", "N", "s", "V", "A", "degC"]
InTable = Literal["holding", "input", "coil", "discrete"]
Gaps = Literal["refused", "readable"]
Name = Annotated[str, Field(alias="register")]


def number_of(key: Any) -> Any:
    """Return a key that is a number as YAML knows it; keys come as they are written."""
    number = read_scalar(key) if isinstance(key, str) else key
    return number if isinstance(number, int) and not isinstance(number, bool) else key


Code = Annotated[int, BeforeValidator(number_of)]


class Keys(BaseModel):
    """Strict and frozen, like a rig file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class RegisterKeys(Keys):
    """One value."""

    address: Annotated[int, Field(ge=0, le=LAST)]
    type: Literal["u16", "i16", "u32", "i32"] = "u16"
    word_order: Order | None = None
    table: InTable | None = None
    scale: Positive = 1.0
    unit: Unit = ""
    access: Literal["r", "w", "rw"] = "rw"
    lasting: bool = False

    @model_validator(mode="after")
    def _ends(self) -> RegisterKeys:
        if self.address + TYPES[self.type][0] > LAST + 1:
            raise ValueError(f"a value of 32 bits takes two words; {LAST:#x} is the last address")
        return self


class StepKeys(Keys):
    """A step of a sequence."""

    write: str | None = None
    wait: str | None = None
    value: Value
    mask: Value = 0xFFFFFFFF
    timeout_s: Positive = 1.0

    @model_validator(mode="after")
    def _one(self) -> StepKeys:
        if (self.write is None) == (self.wait is None):
            raise ValueError("should have either write or wait, the name of a register")
        return self

    @property
    def named(self) -> tuple[str, str]:
        """How a register is named, and which."""
        return ("write", self.write) if self.write is not None else ("wait", self.wait or "")


class PatternKeys(Keys):
    """What the status register shows."""

    mask: Value = 0xFFFFFFFF
    value: Value


class StatesKeys(Keys):
    """How the status register shows the drive's state."""

    enabled: PatternKeys
    fault: PatternKeys
    limit: PatternKeys | None = None


class SettingKeys(Keys):
    """A register that has to hold a value."""

    register_name: Name
    value: Value
    mask: Value = 0xFFFFFFFF
    why: str = ""


class CommLossKeys(Keys):
    """The register that makes the drive stop when no requests come."""

    register_name: Name
    reaction: str
    off: Value = 0


class IdentityKeys(Keys):
    """Which register identifies a drive of this family."""

    register_name: Name
    value: Value | None = None


class LimitsKeys(Keys):
    """Registers that get the rig's limits."""

    effort: tuple[str, ...] = ()
    velocity: tuple[str, ...] = ()


class ProfileKeys(Keys):
    """One family of drives."""

    family: Annotated[str, Field(min_length=1)]
    source: Annotated[str, Field(min_length=1)]
    functions: Annotated[tuple[Literal[1, 2, 3, 4, 5, 6, 15, 16, 23], ...], Field(min_length=1)]
    word_order: Order = "high_first"
    gaps: Gaps | dict[InTable, Gaps] = "refused"
    most_registers: Annotated[int, Field(ge=2, le=125)] | dict[InTable, int] = 125
    addressing: Literal["words", "objects"] = "words"
    outstanding: Annotated[int, Field(ge=1, le=64)] = 1
    machine: Literal["steps", "cia402"] = "steps"
    object_address: str | None = None
    registers: Annotated[dict[str, RegisterKeys], Field(min_length=1)]
    roles: dict[Role, str]
    modes: dict[Literal["effort", "velocity"], int]
    counts_per_revolution: Positive | None = None
    states: StatesKeys | None = None
    after_command: tuple[StepKeys, ...] = ()
    prepare: tuple[StepKeys, ...] = ()
    enable: tuple[StepKeys, ...] = ()
    disable: tuple[StepKeys, ...] = ()
    fault_reset: tuple[StepKeys, ...] = ()
    faults: dict[Code, str] = Field(default_factory=dict)
    eeprom_off: SettingKeys | None = None
    settings: tuple[SettingKeys, ...] = ()
    settings_effort: tuple[SettingKeys, ...] = ()
    settings_velocity: tuple[SettingKeys, ...] = ()
    expected: tuple[SettingKeys, ...] = ()
    comm_loss: CommLossKeys | None = None
    identity: IdentityKeys | None = None
    limits: LimitsKeys = LimitsKeys()
    reported: dict[str, str] = Field(default_factory=dict)
    caveats: tuple[str, ...] = ()

    def named(self) -> Iterator[tuple[KeyPath, str]]:
        """Yield every place where a register is named, with the name."""
        for role, name in self.roles.items():
            yield ("roles", role), name
        for key in ("after_command", "prepare", "enable", "disable", "fault_reset"):
            for number, step in enumerate(getattr(self, key)):
                verb, name = step.named
                yield (key, number, verb), name
        for key in ("settings", "settings_effort", "settings_velocity", "expected"):
            for number, setting in enumerate(getattr(self, key)):
                yield (key, number, "register"), setting.register_name
        for key in ("eeprom_off", "comm_loss", "identity"):
            part = getattr(self, key)
            if part is not None:
                yield (key, "register"), part.register_name
        for kind in ("effort", "velocity"):
            for number, name in enumerate(getattr(self.limits, kind)):
                yield ("limits", kind, number), name
        for name in self.reported:
            yield ("reported", name), name


class TableRegisterKeys(Keys):
    """One value of a shipped table, with what a real drive would refuse."""

    address: Annotated[int, Field(ge=0, le=LAST)]
    type: Literal["u16", "i16", "u32", "i32"]
    access: Literal["r", "w", "rw"] = "rw"
    low: Value | None = None
    high: Value | None = None
    default: Value = 0
    eeprom: bool = False


class TableKeys(Keys):
    """A shipped table: `table.Table` says what each is."""

    family: str
    functions: tuple[int, ...]
    word_order: Order
    registers: dict[str, TableRegisterKeys]
    roles: dict[str, str]
    modes: dict[Code, str]
    states: dict[str, int] = Field(default_factory=dict)
    faults: dict[str, int] = Field(default_factory=dict)
    scale: dict[str, float | str]
    counts_per_revolution: float
    limit_bit: int = 0
