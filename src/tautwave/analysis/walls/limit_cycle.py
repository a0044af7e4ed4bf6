"""Limit cycle of a device pressed against a sampled wall: predicted, and simulated.

Pressed by a constant bias force, a device with too little damping circles away from its resting
depth until it leaves the wall; outside it loses speed to its own damping, and the bias brings it
back. Where the gain inside equals the loss outside there is a limit cycle. Inside the motion is
the dominant mode of the exact sampled loop, outside a damped mass under a constant force; only
the instants of entry and exit are taken on average over the sampling phase.

Sources: Colgate & Schenkel 1997 and its seed (the bias); the return map is written here.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.ports.sampled_loop import Device
from tautwave.analysis.walls.sampled import SampledWall, check_wall, split_delay, velocity_gain
from tautwave.analysis.walls.stability import wall_mode
from tautwave.errors import ConfigError
from tautwave.laws.wall import WallParams, wall_depth, wall_effort
from tautwave.models.encoder import quantise
from tautwave.models.plant import PlantParams, plant_cache, plant_step

Floats = npt.NDArray[np.float64]

VOLUNTARY_HZ = 10.0
"""People do not move faster on purpose: an oscillation above it comes from the interface."""


class LimitCycle(NamedTuple):
    """A sustained bounce; all zero where the device comes to rest, inf where it is unbounded.

    depth: mean greatest penetration; height: mean greatest distance from the wall [m or rad];
    frequency [Hz]; peak_effort: mean greatest effort of the wall [N or N m].
    """

    depth: float
    height: float
    frequency: float
    peak_effort: float

    @property
    def involuntary(self) -> bool:
        """Whether it is faster than voluntary motion."""
        return self.frequency > VOLUNTARY_HZ


REST = LimitCycle(0.0, 0.0, 0.0, 0.0)
UNBOUNDED = LimitCycle(math.inf, math.inf, 0.0, math.inf)


def predict_limit_cycle(wall: SampledWall, device: Device, bias: float) -> LimitCycle:
    """Return the limit cycle of a device [without a hand's spring] under a bias force.

    Good to a few per cent while a turn in contact takes more than some 20 periods plus delay;
    without Coulomb friction and quantisation.

    Parameters
    ----------
    wall : SampledWall
        The wall, one-sided.
    device : Device
        Mass and damping; its spring must be 0.
    bias : float
        Constant force into the wall [N or N m], > 0.

    Raises
    ------
    ConfigError
        The device has a spring, the bias is not positive, or the loop does not oscillate.
    """
    _check(wall, device, bias)
    mode = wall_mode(wall, device)
    if mode.growth <= 0.0:
        return REST
    if mode.frequency <= 0.0 or mode.frequency * wall.period > 0.25:
        raise ConfigError("limit cycle: the unstable mode is not a slow oscillation of the contact")
    if device.damping == 0.0:
        return UNBOUNDED
    bounce = _Bounce(wall, device, bias, complex(mode.growth, 2.0 * math.pi * mode.frequency))
    low = 0.0
    high = 1e-3 * bias / math.sqrt(wall.stiffness * device.mass)
    while bounce.turn(high).entry > high:
        low, high = high, 2.0 * high
        if not high < 1e100:
            return UNBOUNDED
    for _ in range(100):
        middle = 0.5 * (low + high)
        if bounce.turn(middle).entry > middle:
            low = middle
        else:
            high = middle
    return bounce.turn(high).cycle


class _Turn(NamedTuple):
    entry: float
    cycle: LimitCycle


class _Bounce:
    """Return map of the speed at entry, from one contact to the next."""

    def __init__(self, wall: SampledWall, device: Device, bias: float, mode: complex) -> None:
        self._device, self._bias, self._mode = device, bias, mode
        self._lag = (0.5 + wall.delay + device.command_delay) * wall.period
        self._rest = bias / wall.stiffness

    def turn(self, speed: float) -> _Turn:
        """Return the next speed at entry, and the cycle as if it were the same."""
        s = self._mode
        turn = s.imag
        start = self._lag * speed - self._rest
        z = complex(start, (s.real * start - speed) / turn)
        phase = cmath.phase(s * z)
        deepest = (0.5 * math.pi - phase) / turn
        leave = _root(lambda t: -self._push(z, t), deepest, deepest + math.pi / turn)
        peak = max(self._push(z, leave * i / 256) for i in range(257))
        at = (z * cmath.exp(s * leave)).real + self._rest
        speed_out = (s * z * cmath.exp(s * leave)).real
        flight, height, entry = self._fly(at, speed_out)
        depth = (z * cmath.exp(s * deepest)).real + self._rest
        return _Turn(entry, LimitCycle(depth, height, 1.0 / (leave + flight), peak))

    def _push(self, z: complex, t: float) -> float:
        """Return the wall's effort at time t of a contact: what the mode's motion needs."""
        s = self._mode
        motion = z * cmath.exp(s * t)
        speed, pull = (s * motion).real, (s * s * motion).real
        return self._bias - self._device.damping * speed - self._device.mass * pull

    def _fly(self, x: float, v: float) -> tuple[float, float, float]:
        """Return time until the wall acts again, greatest distance on the way, speed then."""
        m, b, bias = self._device.mass, self._device.damping, self._bias
        final = bias / b

        def speed(t: float) -> float:
            return v - (final - v) * math.expm1(-b * t / m)

        def place(t: float) -> float:
            return x + v * t + (final - v) * (t + m / b * math.expm1(-b * t / m))

        back = m / b * math.log1p(-v / final)
        late = 2.0 * back + self._lag + 1e-9 * m / b
        while place(late) < self._lag * speed(late):
            late *= 2.0
        t = _root(lambda t: place(t) - self._lag * speed(t), back, late)
        return t, -place(back), speed(t)


def _root(value: Callable[[float], float], low: float, high: float) -> float:
    """Return where a function rises through zero."""
    for _ in range(80):
        middle = 0.5 * (low + high)
        if value(middle) < 0.0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def simulate_limit_cycle(
    wall: SampledWall,
    device: Device,
    bias: float,
    *,
    samples: int = 20000,
    coulomb: float = 0.0,
    quantum: float = 0.0,
    fall: float = 1.0,
) -> LimitCycle:
    """Return what the models and the live wall law do; means over the second half of the time.

    Parameters
    ----------
    wall, device, bias : SampledWall, Device, float
        As for `predict_limit_cycle`.
    samples : int
        Periods to simulate.
    coulomb : float
        Coulomb friction of the device [N or N m].
    quantum : float
        Encoder step [m or rad].
    fall : float
        Distance of the start from the wall, in resting depths bias / K.
    """
    cycles = _Cycles(samples * wall.period / 2.0)
    for time, x, v, effort in _bounces(wall, device, bias, samples, coulomb, quantum, fall):
        cycles.see(time, x, v, effort)
    return cycles.mean(bias / wall.stiffness)


def trace_limit_cycle(
    wall: SampledWall, device: Device, bias: float, *, samples: int, shown: int, fall: float = 1.0
) -> tuple[Floats, Floats, Floats]:
    """Return the last `shown` samples of a simulation: time [s], depth [m or rad], wall's effort.

    Arguments as for `simulate_limit_cycle`; time begins at 0, shapes (shown,).
    """
    rows = list(_bounces(wall, device, bias, samples, 0.0, 0.0, fall))[-shown:]
    time, x, _, effort = np.array(rows).T
    return time - time[0], x, effort


def _bounces(
    wall: SampledWall,
    device: Device,
    bias: float,
    samples: int,
    coulomb: float,
    quantum: float,
    fall: float,
) -> Iterator[tuple[float, float, float, float]]:
    """Yield time, position, velocity and the wall's effort at every sample."""
    _check(wall, device, bias)
    law = WallParams(0.0, 1.0, wall.stiffness, wall.damping, controlled=False)
    plant = PlantParams(
        device.mass, device.damping, coulomb, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0
    )
    whole, rest = split_delay(wall.delay + device.command_delay)
    spans = [rest * wall.period, (1.0 - rest) * wall.period] if rest else [wall.period]
    caches = [plant_cache(plant, span) for span in spans]
    pipe = [0.0] * (whole + 2)
    gain = velocity_gain(wall)
    x, v, mode, filtered = -fall * bias / wall.stiffness, 0.0, 0, 0.0
    seen = quantise(x, quantum)
    for k in range(samples):
        before, seen = seen, quantise(x, quantum)
        filtered += gain * ((seen - before) / wall.period - filtered)
        effort = wall_effort(law, wall_depth(law, seen), filtered)
        pipe = [effort, *pipe[:-1]]
        yield k * wall.period, x, v, effort
        acting = [pipe[whole + 1], pipe[whole]] if rest else [pipe[whole]]
        for held, span, cache in zip(acting, spans, caches, strict=True):
            x, v, mode, *_ = plant_step(plant, cache, x, v, mode, bias - held, 0.0, 0.0, span)


class _Cycles:
    """Means over whole bounces, from entry to entry, after `begin` [s]."""

    def __init__(self, begin: float) -> None:
        self._begin = begin
        self._last: tuple[float, float] | None = None
        self._entries: list[float] = []
        self._found: list[tuple[float, float, float]] = []
        self._deep = self._high = self._peak = 0.0

    def see(self, time: float, x: float, v: float, effort: float) -> None:
        """Take one sample."""
        last = self._last
        self._last = (time, x)
        if last is None or time < self._begin:
            return
        if last[1] <= 0.0 < x and v > 0.0:
            share = -last[1] / (x - last[1])
            if self._entries:
                self._found.append((self._deep, self._high, self._peak))
            self._entries.append(last[0] + share * (time - last[0]))
            self._deep = self._high = self._peak = 0.0
        self._deep = max(self._deep, x)
        self._high = max(self._high, -x)
        self._peak = max(self._peak, effort)

    def mean(self, rest: float) -> LimitCycle:
        """Return the means, or rest if the wall is not left any more."""
        count = len(self._found)
        if count < 2 or self._deep < 1e-6 * rest:
            return REST
        deep, high, peak = (sum(part) / count for part in zip(*self._found, strict=True))
        span = self._entries[-1] - self._entries[0]
        return LimitCycle(deep, high, count / span, peak)


def _check(wall: SampledWall, device: Device, bias: float) -> None:
    check_wall(wall)
    if device.stiffness != 0.0:
        raise ConfigError("limit cycle: the device must have no spring; the bias holds it")
    if not (math.isfinite(bias) and bias > 0.0):
        raise ConfigError(f"limit cycle: the bias must be finite and positive (got {bias})")
    if wall.stiffness <= 0.0:
        raise ConfigError("limit cycle: the wall needs a stiffness")
