"""Keys of a wave line. Units: [rad | m] reads "rad for a rotary axis, m for a linear one"."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from tautwave.config.keys.common import AUTO, Name, NonNegative, Positive, tuned
from tautwave.config.keys.coupling import Coupling, Pair
from tautwave.errors import ConfigError
from tautwave.laws.wave_filter import filter_gain

PLAIN: Literal["plain"] = "plain"
POLES: tuple[float | str, ...] = (0.5, 0.3, 0.2, 0.1, 0.0, PLAIN)
"""Poles that are tried where none is given, the least noisy first."""

LOWEST_CORNER_HZ = 1e-3
"""Below it a filter lets nothing pass that a hand does."""


def _check_pole(value: Any) -> Any:
    if value in (AUTO, PLAIN) or (_is_number(value) and 0.0 <= value <= 0.9):
        return value if isinstance(value, str) else float(value)
    text = "Input should be 'auto', 'plain' or a number from 0 to 0.9"
    raise PydanticCustomError("pole", text)


def _check_positive(value: Any) -> Any:
    if value is None or value == AUTO:
        return value
    if _is_number(value) and 0.0 < value < math.inf:
        return float(value)
    raise PydanticCustomError("auto", "Input should be 'auto' or a number greater than 0")


def _check_corner(value: Any) -> Any:
    if _is_number(value) and 0.0 < value < LOWEST_CORNER_HZ:
        raise PydanticCustomError("auto", f"Input should be at least {LOWEST_CORNER_HZ:g}")
    return _check_positive(value)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


Auto = Literal["auto"]
Pole = Annotated[Auto | Literal["plain"] | float, BeforeValidator(_check_pole)]
Impedance = Annotated[Auto | Positive, BeforeValidator(_check_positive)]
Corner = Annotated[Auto | Positive | None, BeforeValidator(_check_corner)]


def _chosen(key: str, value: str | float) -> float:
    if isinstance(value, str):
        raise ConfigError(f"{key} is still auto, because nothing chose it; give a value")
    return value


class WavePair(Pair):
    """A master axis and the slave axis of the same name, on a wave line."""

    wave_impedance: Impedance = Field(
        default=AUTO,
        json_schema_extra=tuned("between runs"),
        description="[N m s/rad | N s/m] Characteristic impedance of the line, in the master's "
        "units. Small: light and soft; large: heavy and crisp. auto: the largest that "
        "is certified and has little chatter, weight and reserve; `check` shows the "
        "limiting factor.",
    )
    matched_master: bool = Field(default=False, description="Matching damper at the master's end.")
    matched_slave: bool = Field(default=False, description="Matching damper at the slave's end.")
    wave_filter_hz: Corner = Field(
        default=AUTO,
        json_schema_extra=tuned("engaged"),
        description="[Hz] Corner of the low-pass inside both ports, at the rate of each axis; "
        "null: none. auto: 50 Hz, or a fifteenth of the slower axis' rate; none if neither has "
        "noise or an encoder step and the ports are certified without one.",
    )
    pole_master: Pole = Field(
        default=AUTO,
        description="Pole of the master's observer: share of an error left after one period. "
        "Large: little noise; small: stiff contacts; plain: no observer. auto: the "
        "first of 0.5, 0.3, 0.2, 0.1, 0 and plain that is certified for the stated "
        "contact.",
    )
    pole_slave: Pole = Field(default=AUTO, description="Pole of the slave's observer.")

    force_gain: NonNegative = Field(
        default=0.0,
        description="Force augmentation: share of the external effort on the slave beyond its "
        "motor's effort that is added to its outgoing wave, as far as its tank covers "
        "it. Effort-controlled axes only.",
    )
    observer_hz: Positive = Field(
        default=30.0,
        description="[Hz] Bandwidth of the observer of that effort, if `force_gain` is not 0; "
        "identified friction (`value`) is subtracted from its estimate.",
    )

    @property
    def impedance(self) -> float:
        """Impedance of the line [N m s/rad or N s/m, master]."""
        return _chosen("wave_impedance", self.wave_impedance)

    def pole(self, side: str) -> float | None:
        """Return the pole of one side's observer, None for none."""
        key = f"pole_{side}"
        stated = getattr(self, key)
        return None if stated == PLAIN else _chosen(key, stated)

    def filter_step(self, period_s: float) -> float:
        """Return the step of the wave filter [1] at an axis' period [s]; 1 without one."""
        if self.wave_filter_hz is None:
            return 1.0
        return filter_gain(_chosen("wave_filter_hz", self.wave_filter_hz), period_s)

    def is_matched(self, side: str) -> bool:
        """Return whether a damper at one side keeps waves from being reflected."""
        return self.matched_master if side == "master" else self.matched_slave

    def problems(self, rate_hz: float) -> Sequence[tuple[str, str]]:
        """Return a corner that the rate [Hz] cannot hold."""
        corner = self.wave_filter_hz
        if not isinstance(corner, float) or corner <= rate_hz / 2.0:
            return ()
        text = f"should not be above half the rate, {rate_hz / 2.0:g} Hz (got {corner:g})"
        return (("wave_filter_hz", text),)

    def wave_gain(self, side: str) -> float:
        """Return device wave per line wave [1]: the sign and the root of the power ratio."""
        if side == "master":
            return 1.0
        return float(self.sign) * math.sqrt(self.effective_force_scale * self.position_scale)


class WaveCoupling(Coupling):
    """A wave line between master and slave."""

    law: Literal["wave"] = Field(
        default="wave",
        description="A wave line, passive at any constant delay; its ports state energy claims.",
    )
    pairs: Mapping[Name, WavePair] = Field(
        description="The pairs by name: one per axis of each side."
    )
