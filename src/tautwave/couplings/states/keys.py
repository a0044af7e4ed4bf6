"""Keys of the laws of states, and what they are where a rig leaves them to the law.

[rad | m] reads "rad for a rotary axis, m for a linear one".
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from tautwave.config import Rig
from tautwave.config.keys.common import AUTO, Name, NonNegative, Positive
from tautwave.config.keys.coupling import Coupling, Gain, Pair, chosen
from tautwave.types import Choice


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


FASTEST = 100.0
"""[rad/s] 16 Hz: beyond what a hand moves by will."""

PER_RATE = 2.0 * math.pi / 100.0
PER_DELAY = 1.0
BY_DELAY = "1 over the round-trip delay"
DAMPED = 0.7
MORE = 1.1


def resolve(rig: Rig) -> dict[str, Choice]:
    """Return what each `auto` of a rig is, by its path in the coupling."""
    choices: dict[str, Choice] = {}
    for name, pair in rig.coupling.pairs.items():
        assert isinstance(pair, ServoPair)
        chosen = _gains(rig, name, pair)
        for key, choice in chosen.items():
            if getattr(pair, key, None) == AUTO:
                choices[f"pairs.{name}.{key}"] = choice
    return choices


def _gains(rig: Rig, name: str, pair: ServoPair) -> dict[str, Choice]:
    scale = pair.in_device_units("slave", 1.0)
    masses = [rig.master.axes[name].inertia, rig.slave.axes[name].inertia]
    assert masses[0] is not None
    assert masses[1] is not None
    mass = min(masses[0].value, masses[1].value / scale)
    both = 2.0 * (rig.coupling.delay_s + 0.5 * rig.period_s)
    bounds = {
        "16 Hz": FASTEST,
        "a hundredth of the rate": PER_RATE * rig.rate_hz,
        BY_DELAY: PER_DELAY / both,
    }
    if isinstance(pair, PositionForcePair):
        del bounds[BY_DELAY]  # its spring closes no loop over the line
    which = min(bounds, key=lambda it: bounds[it])
    stiffness = pair.stiffness
    if stiffness == AUTO:
        stiffness = float(f"{mass * bounds[which] ** 2:.4g}")
    damping = float(f"{2.0 * DAMPED * math.sqrt(stiffness * mass):.4g}")
    needed = float(f"{MORE * 0.5 * both * stiffness:.4g}")
    return {
        "stiffness": Choice(stiffness, f"resonates at {which} with {mass:.3g}"),
        "damping": Choice(damping, "0.7 of critical"),
        "injection": Choice(needed, "round-trip delay times half the stiffness, plus 10 %"),
    }
