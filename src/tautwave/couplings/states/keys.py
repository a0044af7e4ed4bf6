"""Keys of the laws of states. [rad | m] reads "rad for a rotary axis, m for a linear one"."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from tautwave.config.keys.common import AUTO, Name, NonNegative, Positive
from tautwave.config.keys.coupling import Coupling, Gain, Pair, chosen


class ServoPair(Pair):
    """A master axis and the slave axis of the same name, with a spring and a damper."""

    stiffness: Gain = Field(
        default=AUTO,
        description="[N m/rad | N/m] Stiffness of the spring, in master units. auto: the lighter "
        "device on it resonates at 16 Hz, at a hundredth of the rate, or (in rad/s; "
        "not position_force, whose spring closes no loop over the line) 1 over the "
        "round-trip delay, whichever is slowest.",
    )
    damping: Gain = Field(
        default=AUTO,
        description="[N m s/rad | N s/m] Damping of the damper, in master "
        "units. auto: 0.7 of critical.",
    )

    @property
    def injection_of(self) -> Mapping[str, float]:
        """Dampers to ground by side [N m s/rad or N s/m, master units]."""
        return {"master": 0.0, "slave": 0.0}

    def gain(self, key: str) -> float:
        """Return a key that may have been left to the law."""
        return chosen(self, key)


class ObservedPair(ServoPair):
    """A pair that has to know what acts on a device from outside."""

    observer_hz: Positive = Field(
        default=30.0,
        description="[Hz] Bandwidth of the observer of external efforts; identified friction "
        "(`value`) is subtracted from its estimate.",
    )


class PositionForcePair(ObservedPair):
    """The slave follows the master's position; the master feels the slave's effort."""

    force_gain: NonNegative = Field(
        default=1.0, description="Share of the slave's effort fed back to the master."
    )
    effort: Literal["commanded", "observed", "measured"] = Field(
        default="observed",
        description="Effort to feed back: the command to the slave's motor, or the external "
        "effort on the device, observed from position and command or measured by its "
        "`effort_sensor`.",
    )
    master_damping: NonNegative = Field(
        default=0.0, description="[N m s/rad | N s/m] Damper to ground at the master."
    )

    @property
    def injection_of(self) -> Mapping[str, float]:
        """Dampers to ground by side [N m s/rad or N s/m, master units]."""
        return {"master": self.master_damping, "slave": 0.0}


class FourChannelPair(ObservedPair):
    """Both sides follow each other's position and yield to the sum of both external efforts.

    With `rejection` it is the acceleration-based bilateral control of the motion-control school
    (Ohnishi): a disturbance observer makes each device a bare inertia, which a spring, a damper and
    both external efforts move.
    """

    force_gain: NonNegative = Field(
        default=0.5,
        description="Share of the sum of both external efforts that drives each device.",
    )
    effort: Literal["observed", "measured"] = Field(
        default="observed",
        description="The external efforts: observed from position and command, or measured by an "
        "`effort_sensor` on each side.",
    )
    rejection: Annotated[float, Field(ge=0, le=1)] = Field(
        default=1.0,
        description="Share of all non-motor efforts on a device, friction included, that its "
        "motor cancels (disturbance observer); 0: none, and both feel lighter by a "
        "factor of 1 + 2 `force_gain`.",
    )


class PdDampingPair(ServoPair):
    """A spring and a damper between the sides, and a damper to ground at each."""

    injection: Gain = Field(
        default=AUTO,
        description="[N m s/rad | N s/m] Damper to ground, each side, in master units. auto: what "
        "4 B_m B_s > (T_m + T_s)^2 K^2 requires, plus 10 %.",
    )

    @property
    def injection_of(self) -> Mapping[str, float]:
        """Dampers to ground by side [N m s/rad or N s/m, master units]."""
        return dict.fromkeys(("master", "slave"), self.gain("injection"))


class PositionForceCoupling(Coupling):
    """Positions to the slave, efforts to the master."""

    law: Literal["position_force"] = Field(description="Position to the slave, effort back.")
    pairs: Mapping[Name, PositionForcePair] = Field(
        description="The pairs by name: one per axis of each side."
    )


class FourChannelCoupling(Coupling):
    """Positions and external efforts both ways."""

    law: Literal["four_channel"] = Field(description="Positions and external efforts both ways.")
    pairs: Mapping[Name, FourChannelPair] = Field(
        description="The pairs by name: one per axis of each side."
    )


class PdDampingCoupling(Coupling):
    """PD with damping injection."""

    law: Literal["pd_damping"] = Field(description="Spring and damper, and dampers to ground.")
    pairs: Mapping[Name, PdDampingPair] = Field(
        description="The pairs by name: one per axis of each side."
    )
