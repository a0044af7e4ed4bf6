"""What a family of drives has in which register, as data: YAML files, ours and other people's.

A profile says where position, effort and commands are, how the drive is enabled and disabled, what
it watches, and what wears it out. `profiles/generic.yaml` is written to be copied and explains
every key; a file of one's own is named by its path in `devices: [{profile: ...}]`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from tautwave.errors import ConfigError
from tautwave_drivers.modbus.protocol.registers import KINDS, Block, blocks_of, bounds

SHIPPED = ("generic", "dsy-rs", "cia402")

SEQUENCES = ("after_command", "prepare", "enable", "disable", "fault_reset")
BRIDGE = 16
"""Words read in vain to save another request, which costs some 20 characters and two silences."""
LAST = 0xFFFF
Word = Annotated[int, Field(ge=0, le=LAST)]
Value = Annotated[int, Field(ge=-(2**31), le=2**32 - 1)]
Positive = Annotated[float, Field(gt=0.0)]
Role = Literal[
    "position", "velocity", "effort", "command_effort", "command_velocity", "command_position",
    "mode", "mode_display", "status", "fault", "control", "rated_torque", "counts",
]  # fmt: skip
Unit = Literal["", "counts", "counts/s", "rpm", "rated", "N m", "N", "s", "V", "A", "degC"]
Functions = tuple[Literal[1, 2, 3, 4, 5, 6, 15, 16, 23], ...]
Table = Literal["holding", "input", "coil", "discrete"]
Gaps = Literal["refused", "readable"]
BITS = ("coil", "discrete")
READERS = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
"""Function code that reads a table (MODBUS Application Protocol V1.1b3, 4.3)."""


KeyPath = tuple[str | int, ...]


def _number(key: Any) -> Any:
    """Return a key that is a number, as YAML reads it: keys come as text."""
    from tautwave.config.text.yaml12 import read_scalar

    number = read_scalar(key) if isinstance(key, str) else key
    return number if isinstance(number, int) and not isinstance(number, bool) else key


class Keys(BaseModel):
    """Strict and frozen, like a rig file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Register(Keys):
    """One value; `value * scale` is in `unit`, where `rated` is a share of the rated torque."""

    address: Word
    type: Literal["u16", "i16", "u32", "i32"] = "u16"
    word_order: Literal["high_first", "low_first"] | None = None
    """Of a 32-bit value; the profile's own if not given."""
    table: Table | None = None
    """Which of the tables it is in: holding registers if not given, where function code 3 reads;
    a coil or discrete input is one bit."""
    scale: Positive = 1.0
    unit: Unit = ""
    access: Literal["r", "w", "rw"] = "rw"
    lasting: bool = False
    """A write to it goes to the EEPROM, unless `eeprom_off` says how to keep it out."""

    @model_validator(mode="after")
    def _ends(self) -> Register:
        if self.address + self.words > LAST + 1:
            raise ValueError(f"a value of 32 bits takes two words; {LAST:#x} is the last address")
        return self

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
            raise ValueError("needs either write or wait, the name of a register")
        return self

    @property
    def register_name(self) -> str:
        """The register that is written or waited for."""
        return self.write if self.write is not None else self.wait or ""


class Pattern(Keys):
    """What the status register shows: `status & mask == value`."""

    mask: Value = 0xFFFFFFFF
    value: Value

    @model_validator(mode="after")
    def _can_show(self) -> Pattern:
        if self.value & self.mask != self.value:
            raise ValueError(
                f"no status can show this: value {self.value:#x} has bits outside mask "
                f"{self.mask:#x}"
            )
        return self

    def fits(self, status: int) -> bool:
        """Return whether a status shows this."""
        return status & self.mask == self.value


class States(Keys):
    """How the status register shows the drive's state."""

    enabled: Pattern
    fault: Pattern
    limit: Pattern | None = None


class Setting(Keys):
    """A register that has to hold a value; `why` is reported where it does not."""

    register_name: Annotated[str, Field(alias="register")]
    value: Value
    mask: Value = 0xFFFFFFFF
    why: str = ""


class CommLoss(Keys):
    """The register that makes the drive stop when no requests come."""

    register_name: Annotated[str, Field(alias="register")]
    reaction: str
    """What the drive does then, as text."""
    off: Value = 0
    """The value that switches it off."""


class Identity(Keys):
    """Which register identifies a drive of this family, and its value."""

    register_name: Annotated[str, Field(alias="register")]
    value: Value | None = None
    """If not given it is reported, not compared."""


class Limits(Keys):
    """Registers that get the rig's limits, forward and backward where there are two."""

    effort: tuple[str, ...] = ()
    velocity: tuple[str, ...] = ()


class Profile(Keys):
    """One family of drives."""

    family: Annotated[str, Field(min_length=1)]
    source: Annotated[str, Field(min_length=1)]
    """Where the table is from."""
    functions: Annotated[Functions, Field(min_length=1)]
    """Function codes that the drive accepts."""
    word_order: Literal["high_first", "low_first"] = "high_first"
    gaps: Gaps | dict[Table, Gaps] = "refused"
    """Whether addresses between its registers can be read; may differ by table."""
    most_registers: Annotated[int, Field(ge=2, le=125)] | dict[Table, int] = 125
    """Most registers that one request reads; may differ by table."""
    addressing: Literal["words", "objects"] = "words"
    """objects: an address is that of an object, whose 32 bits need no second address; each is read
    on its own."""
    outstanding: Annotated[int, Field(ge=1, le=64)] = 1
    """Requests that may be outstanding on a TCP connection, over all units behind it."""
    machine: Literal["steps", "cia402"] = "steps"
    """What enables it: the sequences below, or the state machine of CiA 402."""
    object_address: str | None = None
    """For the reader: how the family makes addresses."""
    registers: Annotated[dict[str, Register], Field(min_length=1)]
    roles: dict[Role, str]
    modes: dict[Literal["effort", "velocity"], int]
    """What the mode register holds for torque and velocity command."""
    counts_per_revolution: Positive | None = None
    """Of the motor, as delivered; `counts_per_revolution` of a device goes first."""
    states: States | None = None
    after_command: tuple[Step, ...] = ()
    """Written after each command: what makes the drive take it."""
    prepare: tuple[Step, ...] = ()
    """Before anything else, torque off: make it forget an earlier master."""
    enable: tuple[Step, ...] = ()
    disable: tuple[Step, ...] = ()
    fault_reset: tuple[Step, ...] = ()
    faults: dict[Annotated[int, BeforeValidator(_number)], str] = Field(default_factory=dict)
    """Codes of the fault register as text."""
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
    reported: dict[str, str] = Field(default_factory=dict)
    """Registers that are read and reported before enabling, with a label for each."""
    caveats: tuple[str, ...] = ()
    """What a user of the drive has to know; in the notes of each run."""

    def mistakes(self) -> Iterator[tuple[KeyPath, str]]:
        """Yield what single keys cannot show: where, and what is wrong, as a sentence."""
        yield from self._unknown_names()
        yield from self._too_large()
        for role in ("position", "status"):
            if role not in self.roles:
                yield ("roles",), f"{role} is missing; every profile needs it"
        yield from self._without_mode()
        yield from self._out_of_reach()
        if self.machine == "cia402":
            lacking = {"control", "mode", "mode_display"} - set(self.roles)
            if lacking:
                missing = ", ".join(sorted(lacking))
                yield ("roles",), f"{missing} missing; machine: cia402 needs them"
        elif not self.enable or not self.disable or self.states is None:
            yield (), "enable, disable and states are required, unless machine is cia402"
        if not {1, 2, 3, 4} & set(self.functions) or not {5, 6, 15, 16} & set(self.functions):
            yield ("functions",), "one that reads (3 or 4) and one that writes (6, 16) are required"

    def _out_of_reach(self) -> Iterator[tuple[KeyPath, str]]:
        """Registers in a table that no function code of the drive reads, or writes."""
        for name, one in self.registers.items():
            table = self.table_of(one)
            code = READERS[table]
            if "r" in one.access and code not in self.functions:
                text = f"function code {code} reads a register of {table}; it is not in functions"
                yield ("registers", name, "table"), text
            if table in BITS and one.type != "u16":
                yield ("registers", name, "type"), f"a {table} is one bit; leave the type out"
        for where, name in self._written():
            register = self.registers.get(name)
            if register is None:
                continue
            table = self.table_of(register)
            if table in ("input", "discrete"):
                yield where, f"{name} is in the table {table}, which cannot be written"
            elif table == "coil" and not {5, 15} & set(self.functions):
                yield where, f"{name} is a coil: function code 5 or 15 writes it, not in functions"
            elif register.words == 2 and 16 not in self.functions:
                yield where, f"{name} has 32 bits: only function code 16 writes them"
        for step in self.after_command:
            if step.write is None:
                yield ("after_command",), "has writes only: nothing is waited for in a cycle"

    def _written(self) -> Iterator[tuple[KeyPath, str]]:
        for role in ("command_effort", "command_velocity", "control"):
            if role in self.roles:
                yield ("roles", role), self.roles[role]
        for key in SEQUENCES:
            for number, step in enumerate(getattr(self, key)):
                if step.write is not None:
                    yield (key, number, "write"), step.write
        for key in ("settings", "settings_effort", "settings_velocity"):
            for number, one in enumerate(getattr(self, key)):
                yield (key, number, "register"), one.register_name
        for part, at in ((self.eeprom_off, "eeprom_off"), (self.comm_loss, "comm_loss")):
            if part is not None:
                yield (at, "register"), part.register_name
        for kind in ("effort", "velocity"):
            for number, name in enumerate(getattr(self.limits, kind)):
                yield ("limits", kind, number), name

    def _without_mode(self) -> Iterator[tuple[KeyPath, str]]:
        for kind in ("effort", "velocity"):
            register = self.registers.get(self.roles.get(f"command_{kind}", ""))  # type: ignore[call-overload]
            if register is None:
                continue
            if kind not in self.modes and "mode" in self.roles:
                yield ("modes",), f"{kind} is missing, but roles has command_{kind}"
            if register.lasting and self.eeprom_off is None:
                yield (
                    ("roles", f"command_{kind}"),
                    "is lasting and there is no eeprom_off: each cycle would wear the drive's "
                    "EEPROM",
                )

    def _too_large(self) -> Iterator[tuple[KeyPath, str]]:
        """Values that their register cannot hold: the line would carry the nearest that it can."""
        given: list[tuple[KeyPath, str, int | None]] = [
            (("modes", kind), self.roles.get("mode", ""), value)
            for kind, value in self.modes.items()
        ]
        for key in SEQUENCES:
            for number, step in enumerate(getattr(self, key)):
                if step.write is not None:
                    given.append(((key, number, "value"), step.write, step.value))
        for key in ("settings", "settings_effort", "settings_velocity", "expected"):
            for number, one in enumerate(getattr(self, key)):
                given.append(((key, number, "value"), one.register_name, one.value))
        if self.eeprom_off is not None:
            one = self.eeprom_off
            given.append((("eeprom_off", "value"), one.register_name, one.value))
        if self.identity is not None:
            given.append((("identity", "value"), self.identity.register_name, self.identity.value))
        if self.comm_loss is not None:
            given.append((("comm_loss", "off"), self.comm_loss.register_name, self.comm_loss.off))
        for where, name, value in given:
            register = self.registers.get(name)
            if register is None or value is None:
                continue
            low, high = (0, 1) if self.table_of(register) in BITS else bounds(register.type)
            if not low <= value <= high:
                yield where, f"{name} holds {low} to {high} as {register.type} (got {value})"

    def _unknown_names(self) -> Iterator[tuple[KeyPath, str]]:
        from tautwave.config.text.document import nearest

        named: list[tuple[KeyPath, str]] = [
            (("roles", role), name) for role, name in self.roles.items()
        ]
        for key in SEQUENCES:
            for number, step in enumerate(getattr(self, key)):
                named.append(((key, number, "write" if step.write else "wait"), step.register_name))
        for key in ("settings", "settings_effort", "settings_velocity", "expected"):
            for number, setting in enumerate(getattr(self, key)):
                named.append(((key, number, "register"), setting.register_name))
        for key in ("eeprom_off", "comm_loss", "identity"):
            part = getattr(self, key)
            if part is not None:
                named.append(((key, "register"), part.register_name))
        for kind in ("effort", "velocity"):
            names = getattr(self.limits, kind)
            named += [(("limits", kind, number), name) for number, name in enumerate(names)]
        named += [(("reported", name), name) for name in self.reported]
        for where, name in named:
            if name not in self.registers:
                yield where, f"there is no register {name!r}{nearest(name, [*self.registers])}"

    def timeout_s(self, seconds: float) -> float:
        """Return a comm-loss timeout [s] as its register holds it, rounded up; inf without one."""
        if self.comm_loss is None:
            return math.inf
        step = self.registers[self.comm_loss.register_name].scale
        return math.ceil(seconds / step - 1e-9) * step

    def register_of(self, role: Role) -> Register | None:
        """Return the register of a role, None where the drive has none."""
        name = self.roles.get(role)
        return None if name is None else self.registers[name]

    def table_of(self, register: Register) -> Table:
        """Return the table that a register is in."""
        return register.table or ("holding" if 3 in self.functions else "input")

    def blocks(self, names: Sequence[str]) -> list[Block]:
        """Return what is read to have all of these registers, the block with the position first."""
        reads: list[Block] = []
        for table in READERS:
            here = [one for one in names if self.table_of(self.registers[one]) == table]
            wanted = [(one, self.registers[one].address, self.registers[one].words) for one in here]
            if self.addressing == "objects" or table in BITS:
                reads += [Block(at, words, (one,), table) for one, at, words in wanted]
                continue
            gaps, most = self.gaps, self.most_registers
            gap = gaps if isinstance(gaps, str) else gaps.get(table, "refused")  # type: ignore[call-overload]
            limit = most if isinstance(most, int) else most.get(table, 125)  # type: ignore[call-overload]
            blocks = blocks_of(wanted, self._readable(table), gap == "readable", BRIDGE, limit)
            reads += [one._replace(table=table) for one in blocks]
        reads.sort(key=lambda block: self.roles["position"] not in block.names)
        return reads

    def low_first(self, register: Register) -> bool:
        """Return whether the low word of a 32-bit value comes first."""
        return (register.word_order or self.word_order) == "low_first"

    def _readable(self, table: str) -> frozenset[int]:
        """Addresses of a table that are known to be readable."""
        return frozenset(
            address
            for one in self.registers.values()
            if "r" in one.access and self.table_of(one) == table
            for address in range(one.address, one.address + one.words)
        )


def parse_profile(text: str, where: str) -> Profile:
    """Return a profile from YAML, read as rig files are.

    Raises
    ------
    ConfigError
        It is not valid: file, line, key and what is wrong, one sentence for each mistake.
    """
    from tautwave.config.messages import read_model  # most importers read no profile

    document, profile = read_model(text, where, "profile", Profile)
    for path, sentence in profile.mistakes():
        document.report(path, sentence)
    if document.problems:
        raise ConfigError(document.sentences())
    parsed: Profile = profile
    return parsed


@cache
def load_profile(name: str) -> Profile:
    """Return a shipped profile by name, or any other by the path of its file.

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
            f"modbus: there is no profile {name!r}; use one of {', '.join(SHIPPED)}, or the path "
            "of a .yaml file"
        )
    from tautwave.config.text.document import read_text

    return parse_profile(read_text(path, "profile"), name)
