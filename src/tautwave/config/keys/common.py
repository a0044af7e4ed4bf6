"""What all blocks share: strictness, bounded numbers, names.

Units: [rad | m] reads "rad for a rotary axis, m for a linear one".
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from tautwave.models.noise_colour import TOLERANCE, least_spectrum

LEAST, GREATEST = 1e-100, 1e15
"""Sizes of numbers in a rig file: no unit of SI needs more."""

MAX_WHOLE = 2**63 - 1
"""Of identities and seeds."""


class Block(BaseModel):
    """A mapping in the rig file: no unknown keys, no conversions, no infinities, no changes."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True
    )

    part_group: ClassVar[str] = ""
    """Entry point group of the parts whose keys derive from this base."""

    part_word: ClassVar[str] = ""
    """Name in messages of the part that adds keys to a block, such as `law wave`."""

    @field_validator("*", mode="after")
    @classmethod
    def _check_size(cls, value: Any, info: ValidationInfo) -> Any:
        """Refuse numbers of which squares and quotients are no numbers any more."""
        if cls.model_fields[str(info.field_name)].annotation == dict[str, Any]:
            return value  # another model checks it, and knows the place of a key
        for number in outsized(value):
            text = "Input should be 0, or between {least} and {greatest} in size (got {number})"
            known = {"least": LEAST, "greatest": GREATEST, "number": number}
            raise PydanticCustomError("size", text, {k: f"{v:g}" for k, v in known.items()})
        return value


def outsized(value: Any) -> Iterator[float]:
    """Give the numbers in a value, or anywhere below it, that no key can mean."""
    if isinstance(value, float):
        if value and not LEAST <= math.fabs(value) <= GREATEST:
            yield value
    elif isinstance(value, int):
        if abs(value) > MAX_WHOLE:
            yield float(value)
    elif isinstance(value, tuple | list):
        for one in value:
            yield from outsized(one)
    elif isinstance(value, dict):
        yield from outsized(list(value.values()))


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Probability = Annotated[float, Field(ge=0, le=1)]

Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$")]
"""Name of a bus, an axis or a pair: it becomes part of column names, so no dots and no spaces."""

AxisName = Annotated[str, Field(pattern=r"^(master|slave)\.[A-Za-z_][A-Za-z0-9_-]*$")]
"""Full name of an axis, such as `master.wrist`."""

ArmName = Annotated[str, Field(pattern=r"^(master|slave)(\.[A-Za-z_][A-Za-z0-9_-]*)?$")]
"""Full name of an arm: its side alone, or with its name among several, such as `master.left`."""

When = Literal["engaged", "disengaged", "between runs"]


def tuned(when: When) -> dict[str, Any]:
    """Declare when a key may be changed by tuning; one that declares nothing never is."""
    return {"tuning": when}


AUTO: Literal["auto"] = "auto"
"""In place of a value: the part that the key belongs to chooses it."""


def _check_colour(lags: tuple[float, ...]) -> tuple[float, ...]:
    least, theta = least_spectrum(lags)
    if least < -TOLERANCE:
        raise PydanticCustomError(
            "colour",
            "no noise has this autocorrelation: its spectrum would be {least} of its mean at "
            "{share} of the rate; lags beyond the last count as 0, so taper them, lag k times "
            "1 - k/{count}",
            {
                "least": f"{least:.2g}",
                "share": f"{theta / (2.0 * math.pi):.2g}",
                "count": str(len(lags) + 1),
            },
        )
    return lags


Autocorrelation = Annotated[
    tuple[Annotated[float, Field(ge=-1, le=1)], ...],
    AfterValidator(_check_colour),
]
"""Of a noise, from lag 1 on, as shares of its variance; beyond the last 0, [] is white."""
