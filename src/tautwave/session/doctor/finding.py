"""One thing that was looked at."""

from __future__ import annotations

from typing import Literal, NamedTuple

GOOD: Literal["good"] = "good"
COSTS: Literal["costs"] = "costs"
BARS: Literal["bars"] = "bars"
UNKNOWN: Literal["unknown"] = "unknown"


class Finding(NamedTuple):
    """What was found; if it costs something, what, and the command that mends it.

    `state` is good, costs (a run is possible, but worse), bars (no run is possible) or unknown.
    """

    what: str
    state: Literal["good", "costs", "bars", "unknown"]
    found: str
    cost: str = ""
    command: str = ""
