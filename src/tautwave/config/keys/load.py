"""`load` of an axis: what weighs on it where no chain says so."""

from __future__ import annotations

from pydantic import Field

from tautwave.config.keys.common import Block

REFLECTED = (
    "For a slave: the master's motors render its weight to the hand, at the master's own "
    "position; needs pairs with a number as `offset`. false: the hand does not feel it."
)


class TrueLoad(Block):
    """Effort that a load exerts on the axis: constant + cosine cos(x) + sine sin(x)."""

    constant: float = Field(default=0.0, description="[N m | N] Independent of position.")
    cosine: float = Field(
        default=0.0, description="[N m] Times the cosine of the position; rotary axes."
    )
    sine: float = Field(
        default=0.0, description="[N m] Times the sine of the position; rotary axes."
    )


class Load(TrueLoad):
    """The same, as assumed."""

    compensate: bool = Field(
        default=True,
        description="Compensate for the load outside the coupling; false: the coupling carries it.",
    )
    reflect_load: bool = Field(default=False, description=REFLECTED)
