"""An admittance end (takes velocity, measures effort) of a wave line, as it is implemented.

Counterpart of `tautwave.analysis.wave_port.port_loop.wave_end`: the drive follows a held velocity
with a first-order lag (0: at once), against a spring and damper to ground and a mass that rides on
it. The law is `tautwave.laws.servo.admittance`, run on unit vectors. Source: written here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from tautwave.analysis.ports.sampled_loop import LinearEnd, Push
from tautwave.analysis.wave_port.port_loop import FULL
from tautwave.laws.port import PortParams, port_close
from tautwave.laws.servo.admittance import AdmittanceParams, admittance_velocity


class Outside(NamedTuple):
    """What an admittance axis works against; SI, linear or rotary.

    stiffness [N/m or N m/rad], damping [N s/m or N m s/rad] and mass [kg or kg m^2] on the
    axis; lag: time constant [s] of the drive's velocity loop. Where a `spring` [N/m or N m/rad]
    joins a goal to a device that takes positions, `behind` is its lag [s], and no mass counts.
    """

    stiffness: float = 0.0
    damping: float = 0.0
    mass: float = 0.0
    lag: float = 0.0
    spring: float = 0.0
    behind: float = 0.0


def admittance_end(
    outside: Outside,
    port: PortParams,
    law: AdmittanceParams,
    *,
    delay_periods: int = 0,
    wave_gain: float = 1.0,
) -> LinearEnd:
    """Return one end of the wave line; arguments as in `wave_end`, `port` from `rigid_port`."""
    step = _Step(outside, port, law, delay_periods, wave_gain)
    size = len(step.names)
    a, b, c = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    for at in range(size):
        unit = [0.0] * size
        unit[at] = 1.0
        a[:, at], c[at] = step(unit, 0.0)
    b[:], _ = step([0.0] * size, 1.0)
    step.outside = 1.0
    pushed, leaving = step([0.0] * size, 0.0)
    given = f"command_{delay_periods}"
    push = Push(np.array(pushed), leaving, np.zeros(size), 1.0, given, measured=True)
    return LinearEnd(a, b, c, tuple(step.names), push)


class _Step:
    """One slot. Commands and the waves they were made from share one queue, oldest first."""

    def __init__(
        self,
        outside: Outside,
        port: PortParams,
        law: AdmittanceParams,
        delay: int,
        wave_gain: float,
    ) -> None:
        self._outside, self._port, self._law = outside, port, law
        self._wave_gain = wave_gain
        self._commands = slice(3, 4 + delay)
        self._waves = slice(4 + delay, 5 + 2 * delay)
        self.names = ["position", "velocity", "filtered_wave"]
        self.names += [f"command_{at}" for at in range(delay + 1)]
        self.names += [f"wave_{at}" for at in range(delay + 1)]
        period, lag = port.period, outside.lag
        self._left = math.exp(-period / lag) if lag > 0.0 else 0.0
        self._drag = lag * (1.0 - self._left)
        self._stays = math.exp(-period / outside.behind) if outside.behind > 0.0 else 0.0
        if outside.spring > 0.0:
            self.names += ["followed"]
        self.outside = 0.0

    def __call__(self, state: list[float], arriving: float) -> tuple[list[float], float]:
        port, law, outside = self._port, self._law, self._outside
        x, v, filtered = state[:3]
        commands, waves = state[self._commands], state[self._waves]
        acting = commands[0]
        moved = acting * port.period + (v - acting) * self._drag
        x, v = x + moved, acting + (v - acting) * self._left
        followed = self._follow(x, state[-1]) if outside.spring > 0.0 else 0.0
        pushing = (acting - v) / outside.lag if outside.lag > 0.0 else 0.0
        effort = -outside.stiffness * x - outside.damping * v - outside.mass * pushing
        effort += self.outside
        if outside.spring > 0.0:
            effort = outside.spring * (followed - x)
        leaving, _, _, filtered, _, _, _ = port_close(
            port, FULL, 0.0, filtered, moved, moved, 1.0, effort, waves[0], 0.0, False
        )
        wave = self._wave_gain * arriving
        velocity = admittance_velocity(law, effort, wave, sum(commands[1:]), 0.0, 0.0, 0.0)
        after = [x, v, filtered, *commands[1:], velocity, *waves[1:], wave]
        if outside.spring > 0.0:
            after.append(followed)
        return after, leaving / self._wave_gain

    def _follow(self, goal: float, followed: float) -> float:
        """Return where a device is a period later that was sent to `goal` at its beginning."""
        outside = self._outside
        rest = (outside.spring * goal + self.outside) / (outside.spring + outside.stiffness)
        return rest + (followed - rest) * self._stays
