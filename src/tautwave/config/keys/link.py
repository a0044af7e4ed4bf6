"""`link`: the network between both sides, and how what comes over it is played out."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import AUTO, Block, NonNegative, Positive

DRAWN = (
    *("delay_s", "jitter_s", "jitter", "loss", "burst", "duplicate", "reorder"),
    *("outage_at_s", "outage_s", "outage_every_s"),
)
"""Keys that a trace takes the place of."""

Delay = Annotated[float, Field(ge=0, le=10)]


def _check_depth(value: object) -> object:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == AUTO or (number and 0.0 <= value <= 10.0):  # type: ignore[operator]
        return value if value == AUTO else float(value)  # type: ignore[arg-type]
    raise PydanticCustomError("depth", "Input should be 'auto' or a number from 0 to 10")


Depth = Annotated[Literal["auto"] | float, BeforeValidator(_check_depth)]


class Link(Block):
    """A network in place of a line of constant delay.

    Its impairments are those of `tautwave sim network`: seeded, and drawn for each packet of either
    way. Received waves are played out as `tautwave.laws.receiver` says; to a law of positions the
    newest word counts, and how deep it would be played out does not.
    """

    delay_s: Delay = Field(default=0.0, description="[s] Minimum delay each way.")
    jitter_s: Delay = Field(default=0.0, description="[s] Additional random delay.")
    jitter: Literal["uniform", "exponential", "spikes"] = Field(
        default="uniform",
        description="uniform up to jitter_s, exponential about it, or spikes of it (2 % of all).",
    )
    loss: Annotated[float, Field(ge=0, le=0.5)] = Field(
        default=0.0, description="Fraction of packets lost."
    )
    burst: Annotated[float, Field(ge=1, le=1000)] = Field(
        default=1.0, description="Mean number of consecutive packets lost."
    )
    duplicate: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="Fraction of packets duplicated."
    )
    reorder: bool = Field(default=True, description="Whether packets may be reordered.")
    outage_at_s: NonNegative = Field(
        default=0.0, description="[s] Start of the first outage, after engaging."
    )
    outage_s: NonNegative = Field(default=0.0, description="[s] Length of an outage; 0: none.")
    outage_every_s: NonNegative = Field(
        default=0.0, description="[s] Interval between outages; 0: a single outage."
    )
    trace: str | None = Field(
        default=None,
        description="Recorded network, `tautwave link test --record`: its delays and losses, both "
        "ways, are repeated in a loop instead of using the keys above. A relative "
        "path is relative to the rig file's directory.",
    )
    seed: Annotated[int, Field(ge=0, lt=1 << 32)] | None = Field(
        default=None, description="Seed of this network; default: that of the rig."
    )
    play_out: Literal["fixed", "newest"] = Field(
        default="fixed",
        description="fixed: waves are played out a constant depth behind the earliest arrival, as "
        "smooth as they were sent; newest: the latest arrival, faster by that depth "
        "but rougher.",
    )
    depth_s: Depth = Field(
        default=AUTO,
        description="[s] That depth, rounded to cycles. auto: it follows the 99th percentile of "
        "the delays, from 0.",
    )
    deepest_s: Delay = Field(default=0.1, description="[s] Maximum of an `auto` depth.")
    repeated: Annotated[int, Field(ge=0, le=32)] = Field(
        default=3, description="Number of preceding slots that each packet repeats."
    )
    silence_s: Positive = Field(
        default=0.1,
        description="[s] A side without a packet for this long holds: it emits no wave, and only "
        "its port's damping is felt.",
    )
    lost_s: Positive = Field(
        default=2.0, description="[s] A run without a packet for this long stops passively."
    )
