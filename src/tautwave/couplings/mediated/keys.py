"""Keys of law mediated. [rad | m] reads "rad for a rotary axis, m for a linear one"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from tautwave.config.keys.common import Name, NonNegative, Positive
from tautwave.config.keys.coupling import Coupling, Gain, Pair


class MediatedPair(Pair):
    """A slave axis that follows a master axis, which renders what the slave touches."""

    stiffness: Gain = Field(
        default="auto",
        description="[N m/rad | N/m] Of the spring by which the slave follows, in master units. "
        "auto: the slave on it swings at 16 Hz, or at a hundredth of the rate if that is slower.",
    )
    damping: Gain = Field(
        default="auto",
        description="[N m s/rad | N s/m] Of its damper, in master units. auto: 0.7 of critical.",
    )
    force_gain: NonNegative = Field(
        default=1.0,
        description="Of the effort that the master renders, what the slave presses with beside "
        "following; 1: both press alike.",
    )
    effort: Literal["observed", "measured"] = Field(
        default="observed",
        description="What acts on the slave from outside: observed from position and command, or "
        "measured by its `effort_sensor`.",
    )
    observer_hz: Positive = Field(
        default=80.0,
        description="[Hz] Bandwidth of the observer of that effort, and of the filter on all "
        "signals of the estimate; friction as identified (`value`) is taken off.",
    )
    touch: Gain = Field(
        default="auto",
        description="[N m | N, slave] Effort from outside at which a contact begins; it ends at "
        "half of it. auto: 2 % of the slave's effort limit and its Coulomb friction.",
    )
    memory_s: Positive = Field(
        default=0.5, description="[s] After which a sample counts 1/e in the estimate."
    )
    sure: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.2,
        description="Greatest half-width of the stiffness' 95 % interval, over the stiffness, with "
        "which an estimate counts.",
    )
    stiffest: Gain = Field(
        default="auto",
        description="[N m/rad | N/m] Stiffness that the master renders at most. auto: m / (7 T)^2 "
        "of the master. The leak that `check` states grows with it.",
    )
    adopt_s: Positive = Field(
        default=0.05,
        description="[s] Time constant in which a surface that is pressed becomes what is known.",
    )


class MediatedCoupling(Coupling):
    """The slave follows; the master renders what it touches."""

    law: Literal["mediated"] = Field(description="Model-mediated.")
    pairs: Mapping[Name, MediatedPair] = Field(
        description="The pairs by name: one per axis of each side."
    )
