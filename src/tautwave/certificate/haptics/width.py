"""Z-width of one axis: the stiffest wall over its virtual damping, passive and stable.

Sources: Colgate & Brown, ICRA 1994 (the plot); Colgate & Schenkel 1997 (the passive side).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tautwave.analysis.walls.limits import greatest_stiffness
from tautwave.analysis.walls.sampled import SampledWall
from tautwave.analysis.walls.stability import held_device, stable_stiffness
from tautwave.certificate.belief import delay_in_periods
from tautwave.config import Rig, local_wall
from tautwave.models.hand import Hand
from tautwave.rig import at_axis_rate, axis_allowance
from tautwave.rig.hands import stated_hand
from tautwave.types import CommandDelay

Floats = NDArray[np.float64]

POINTS = 28


class AxisWidth(NamedTuple):
    """Greatest stiffness K over virtual damping B, SI of the axis.

    Attributes
    ----------
    axis, rotary : str, bool
    mass, damping : float
        Lower bounds for the device.
    period_s, delay : float
        Loop period [s], delay until a command acts [periods].
    hand : Hand or None
        What holds a master.
    dampings : ndarray of shape (n,)
        B, rising from 0 [N s/m or N m s/rad].
    passive : ndarray of shape (n,)
        Greatest K for any hand [N/m or N m/rad].
    stable : ndarray of shape (n,)
        K at which device and `hand` first become unstable [N/m or N m/rad].
    wall : tuple of float, optional
        K and B of the axis' own wall.
    """

    axis: str
    rotary: bool
    mass: float
    damping: float
    period_s: float
    delay: float
    hand: Hand | None
    dampings: Floats
    passive: Floats
    stable: Floats
    wall: tuple[float, float] | None

    def best(self) -> tuple[float, float]:
        """Return the stiffest passive K, and its B."""
        at = int(np.argmax(self.passive))
        return float(self.passive[at]), float(self.dampings[at])

    def firmest(self) -> tuple[float, float]:
        """Return the stiffest stable K, and its B."""
        at = int(np.argmax(self.stable))
        return float(self.stable[at]), float(self.dampings[at])

    def sentence(self) -> str:
        """Return the plot's result in sentences."""
        spring, damper = ("N m/rad", "N m s/rad") if self.rotary else ("N/m", "N s/m")
        head = f"{self.axis}: "
        periods = "one period" if self.delay == 1.0 else f"{self.delay:g} periods"
        late = f" with commands {periods} late" if self.delay else ""
        loop = f"at {1.0 / self.period_s:g} Hz{late}"
        stiff, at = self.best()
        if stiff == 0.0:
            head += f"no wall is passive {loop}, its damping is {self.damping:.4g} {damper}"
        else:
            head += (
                f"the stiffest passive wall is K = {stiff:.4g} {spring} with B = {at:.3g} "
                f"{damper}, {loop}, on {self.damping:.4g} {damper} of its own"
            )
        who = "with the stated hand" if self.hand is not None else "without a hand"
        firm, at = self.firmest()
        if math.isinf(firm):
            return f"{head}; {who} some walls are stable at any stiffness."
        return f"{head}; {who} walls are stable up to K = {firm:.4g} with B = {at:.3g}."

    def as_dict(self) -> dict[str, Any]:
        """Return plain data; infinity is null."""
        stiff, at = self.best()
        return {
            "passive_stiffness": stiff,
            "at_damping": at,
            "device": {"mass": self.mass, "damping": self.damping},
            "hand": None if self.hand is None else self.hand._asdict(),
            "dampings": self.dampings.tolist(),
            "passive": self.passive.tolist(),
            "stable": [value if math.isfinite(value) else None for value in self.stable.tolist()],
        }


def axis_width(rig: Rig, axis_name: str, delays: Mapping[str, CommandDelay]) -> AxisWidth:
    """Return the Z-width of an impedance axis, with or without a wall."""
    own = at_axis_rate(rig, axis_name)
    axis = own.axes[axis_name]
    side, pair = axis_name.split(".")
    has = axis_allowance(own, axis_name, delays[axis_name])
    mass, damping = has.inertia, has.sampled_damping
    delay = delay_in_periods(own, delays[axis_name])
    law = SampledWall(0.0, 0.0, own.period_s, delay, axis.velocity_filter_s)
    hand = stated_hand(rig, pair).hand if side == "master" else None
    held = held_device(mass, damping, hand)
    # Passive walls end at B = b, stable ones near 2 m / T.
    most = max(3.0 * held.mass / own.period_s, 10.0 * damping)
    least = 0.03 * damping if damping > 0.0 else 1e-3 * most
    edges = [damping * np.linspace(0.6, 1.0, 6), most * np.linspace(0.3, 0.8, 6)]
    dampings = np.unique(np.concatenate([[0.0], np.geomspace(least, most, POINTS), *edges]))
    laws = [law._replace(damping=value) for value in dampings.tolist()]
    wall = local_wall(rig, axis_name)
    return AxisWidth(
        axis_name,
        axis.kind == "rotary",
        mass,
        damping,
        own.period_s,
        delay,
        hand,
        dampings,
        np.array([greatest_stiffness(one, damping) for one in laws]),
        np.array([stable_stiffness(one, held).limit for one in laws]),
        None if wall is None else (wall.stiffness, wall.damping),
    )
