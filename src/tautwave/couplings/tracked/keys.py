"""Keys of law wave. Units: [rad | m] reads "rad for a rotary axis, m for a linear one"."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal, Self

from pydantic import Field

from tautwave.config.keys.common import Name, Positive
from tautwave.config.keys.coupling import Coupling, Pair
from tautwave.laws.wave_filter import filter_gain


class WavePair(Pair):
    """A master axis and the slave axis of the same name, on a wave line."""

    wave_impedance: Positive = Field(
        description="[N m s/rad | N s/m] Characteristic impedance of the line, in the master's "
        "units. Small: light and soft; large: heavy and crisp.",
    )
    matched_master: bool = Field(default=False, description="Matching damper at the master's end.")
    matched_slave: bool = Field(default=False, description="Matching damper at the slave's end.")

    def wave_gain(self, side: str) -> float:
        """Return device wave per line wave [1]: the sign and the root of the power ratio."""
        if side == "master":
            return 1.0
        return float(self.sign) * math.sqrt(self.effective_force_scale * self.position_scale)


class WaveCoupling(Coupling):
    """A wave line between master and slave."""

    law: Literal["wave"] = Field(
        default="wave", description="A wave line, passive at any constant delay."
    )
    wave_filter_hz: Positive | None = Field(
        default=None, description="[Hz] Corner of a low-pass on the waves; at most half the rate."
    )
    pairs: Mapping[Name, WavePair] = Field(
        description="The pairs by name: one per axis of each side."
    )

    def problems(self, rate_hz: float) -> Sequence[tuple[str, str]]:
        """Return a corner that the rate [Hz] cannot hold."""
        corner = self.wave_filter_hz
        if corner is None or corner <= rate_hz / 2.0:
            return ()
        text = f"should not be above half the rate, {rate_hz / 2.0:g} Hz (got {corner:g})"
        return (("wave_filter_hz", text),)

    def at_axis_rate(self) -> Self:
        """Return the coupling without its filter, which runs at the line's rate."""
        return self.model_copy(update={"wave_filter_hz": None})

    def filter_step(self, period_s: float) -> float:
        """Return the step of the wave filter [1] at a period [s]; 1 without one."""
        corner = self.wave_filter_hz
        return 1.0 if corner is None else filter_gain(corner, period_s)
