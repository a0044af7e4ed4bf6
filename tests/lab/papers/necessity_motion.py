"""The same counterexample in time: the hand is nudged once, and its motion grows.

Independent of the root that it confirms: a loop with a delay advances by the exact flow of its
undelayed part with the delayed part interpolated between samples, a sampled loop by its own
difference equation. SI units.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.exact.delay_roots import closed_loop, companion
from tautwave.analysis.exact.rational import Sampled
from tautwave.analysis.ports.necessity import Controller, Counterexample
from tautwave.analysis.walls.sampled_user import user_step
from tautwave.errors import ConfigError

Floats = npt.NDArray[np.float64]
_PER_TURN = 60  # steps per period of the quickest feature


class Motion(NamedTuple):
    """Size of the motion after a nudge.

    time : [s], shape (n,). amplitude : greatest size since the row before, relative to the first
    row [1], shape (n,). growth : rate over the second half of the rows [1/s], rough where the
    motion swings slower than it grows.
    """

    time: Floats
    amplitude: Floats
    growth: float


def simulate_hand(
    example: Counterexample,
    controller: Controller,
    *,
    growth_times: float = 4.0,
    rows: int = 40,
    most_steps: int = 400_000,
) -> Motion:
    """Simulate hand, device and controller over some growth times.

    Parameters
    ----------
    example : Counterexample
        Of `destabilising_hand`.
    controller : Rational, Delayed or Sampled
        The one it was made for.
    growth_times : float
        Duration in units of the predicted growth time.

    Raises
    ------
    ConfigError
        If that takes more than `most_steps` steps.
    """
    duration = growth_times * example.growth_time
    if isinstance(controller, Sampled):
        sizes, step = _run_sampled(example, controller, duration, most_steps)
    else:
        sizes, step = _run(example, controller, duration, most_steps)
    usable = len(sizes) // rows * rows
    if not usable:
        raise ConfigError("the motion grows within a single step, so it cannot be shown")
    peaks = sizes[:usable].reshape(rows, -1).max(axis=1)
    time = np.asarray(step * (usable // rows) * np.arange(1, rows + 1), np.float64)
    half = rows // 2
    growth = float(np.polyfit(time[half:], np.log(peaks[half:]), 1)[0])
    return Motion(time, peaks / peaks[0], growth)


def _run(
    example: Counterexample, controller: Controller, duration: float, most: int
) -> tuple[Floats, float]:
    from scipy.linalg import expm  # a quarter of a second of import

    assert not isinstance(controller, Sampled)
    loop = closed_loop(controller, example.total.impedance())
    scale = abs(example.root)
    here, there = companion(loop, scale)
    size = len(here)
    # The hold between samples has to follow whatever comes late, not the whole loop's own modes.
    rates = np.abs(np.concatenate([controller.features(), [example.root]]))
    step = min(2.0 * math.pi / (_PER_TURN * float(rates.max())), duration / 1000.0)
    late = max(1, math.ceil(loop.delay / step)) if loop.delay else 0
    step = loop.delay / late if late else step
    count = _count(duration, step, most)
    flow = np.zeros((3 * size, 3 * size))
    flow[:size, :size] = here * scale * step
    flow[:size, size : 2 * size] = np.eye(size) * scale * step
    flow[size : 2 * size, 2 * size :] = np.eye(size)
    flow = expm(flow)
    move, ramp = flow[:size, :size], flow[:size, 2 * size :] @ there
    held = flow[:size, size : 2 * size] @ there - ramp
    # As if the hand had been swinging at its frequency: other modes start small.
    state = np.real(
        (1j * example.root.imag / scale if example.root.imag else 1.0) ** np.arange(size)
    )
    past = deque([np.zeros(size)] * (late + 1), maxlen=late + 1)
    if not late:
        move = expm((here + there) * scale * step)
    sizes = np.empty(count)
    for i in range(count):
        if late:
            past.append(state)
            state = move @ state + held @ past[0] + ramp @ past[1]
        else:
            state = move @ state
        sizes[i] = math.sqrt(state @ state)
    return sizes, step


def _run_sampled(
    example: Counterexample, controller: Sampled, duration: float, most: int
) -> tuple[Floats, float]:
    period = controller.period
    m, b, k = (x + y for x, y in zip(example.total, controller.device, strict=True))
    whole = math.floor(controller.delay / period + 1e-9)
    f, old, new = user_step(period, max(0.0, controller.delay - whole * period), m, b, k)
    den = [float(c) for c in controller.law.den]
    num = [float(c) for c in controller.law.num]
    num = [0.0] * (len(den) - len(num)) + num
    count = _count(max(duration, 200 * period), period, most)
    speed = abs(example.root)
    positions = deque([0.0] * len(num), maxlen=len(num))
    forces = deque([0.0] * len(den), maxlen=len(den))
    waiting = deque([0.0] * (whole + 2), maxlen=whole + 2)
    x, v = 0.0, 1.0
    sizes = np.empty(count)
    for i in range(count):
        positions.appendleft(x)
        law = sum(c * p for c, p in zip(num, positions, strict=True))
        law -= sum(c * u for c, u in zip(den[1:], forces, strict=False))
        forces.appendleft(law)
        waiting.append(-law)
        u_old, u_new = waiting[0], waiting[1]
        x, v = (
            f[0, 0] * x + f[0, 1] * v + old[0] * u_old + new[0] * u_new,
            f[1, 0] * x + f[1, 1] * v + old[1] * u_old + new[1] * u_new,
        )
        sizes[i] = math.hypot(speed * x, v)
    return sizes, period


def _count(duration: float, step: float, most: int) -> int:
    count = math.ceil(duration / step)
    if count > most:
        raise ConfigError(
            f"it grows too slowly to be shown: {count:.3g} steps for {duration:.3g} s"
        )
    return count
