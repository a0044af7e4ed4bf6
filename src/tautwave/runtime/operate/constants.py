"""What a rig's `operate` block comes to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from tautwave.controller.records import AxisParams, PairParams
from tautwave.laws.rest.brake import BrakeParams
from tautwave.runtime.operate.rest.pull import PullParams


class Operation(NamedTuple):
    """What a rig's `operate` block comes to.

    `pulls` by pair, of those with an offset of their own; `quanta` [rad or m] are the encoder steps
    of the axes, and `brakes` what brakes them at rest. `scales` are the constants of axes and pairs
    at each factor on the pairs' scale; their places are the same.
    """

    pulls: Mapping[int, PullParams]
    quanta: Sequence[float]
    brakes: Sequence[BrakeParams | None] = ()
    scales: Mapping[float, tuple[Sequence[AxisParams], Sequence[PairParams]]] = {}

    def called(self, text: str) -> float | None:
        """Return the scale of that name, None if there is none."""
        try:
            wanted = f"{float(text):g}"
        except ValueError:
            return None
        return next((scale for scale in self.scales if f"{scale:g}" == wanted), None)

    def no_scale(self, text: str) -> str:
        """Say which scales there are."""
        if len(self.scales) < 2:
            return "scale: this rig has no other scales; list them in operate.scales"
        known = ", ".join(f"{scale:g}" for scale in self.scales)
        return f"scale: one of {known} (got {text[:20]!r})"
