"""Keys of law position. Units: [rad | m] reads "rad for a rotary axis, m for a linear one"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from pydantic import Field

from tautwave.config.keys.common import Name, NonNegative, Positive
from tautwave.config.keys.coupling import Coupling, Pair


class PositionPair(Pair):
    """A master axis and the slave axis of the same name, joined by a spring and a damper."""

    stiffness: Positive = Field(
        description="[N m/rad | N/m] Stiffness of the spring, in master units."
    )
    damping: NonNegative = Field(
        description="[N m s/rad | N s/m] Damping of the damper, in master units."
    )


class PositionCoupling(Coupling):
    """A spring and a damper between delayed positions."""

    law: Literal["position"] = Field(description="Spring and damper between the two.")
    pairs: Mapping[Name, PositionPair] = Field(
        description="The pairs by name: one per axis of each side."
    )
