"""Keys of a wave line. Units: [rad | m] reads "rad for a rotary axis, m for a linear one"."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import Name, Positive
from tautwave.config.keys.coupling import Coupling, Pair


def _check_pole(value: Any) -> Any:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if value == "plain" or (number and 0.0 <= value <= 0.9):
        return value if value == "plain" else float(value)
    raise PydanticCustomError("pole", "Input should be 'plain' or a number from 0 to 0.9")


Pole = Annotated[Literal["plain"] | float, BeforeValidator(_check_pole)]


class WavePair(Pair):
    """A master axis and the slave axis of the same name, on a wave line."""

    wave_impedance: Positive = Field(
        description="[N m s/rad | N s/m] Characteristic impedance of the line, in the master's "
        "units. Small: light and soft; large: heavy and crisp.",
    )
    matched_master: bool = Field(default=False, description="Matching damper at the master's end.")
    matched_slave: bool = Field(default=False, description="Matching damper at the slave's end.")
    wave_filter_hz: Positive = Field(
        description="[Hz] Corner of the low-pass inside both ports, at the rate of each axis; a "
        "tenth of the rate is a good start."
    )
    pole_master: Pole = Field(
        default=0.5,
        description="Pole of the master's observer: what is left of an error after a period. "
        "Large: little noise; small: stiff contacts; plain: no observer.",
    )
    pole_slave: Pole = Field(default=0.5, description="Pole of the slave's observer.")

    def pole(self, side: str) -> float | None:
        """Return the pole of one side's observer, None for none."""
        found = self.pole_master if side == "master" else self.pole_slave
        return found if isinstance(found, float) else None

    def wave_gain(self, side: str) -> float:
        """Return device wave per line wave [1]: the sign and the root of the power ratio."""
        if side == "master":
            return 1.0
        return float(self.sign) * math.sqrt(self.effective_force_scale * self.position_scale)


class WaveCoupling(Coupling):
    """A wave line between observed ports."""

    law: Literal["observed_wave"] = Field(
        description="A wave line whose ports hold a force under noise and claim joules."
    )
    pairs: Mapping[Name, WavePair] = Field(
        description="The pairs by name: one per axis of each side."
    )

    def problems(self, rate_hz: float) -> Sequence[tuple[str, str]]:
        """Return a corner that the rate [Hz] cannot hold."""
        return [
            (
                f"pairs.{name}.wave_filter_hz",
                f"should not be above half the rate, {rate_hz / 2.0:g} Hz "
                f"(got {pair.wave_filter_hz:g})",
            )
            for name, pair in self.pairs.items()
            if pair.wave_filter_hz > rate_hz / 2.0
        ]
