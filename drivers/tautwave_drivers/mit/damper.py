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
    acts over the way between two samples. Its torque is kd y, where y is the velocity v behind the
    motor's low-pass: v = y + tau dy/dt. So it takes the integral of kd y^2, and kd tau y^2 / 2 goes
    into the filter and comes back. Of a way dx - tau dy of y in the time t, no motion has a lesser
    integral of y^2 than its square over t. A way is known to one step of the position, so it is one
    of several periods.

    Parameters
    ----------
    damping : float
        kd [N m s/rad].
    filter_s : float
        tau, time constant of the low-pass of its velocity [s], above zero.
    steps : tuple of float
        Of the position [rad], and of the torque, commanded and reported [N m].
    period : float
        From one sample to the next [s].

    Attributes
    ----------
    absorbed, least : float
        Taken so far as reported, and at least by the model [J].
    """

    __slots__ = ("_before", "_begin", "_count", "_damping", "_decay", "_effort", "_filter_s",
                 "_period", "_place", "_quantum", "_slack", "_speed", "_step", "absorbed",
                 "least")  # fmt: skip

    def __init__(
        self, damping: float, filter_s: float, steps: tuple[float, float], period: float
    ) -> None:
        self._damping = damping
        self._filter_s = filter_s
        self._decay = math.exp(-period / filter_s)
        self._quantum, self._step = steps
        self._period = period
        self.reset()

    def reset(self) -> None:
        """Begin with a motor that has not been heard yet."""
        self._place = self._effort = math.nan
        self._speed = 0.0
        self._begin = (0.0, 0.0)
        self._count = 0
        self.absorbed = self.least = self._slack = 0.0
        self._before = (0.0, 0.0)

    def miss(self) -> None:
        """Take no sample in this cycle: how the motor moved in between is unknown."""
        self._place = math.nan

    def take(self, position: float, effort: float) -> None:
        """Take the sample of a cycle: position [rad], and the damper's effort at it [N m].

        NaN as the effort: it does not damp. The filter follows the motion nevertheless.
        """
        moved = position - self._place
        if not math.isnan(moved):
            speed = moved / self._period
            self._speed = speed + (self._speed - speed) * self._decay
        taken = 0.5 * (effort + self._effort) * moved
        if math.isnan(taken):
            self._begin, self._count = (position, self._speed), 0
        else:
            self.absorbed -= taken
            # Reported to a step, and the command alternates around what was meant by half of one.
            self._slack += 2.0 * self._step * abs(moved)
            self._count += 1
            if self._count == PERIODS:
                place, speed = self._begin
                way = position - place - self._filter_s * (self._speed - speed)
                way = max(abs(way) - self._quantum, 0.0)
                kept = 0.5 * self._filter_s * (self._square(self._speed) - self._square(speed))
                self.least += self._damping * (way * way / (PERIODS * self._period) + kept)
                self._begin, self._count = (position, self._speed), 0
        self._place, self._effort = position, effort

    def _square(self, speed: float) -> float:
        """Return the square of a speed [rad/s], less what a step of the position makes of one."""
        known = max(abs(speed) - self._quantum / self._period * (1.0 - self._decay), 0.0)
        return known * known

    def lacks(self) -> bool:
        """Return whether far less was taken since the last call than the model says."""
        absorbed, least = self.absorbed - self._before[0], self.least - self._before[1]
        lacking = absorbed + self._slack < SHARE * least
        self._before, self._slack = (self.absorbed, self.least), 0.0
        return lacking
