"""Books of a damper in a motor: what it takes as the motor reports it, and by its model."""

from __future__ import annotations

import math

SHARE = 0.5
"""Of what the model says in a window that has to be taken as reported; less: it has failed."""

PERIODS = 8
"""Of the bus, in one way of which the model says what is taken at least."""


class DamperBooks:
    """Energy that a damper in a motor takes.

    A motor reports its whole torque; what that is beside the command that acts is the damper's. It
    acts over the way between two samples. By its model it takes at least kd dx^2 / t of a way dx in
    the time t, since no motion over it has a lesser integral of v^2. A way is known to one step of
    the position, so it is one of several periods.

    Parameters
    ----------
    damping : float
        kd [N m s/rad].
    steps : tuple of float
        Of the position [rad], and of the torque, commanded and reported [N m].
    period : float
        From one sample to the next [s].

    Attributes
    ----------
    absorbed, least : float
        Taken so far as reported, and at least by the model [J].
    """

    __slots__ = ("_before", "_begin", "_count", "_damping", "_effort", "_period", "_place",
                 "_quantum", "_slack", "_step", "absorbed", "least")  # fmt: skip

    def __init__(self, damping: float, steps: tuple[float, float], period: float) -> None:
        self._damping = damping
        self._quantum, self._step = steps
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Begin with a motor that has not been heard yet."""
        self._place = self._effort = self._begin = math.nan
        self._count = 0
        self.absorbed = self.least = self._slack = 0.0
        self._before = (0.0, 0.0)

    def miss(self) -> None:
        """Take no sample in this cycle: how the motor moved in between is unknown."""
        self._place = math.nan

    def take(self, position: float, effort: float) -> None:
        """Take the sample of a cycle: position [rad], and the damper's effort at it [N m]."""
        moved = position - self._place
        if math.isnan(moved):
            self._begin, self._count = position, 0
        else:
            self.absorbed -= 0.5 * (effort + self._effort) * moved
            # Reported to a step, and the command alternates around what was meant by half of one.
            self._slack += 2.0 * self._step * abs(moved)
            self._count += 1
            if self._count == PERIODS:
                way = max(abs(position - self._begin) - self._quantum, 0.0)
                self.least += self._damping * way * way / (PERIODS * self._period)
                self._begin, self._count = position, 0
        self._place, self._effort = position, effort

    def lacks(self) -> bool:
        """Return whether far less was taken since the last call than the model says."""
        absorbed, least = self.absorbed - self._before[0], self.least - self._before[1]
        lacking = absorbed + self._slack < SHARE * least
        self._before, self._slack = (self.absorbed, self.least), 0.0
        return lacking
