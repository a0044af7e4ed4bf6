"""One end of a wave line as a linear system: `sampled_loop` with observer and wave filter in it.

The tank is full, nothing is clipped: the laws are those of the live loop, run on unit vectors.
"""

from __future__ import annotations

import math

from tautwave.analysis.ports.sampled_loop import (
    Device,
    LinearEnd,
    Site,
    SlotState,
    WallState,
    linearise,
)
from tautwave.laws.observer import ObserverParams, observe
from tautwave.laws.port import PortParams, port_close, port_effort

FULL = math.inf
"""Energy in a tank [J] that never limits: the linear regime."""


def wave_end(
    device: Device,
    site: Site,
    port: PortParams,
    observer: ObserverParams,
    *,
    wave_gain: float = 1.0,
) -> LinearEnd:
    """Return one end of the line.

    Parameters
    ----------
    device, site : Device, Site
        Truth and belief.
    port, observer : PortParams, ObserverParams
        Constants of the laws.
    wave_gain : float
        Device wave per line wave (scaling) [1].
    """
    return linearise(device, site, lambda slot: _WaveStep(slot, port, observer, wave_gain))


class _WaveStep:
    """One slot. Extra state: position, the observer's three, the filter, waves of commands."""

    def __init__(
        self, slot: SlotState, port: PortParams, observer: ObserverParams, wave_gain: float
    ) -> None:
        self._slot, self._port, self._observer = slot, port, observer
        self._wave_gain = wave_gain
        self._wall = WallState(slot.site)
        self._waves = slot.size + 5
        self._walls = self._waves + slot.site.delay_periods + 1
        self.size = self._walls + self._wall.size
        self.names = [*slot.names, "position", "observed_position", "observed_velocity"]
        self.names += ["observed_push", "filtered_wave"]
        self.names += [f"wave_{at}" for at in range(slot.site.delay_periods + 1)]
        self.names += self._wall.names

    def __call__(self, state: list[float], arriving: float) -> tuple[list[float], float]:
        slot, port = self._slot, self._port
        x, at, velocity, push, filtered = state[slot.size : slot.size + 5]
        waves = state[self._waves : self._walls]
        moved, _ = slot.move(state, x)
        part = state[self._walls :]
        acted, wall = self._wall.step(part, x + moved, moved)
        effort, pending = state[2] - acted, slot.under_way(state) - self._wall.under_way(part)
        if self._observer.pole < 0.0:  # a plain port has to know the wall
            effort, pending = state[2], slot.under_way(state) + 0.5 * wall
        ahead, velocity, push = observe(self._observer, at, velocity, push, x + moved, effort, 1.0)
        leaving, _, _, filtered, _, _, _ = port_close(
            port, FULL, 0.0, filtered, moved, ahead - at, 1.0, state[2] - acted, waves[0], 0.0,
            False,
        )  # fmt: skip
        wave = self._wave_gain * arriving
        effort = port_effort(port, FULL, velocity, push, pending, wave)
        state[1] = wall + effort
        state[slot.size : slot.size + 5] = [x + moved, ahead, velocity, push, filtered]
        state[self._waves :] = [*waves[1:], wave, *part]
        return state, leaving / self._wave_gain
