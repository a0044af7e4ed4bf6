"""`load` of an axis: what weighs on it where no chain says so."""

from __future__ import annotations

from pydantic import Field

from tautwave.config.keys.common import Block

REFLECTED = (
    "A slave's: the master's motors weigh as much on the hand, at the master's own position; "
    "needs pairs with a number as `offset`. false: the hand feels nothing of it."
)


class TrueLoad(Block):
    """Effort that a load exerts on the axis: constant + cosine cos(x) + sine sin(x)."""

    constant: float = Field(default=0.0, description="[N m | N] The same everywhere.")
    cosine: float = Field(
        default=0.0, description="[N m] Times the cosine of the position; rotary axes."
    )
    sine: float = Field(
        default=0.0, description="[N m] Times the sine of the position; rotary axes."
    )


class Load(TrueLoad):
    """The same as it is believed."""

    compensate: bool = Field(
        default=True,
        description="Carry the load by an effort beside the coupling's; false: the coupling "
        "carries it.",
    )
    reflect_load: bool = Field(default=False, description=REFLECTED)
