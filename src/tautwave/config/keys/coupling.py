"""`coupling` and `loop`: the law between master and slave, and how it is run."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal, get_args

from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    Field,
    SerializeAsAny,
    ValidationInfo,
    WrapValidator,
)
from pydantic_core import PydanticCustomError

from tautwave import registry
from tautwave.config.keys.chosen import PART_HASH, PartHash
from tautwave.config.keys.common import AUTO, Block, Name, NonNegative, Positive, tuned
from tautwave.errors import ConfigError
from tautwave.registry import unknown_word


class Wall(Block):
    """A local virtual wall: a unilateral spring and damper, on this side's own measurement."""

    position: float = Field(
        description="[rad | m] Where the wall begins.", json_schema_extra=tuned("disengaged")
    )
    stiffness: Positive = Field(
        json_schema_extra=tuned("engaged"),
        description="[N m/rad | N/m] Passive while the device damping b > stiffness T / 2 + "
        "damping.",
    )
    damping: NonNegative = Field(
        default=0.0,
        json_schema_extra=tuned("engaged"),
        description="[N m s/rad | N s/m] Damps the wall at the cost of passivity margin.",
    )
    side: Literal["above", "below"] = Field(
        default="above", description="above: the wall fills everything above `position`."
    )
    passivity_control: bool = Field(
        default=False,
        description="Dissipate at once any energy created by sampling (passivity controller).",
    )
    effort_limit: Positive | None = Field(
        default=None,
        description="[N m | N] Most that the wall may use of the motor. Default: all that a load "
        "leaves; under law position or pd_damping without an account half of it, for their spring "
        "has to be sure of the other half.",
    )
    derate: bool = Field(
        default=False,
        description="Render the stiffest wall that the certificate allows where `stiffness` is "
        "more; impedance axes only.",
    )


def _check_offset(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == "at_engage" or (number and math.isfinite(value)):
        return value
    raise PydanticCustomError("offset", "Input should be 'at_engage' or a finite number")


def _check_gain(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == AUTO or (number and 0.0 <= value < float("inf")):
        return value if isinstance(value, str) else float(value)
    raise PydanticCustomError("auto", "Input should be 'auto' or a number of at least 0")


Gain = Annotated[Literal["auto"] | float, BeforeValidator(_check_gain)]
"""A key of a pair that may be left to its law."""


class Pair(Block):
    """A master axis and the slave axis of the same name; a law adds keys of its own."""

    position_scale: Positive = Field(
        default=1.0,
        ge=1e-9,
        le=1e9,
        json_schema_extra=tuned("between runs"),
        description="Slave motion per master motion; required, with a unit (m/rad), if the kinds "
        "differ.",
    )
    force_scale: Positive | None = Field(
        default=None,
        json_schema_extra=tuned("between runs"),
        description="Slave effort per master effort; default 1/position_scale, which keeps power.",
    )
    sign: Literal[1, -1] = Field(
        default=1, description="-1: the slave moves in the opposite direction."
    )
    offset: Annotated[Literal["at_engage"] | float, BeforeValidator(_check_offset)] = Field(
        default="at_engage",
        description="[rad | m, master] Master position that maps to slave position 0; at_engage: "
        "taken when the coupling engages.",
    )
    engage_tolerance: Positive | None = Field(
        default=None,
        description="[rad | m, master] Greatest mismatch at which the coupling engages; "
        "required when `offset` is a number.",
    )
    wall_master: Wall | None = Field(default=None, description="Local wall at the master.")
    wall_slave: Wall | None = Field(default=None, description="Local wall at the slave.")

    @property
    def effective_force_scale(self) -> float:
        """Slave effort per master effort: the given value, else 1/position_scale."""
        return 1.0 / self.position_scale if self.force_scale is None else self.force_scale

    def problems(self, rate_hz: float) -> Sequence[tuple[str, str]]:
        """Return keys that do not fit the rate [Hz], each with a message."""
        return ()

    def in_device_units(self, side: str, value: float) -> float:
        """Return an impedance, stiffness or damping of the pair in the units of one device."""
        if side == "master":
            return value
        return value * self.effective_force_scale / self.position_scale


def chosen(pair: Pair, key: str) -> float:
    """Return a key of a pair that may have been left to the law.

    Raises
    ------
    ConfigError
        It still is.
    """
    value = getattr(pair, key)
    if isinstance(value, str):
        raise ConfigError(f"{key} is still auto, because nothing chose it; give a value")
    return float(value)


class Account(Block):
    """An energy account around the law: what it gives at one end was taken at the other."""

    leader: Literal["master", "slave"] = Field(
        default="master",
        description="Side that fills the other side's tank by damping its own motion.",
    )
    reserve: Positive | None = Field(
        default=None,
        description="[J] Held at the start by each end, which may give up to twice as much; "
        "default: (effort_limit T (1 + command delay in periods))^2 / inertia.lower.",
    )
    tank: Positive | None = Field(
        default=None,
        description="[J] What a full tank holds, at least four reserves: absorbed energy that may "
        "be returned later, at this end or the other, in addition to the claim; "
        "default: a fifth of the device's kinetic energy at its velocity limit.",
    )
    kept: Annotated[float, Field(ge=0, le=1)] = Field(
        default=1.0,
        description="Share of a full tank that the follower keeps (at least one reserve) while "
        "the leader's is empty; half full, the leader's takes nothing. Less than 1 "
        "damps laws that return at the leader what a spring gave at the follower; 1 "
        "suits laws that give at the follower, such as position_force.",
    )
    level_damping: NonNegative | None = Field(
        default=None,
        description="[N m s/rad | N s/m] Damping of the leader while the "
        "other's tank is empty; default: "
        "inertia.lower / (50 T).",
    )
    level_friction: NonNegative | None = Field(
        default=None,
        description="[N m | N] Friction of the leader while the other's tank is empty, plus a "
        "drag of 2 inertia.lower / 10 ms, for laws that do not resist the leader, "
        "such as position_force; default there: 2 coulomb.value, at least 0.01 "
        "effort_limit, else 0: neither.",
    )


STANDARD_LAW = "wave"
"""What a rig has that names no law, and what `auto` takes."""


class Coupling(Block):
    """How master and slave are coupled; the law adds keys to these."""

    law: str = Field(
        default=STANDARD_LAW,
        description="wave: passive at any constant delay; position: spring and damper between the "
        "two, for comparison; auto: chosen by the delay, gains included, as `check` says; or the "
        "name of another installed part (`tautwave drivers`).",
    )
    part_sha256: PartHash | None = PART_HASH
    delay_s: Annotated[float, Field(ge=0, le=60)] = Field(
        default=0.0, description="[s] One-way delay of the line; a whole number of samples."
    )
    account: Account | None = Field(
        default=None,
        description="Makes any law without its own account passive by an energy account; `{}` "
        "uses the defaults.",
    )
    engage_ramp_s: NonNegative = Field(default=0.2, description="[s] Fade-in time of the coupling.")
    release_ramp_s: NonNegative = Field(
        default=0.2, description="[s] Fade-out time of the coupling."
    )
    pairs: Mapping[Name, Pair] = Field(description="The pairs by name: one per axis of each side.")
    defaults: dict[str, Any] = Field(
        default_factory=dict,
        exclude=True,
        description="Default keys for every pair; a pair's own keys take precedence.",
    )

    @classmethod
    def model_for(cls, value: Any) -> type[Coupling]:
        """Return the block of the law that `value`, a mapping of the file or a block, names."""
        if isinstance(value, Coupling):
            return type(value)
        law = value.get("law", STANDARD_LAW) if isinstance(value, dict) else STANDARD_LAW
        return coupling_block(law) if isinstance(law, str) else _UnknownLaw

    def problems(self, rate_hz: float) -> Sequence[tuple[str, str]]:
        """Return keys that do not fit the rate [Hz], each with a message."""
        return ()


RENAMED = {"observed_wave": "wave"}
"""Laws that have another name now."""


def _refuse_law(name: str) -> str:
    text = unknown_word("law", name, [AUTO, *registry.coupling_names()])
    if name in RENAMED:
        text = f"law {name} is law {RENAMED[name]} now; write law: {RENAMED[name]}"
    if name in registry.coupling_names() or registry.is_file_part(name):
        try:
            registry.load_named(registry.load_coupling(name).keys)
        except ConfigError as err:
            text = str(err)  # why it does not load
    raise PydanticCustomError("part", "{text}", {"text": text})


class AnyPair(Pair):
    """The keys that pairs of all laws have."""

    model_config = ConfigDict(extra="ignore")


class AnyLaw(Coupling):
    """The keys that couplings of all laws have."""

    model_config = ConfigDict(extra="ignore")
    pairs: Mapping[Name, AnyPair]


class _UnknownLaw(AnyLaw):
    """A coupling with an unknown law."""

    law: Annotated[str, AfterValidator(_refuse_law)] = STANDARD_LAW


def coupling_block(law: str) -> type[Coupling]:
    """Return the keys of a law, those of its pairs included."""
    return _block_of(law) if registry.is_file_part(law) else _installed_block(law)


@lru_cache(maxsize=64)
def _installed_block(law: str) -> type[Coupling]:
    return _block_of(law)


def _block_of(law: str) -> type[Coupling]:
    try:
        keys: type[Coupling] = registry.load_named(registry.load_coupling(law).keys)
    except ConfigError:
        return _UnknownLaw
    for block in (keys, pair_block(keys)):
        block.part_word = f"law {law}"
    return keys


def pair_block(coupling: type[Coupling]) -> type[Pair]:
    """Return the keys of one pair of a coupling."""
    block: type[Pair] = get_args(coupling.model_fields["pairs"].annotation)[1]
    return block


def law_blocks() -> dict[str, type[Coupling]]:
    """Return the keys of every installed law that loads, by name."""
    blocks = {name: coupling_block(name) for name in registry.coupling_names()}
    return {law: block for law, block in blocks.items() if block is not _UnknownLaw}


def laws_with(key: str, block: type[Block]) -> list[str]:
    """Return the laws, other than that of `block`, that have a key at its place."""
    if not issubclass(block, Coupling | Pair):
        return []
    at_pair = issubclass(block, Pair)
    return [
        law
        for law, other in law_blocks().items()
        if key in (pair_block(other) if at_pair else other).model_fields
    ]


def _choose_law(value: Any, handler: Any, info: ValidationInfo) -> Any:
    if isinstance(value, Coupling):
        return value
    if not isinstance(value, dict):
        return handler(value)
    block = Coupling.model_for(value)
    value = _without_blanks(value, block)
    if isinstance(value.get("pairs"), dict):
        inner = pair_block(block)
        pairs = value["pairs"].items()
        value = {**value, "pairs": {name: _without_blanks(pair, inner) for name, pair in pairs}}
    if info.mode == "json":  # JSON mode accepts lists for tuples
        return block.model_validate_json(json.dumps(value), strict=True)
    return block.model_validate(value, strict=True)


def _without_blanks(value: Any, block: type[Block]) -> Any:
    """Drop null keys of other laws: resolved rigs of version 1 list them all."""
    if not isinstance(value, dict):
        return value
    blank = [
        key
        for key, given in value.items()
        if (given is None or given is False) and key not in block.model_fields
    ]
    spared = {key for key in blank if laws_with(key, block)}
    return {key: given for key, given in value.items() if key not in spared} if spared else value


AnyCoupling = Annotated[SerializeAsAny[Coupling], WrapValidator(_choose_law)]


class Loop(Block):
    """How the loop is run and when it gives up."""

    engine: Literal["python", "compiled"] = Field(
        default="python",
        description="How the controller of a coupling runs, with identical results: plain Python, "
        "or machine code (numba), compiled before anything is enabled.",
    )

    missing_limit: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=5,
        description="Consecutive periods without a sample of an axis that trigger a safety stop; "
        "skipped slots between missing samples count too. A wave port's claim covers "
        "what the motor may do meanwhile.",
    )
    overrun_limit: Annotated[int, Field(ge=1, le=1_000_000)] | None = Field(
        default=None,
        description="Consecutive skipped slots that trigger a safety stop; null: as many as fit "
        "in 20 ms, at least 2. A wave port's claim covers what the motor may do "
        "meanwhile.",
    )
    fifo_priority: Annotated[int, Field(ge=0, le=99)] = Field(
        default=50, description="Real-time priority to request; 0: none."
    )
    cpu: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="CPU core to pin the loop to; none: any."
    )
    lock_memory: bool = Field(default=True, description="Lock memory to prevent page faults.")
    ring_rows: Annotated[int, Field(ge=64, le=1 << 20)] = Field(
        default=8192, description="Rows buffered between the loop and the writer process."
    )
