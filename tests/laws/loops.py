"""State matrices of sampled loops, built from the law functions themselves, column by column."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm

from tautwave.laws.observer import ObserverParams, observe
from tautwave.laws.port import PortParams, port_close, port_effort

Matrix = np.ndarray[Any, np.dtype[np.float64]]
RICH = 1e30  # a tank that never limits anything: the port is then linear


class Device(NamedTuple):
    """A true device under a held resisting effort; stiffness and damping are to the ground."""

    mass: float
    damping: float = 0.0
    stiffness: float = 0.0

    def flow(self, period: float) -> tuple[list[float], list[float]]:
        """Return rows (x, v) of the exact step on (x, v, effort)."""
        a = np.zeros((3, 3))
        a[0, 1] = 1.0
        a[1] = [-self.stiffness / self.mass, -self.damping / self.mass, -1.0 / self.mass]
        step = expm(a * period)
        return step[0].tolist(), step[1].tolist()


FREE = Device(0.5)
DAMPED = Device(0.5, 2.0)
HAND = Device(0.5 + 0.143, 5.0, 538.0)


def matrix_of(cycle: Callable[[list[float]], Sequence[float]], size: int) -> Matrix:
    """Return the matrix of a linear function of `size` numbers."""
    columns = []
    for at in range(size):
        unit = [0.0] * size
        unit[at] = 1.0
        columns.append(list(cycle(unit)))
    return np.array(columns).T


def radius(matrix: Matrix) -> float:
    """Return the spectral radius."""
    return float(np.abs(np.linalg.eigvals(matrix)).max())


class PortState(NamedTuple):
    """Indices of a port loop's state vector: fixed part, then pipe efforts, pipe waves."""

    size: int
    delay: int


def port_cycle(
    p: PortParams, seen: ObserverParams, device: Device, delay: int
) -> tuple[int, Callable[[list[float], float], tuple[list[float], float]]]:
    """Return (number of states, step): one period of port and device, wave in to wave out.

    The states are those at the end of a period, before it is closed: displacement, x, v, observed
    position less measured, observed velocity and acceleration, filter, acting effort and wave, then
    the efforts and waves under way. `step` closes the period and returns the leaving wave; the
    arriving wave acts on the next period, so a delay-free far end is possible.
    """
    row_x, row_v = device.flow(p.period)
    size = 9 + 2 * delay

    def step(state: list[float], arriving: float) -> tuple[list[float], float]:
        moved, x, v, off, velocity, push, filtered, acted, wave = state[:9]
        efforts, waves = state[9 : 9 + delay], state[9 + delay : size]
        ahead, velocity, push = observe(seen, off, velocity, push, moved, acted, 1.0)
        leaving, _, _, filtered, _, _, _ = port_close(
            p, RICH, 0.0, filtered, moved, ahead - off, 1.0, acted, wave, 0.0, False
        )
        effort = port_effort(p, RICH, velocity, push, sum(efforts), arriving)
        efforts, waves = [*efforts, effort], [*waves, arriving]
        acting, acting_wave = efforts.pop(0), waves.pop(0)
        # Without a spring nothing depends on x: it is left out, or it would be a pole at 1.
        after = row_x[0] * x + row_x[1] * v + row_x[2] * acting
        off = ahead - moved
        moved = after - x
        v = row_v[0] * x + row_v[1] * v + row_v[2] * acting
        x = after if device.stiffness > 0.0 else 0.0
        last = [moved, x, v, off, velocity, push, filtered, acting, acting_wave]
        return [*last, *efforts, *waves], leaving

    return size, step


def port_loop(
    p: PortParams,
    seen: ObserverParams,
    device: Device,
    delay: int,
    samples: int,
    reflection: float,
) -> Matrix:
    """Return the state matrix of port and device before a far end that is `samples` away.

    What left comes back `samples` slots later, multiplied by `reflection`.
    """
    size, step = port_cycle(p, seen, device, delay)

    def cycle(state: list[float]) -> list[float]:
        line = state[size:]
        if samples:
            after, leaving = step(state[:size], reflection * line[0])
            return [*after, *line[1:], leaving]
        _, leaving = step(state[:size], 0.0)
        after, _ = step(state[:size], reflection * leaving)
        return after

    return matrix_of(cycle, size + samples)


def port_response(
    p: PortParams, seen: ObserverParams, device: Device, delay: int, angles: Matrix
) -> Matrix:
    """Return S(exp(j angle)), leaving over arriving wave of port and device."""
    size, step = port_cycle(p, seen, device, delay)

    def both(state: list[float]) -> list[float]:
        after, leaving = step(state[:size], state[size])
        return [*after, leaving]

    full = matrix_of(both, size + 1)
    a, b = full[:size, :size], full[:size, size]
    c, d = full[size, :size], full[size, size]
    out = [d + c @ np.linalg.solve(np.exp(1j * angle) * np.eye(size) - a, b) for angle in angles]
    return np.array(out)


def naive_loop(
    impedance: float, period: float, device: Device, samples: int, reflection: float
) -> Matrix:
    """Return the state matrix of the obvious port: estimate, F = b v - root w, u = root v - w."""
    row_x, row_v = device.flow(period)
    root = math.sqrt(2.0 * impedance)

    def cycle(state: list[float]) -> list[float]:
        moved, x, v, *line = state
        wave = reflection * line[0]
        estimate = moved / period
        effort = impedance * estimate - root * wave
        after = row_x[0] * x + row_x[1] * v + row_x[2] * effort
        return [
            after - x,
            after if device.stiffness > 0.0 else 0.0,
            row_v[0] * x + row_v[1] * v + row_v[2] * effort,
            *line[1:],
            root * estimate - wave,
        ]

    return matrix_of(cycle, 3 + samples)
