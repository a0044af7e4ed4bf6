"""What all blocks share: strictness, bounded numbers, names.

Units: [rad | m] reads "rad for a rotary axis, m for a linear one".
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field


class Block(BaseModel):
    """A mapping in the rig file: no unknown keys, no conversions, no infinities, no changes."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    part_group: ClassVar[str] = ""
    """Entry point group of the parts whose keys derive from this base."""

    part_word: ClassVar[str] = ""
    """Name in messages of the part that adds keys to a block, such as `law wave`."""


Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Probability = Annotated[float, Field(ge=0, le=1)]

Name = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_-]*$")]
"""Name of a bus, an axis or a pair: it becomes part of column names, so no dots and no spaces."""

AxisName = Annotated[str, Field(pattern=r"^(master|slave)\.[A-Za-z_][A-Za-z0-9_-]*$")]
"""Full name of an axis, such as `master.wrist`."""

AUTO: Literal["auto"] = "auto"
"""In place of a value: the part that the key belongs to chooses it."""
