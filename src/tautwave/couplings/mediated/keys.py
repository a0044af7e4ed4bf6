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
        description="[N m/rad | N/m] Stiffness of the spring by which the slave follows, in "
        "master units. auto: the slave on it resonates at 16 Hz, or at a hundredth of "
        "the rate if that is lower.",
    )
    damping: Gain = Field(
        default="auto",
        description="[N m s/rad | N s/m] Damping of that spring, in master "
        "units. auto: 0.7 of critical.",
    )
    force_gain: NonNegative = Field(
        default=1.0,
        description="Share of the effort rendered at the master that the slave applies in "
        "addition to following; 1: both apply the same effort.",
    )
    effort: Literal["observed", "measured"] = Field(
        default="observed",
        description="External effort on the slave: observed from position and command, or "
        "measured by its `effort_sensor`.",
    )
    observer_hz: Positive = Field(
        default=80.0,
        description="[Hz] Bandwidth of the observer of that effort, and of the filter on all "
        "signals of the estimate; identified friction (`value`) is subtracted.",
    )
    touch: Gain = Field(
        default="auto",
        description="[N m | N, slave] External effort at which a contact begins; it ends at half "
        "of it. auto: 2 % of the slave's effort limit and its Coulomb friction.",
    )
    memory_s: Positive = Field(
        default=0.5,
        description="[s] Time after which a sample's weight in the estimate has fallen to 1/e.",
    )
    sure: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.2,
        description="Maximum half-width of the stiffness' 95 % interval, relative to the "
        "stiffness, for an estimate to be used.",
    )
    stiffest: Gain = Field(
        default="auto",
        description="[N m/rad | N/m] Maximum stiffness that the master renders. auto: m / (7 T)^2 "
        "of the master. The leak that `check` states grows with it.",
    )
    adopt_s: Positive = Field(
        default=0.05,
        description="[s] Time constant with which a surface in contact adapts to the estimate.",
    )


class MediatedCoupling(Coupling):
    """The slave follows; the master renders what it touches."""

    law: Literal["mediated"] = Field(description="Model-mediated.")
    pairs: Mapping[Name, MediatedPair] = Field(
        description="The pairs by name: one per axis of each side."
    )
