"""Exact sampled-data loop of a device at a virtual wall: modes, and the stiffnesses it can bear.

A device with its hand (mass, damper, spring to ground) moves exactly under the held effort of the
wall. Everything is written in z - 1, never in z: at a fast rate or with little damping the roots
lie within 1e-12 of the unit circle, and there z itself has no digits left.

Along the unit circle the characteristic equation gives the stiffness at which a root crosses,
K(theta) = -z**d / G - B H; where it is real a root does cross, outward where Im K rises with
theta. Counting the crossings from K = 0 up finds the first limit and every stable band beyond.

Sources: Gil, Sanchez, Hulin, Preusche & Hirzinger, ASME JCISE 9(1) 011005, 2009 (the loop);
D-decomposition, Neimark 1948 (the crossings).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave.analysis.grids import merged
from tautwave.analysis.ports.loop_modes import Mode
from tautwave.analysis.ports.sampled_loop import Device, Matrix
from tautwave.analysis.walls.sampled import SampledWall, check_wall, split_delay, velocity_gain
from tautwave.errors import ConfigError
from tautwave.models.hand import Hand
from tautwave.models.linear import flow_rows

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


class Crossing(NamedTuple):
    """A root on the unit circle: gain [that of K or B], frequency [Hz], roots it moves outward."""

    gain: float
    frequency: float
    outward: int


class StableRange(NamedTuple):
    """Stiffnesses at which a device is stable at a wall.

    Attributes
    ----------
    limit : float
        Stable from 0 up to here [N/m or N m/rad]; 0 if not even the least spring is, inf if all.
    frequency : float
        At which it oscillates there [Hz].
    bands : tuple of (float, float)
        All stable ranges of K, the first one included; above it they are restabilised.
    """

    limit: float
    frequency: float
    bands: tuple[tuple[float, float], ...]


def held_device(mass: float, damping: float, hand: Hand | None = None) -> Device:
    """Return a device [kg, N s/m or rotary] with a hand on it, all three parts added."""
    if hand is None:
        return Device(mass, damping)
    return Device(mass + hand.mass, damping + hand.damping, hand.stiffness)


def wall_matrix(wall: SampledWall, device: Device) -> Matrix:
    """Return the one-period map minus the identity, shape (n, n), n = 3 + delayed efforts.

    States: position, velocity times T, filtered velocity times T, then the efforts under way,
    newest first, times T**2 / mass: all in the unit of the position.
    """
    _check(wall, device)
    whole, rest = split_delay(wall.delay + device.command_delay)
    motion, late, prompt = _motion(device, wall.period, rest)
    count = whole + (1 if rest else 0)
    size = 3 + count
    scale = wall.period**2 / device.mass
    out = np.zeros((size, size))
    effort = np.zeros(size)  # u[k] T^2 / m of the states at sample k
    effort[0] = wall.stiffness * scale
    effort[2] = wall.damping / wall.period * scale
    speed = np.array([1.0, wall.period])
    out[:2, :2] = motion * speed[:, None] / speed[None, :]
    for gain, at in ((prompt, whole), (late, whole + 1)):
        acting = effort if at == 0 else np.eye(size)[2 + at] if at <= count else np.zeros(size)
        out[:2] -= np.outer(gain * speed / scale, acting)
    filtered = velocity_gain(wall)
    out[2] = filtered * out[0]  # what the position gains
    out[2, 2] -= filtered
    if count:
        out[3] += effort
        out[3, 3] -= 1.0
        for at in range(4, size):
            out[at, at - 1], out[at, at] = 1.0, -1.0
    return out


def wall_mode(wall: SampledWall, device: Device) -> Mode:
    """Return the least damped mode of a device at a wall: radius, growth [1/s], frequency [Hz].

    The eigenvalues of `wall_matrix` are refined on the characteristic equation in z - 1, so that
    the growth keeps its digits where the radius is 1 to the last one.
    """
    start = np.linalg.eigvals(wall_matrix(wall, device)).astype(np.complex128)
    radius = np.abs(1.0 + start)
    near = start[radius > 0.9 * radius.max()]
    roots = _polish(wall, device, near)
    growth = 0.5 * np.log1p(np.maximum(2.0 * roots.real + np.abs(roots) ** 2, -1.0 + 1e-300))
    at = int(np.argmax(growth))
    turn = abs(math.atan2(roots[at].imag, 1.0 + roots[at].real))
    period = wall.period
    return Mode(
        math.exp(float(growth[at])), float(growth[at]) / period, turn / (2.0 * math.pi * period)
    )


def stable_stiffness(wall: SampledWall, device: Device) -> StableRange:
    """Return the stiffnesses at which the device is stable with the wall's B, delay and filter.

    The wall's own stiffness does not matter. On the boundary itself counts as stable.
    """
    _check(wall, device)
    unstable = _unstable_without_spring(wall, device)
    bands: list[tuple[float, float]] = []
    start = 0.0 if unstable == 0 else None
    limit, frequency = (math.inf, 0.0) if unstable == 0 else (0.0, 0.0)
    for crossing in stiffness_crossings(wall, device):
        unstable += crossing.outward
        if start is not None and unstable > 0:
            bands.append((start, crossing.gain))
            if start == 0.0:
                limit, frequency = crossing.gain, crossing.frequency
            start = None
        elif start is None and unstable == 0:
            start = crossing.gain
    if start is not None:
        bands.append((start, math.inf))
    return StableRange(limit, frequency, tuple(bands))


def stiffness_crossings(wall: SampledWall, device: Device) -> tuple[Crossing, ...]:
    """Return all stiffnesses above 0 at which a root crosses the unit circle, least first."""
    _check(wall, device)

    def gain(theta: Floats) -> Complexes:
        step = _step(theta)
        return -_inverse(wall, device, step) - wall.damping * _velocity(wall, step)

    crossings = _crossings(gain, _angles(wall, device), wall.period)
    return tuple(sorted(at for at in crossings if at.gain > 0.0))


def _unstable_without_spring(wall: SampledWall, device: Device) -> int:
    """Return how many roots are outside for a vanishing K > 0, counted from B = 0 on."""
    if wall.damping == 0.0:
        # An undamped mass under a held spring gains energy at once.
        return 0 if device.damping > 0.0 else 2
    if device.damping == 0.0 and device.stiffness > 0.0:
        device = device._replace(damping=1e-9 * math.sqrt(device.stiffness * device.mass))
    # Without a spring to ground a negative net damping puts position and velocity outside.
    drifting = 2 if device.stiffness == 0.0 and device.damping + wall.damping <= 0.0 else 0

    def gain(theta: Floats) -> Complexes:
        step = _step(theta)
        return -_inverse(wall, device, step) / _velocity(wall, step)

    crossings = _crossings(gain, _angles(wall, device), wall.period)
    if wall.damping > 0.0:
        return sum(at.outward for at in crossings if 0.0 < at.gain < wall.damping)
    return drifting - sum(at.outward for at in crossings if wall.damping < at.gain < 0.0)


def _check(wall: SampledWall, device: Device) -> None:
    check_wall(wall)
    problems = [
        f"device {name}: must be finite and not negative (got {value})"
        for name, value in device._asdict().items()
        if not (math.isfinite(value) and value >= 0.0)
    ]
    if device.mass == 0.0:
        problems.append("device mass: must be positive (got 0.0)")
    if problems:
        raise ConfigError(problems)


# -- the loop in z - 1 ----------------------------------------------------------------------------


@lru_cache(64)
def _motion(device: Device, period: float, rest: float) -> tuple[Matrix, Floats, Floats]:
    """Return the gains of x and v over a period: of the state, of the late and prompt effort.

    The late effort acts for the first `rest` of the period; shapes (2, 2), (2,), (2,).
    """
    early_map, late = _part(device, rest * period)
    later_map, prompt = _part(device, (1.0 - rest) * period)
    motion = early_map + later_map + later_map @ early_map
    return motion, late + later_map @ late, prompt


def _part(device: Device, span: float) -> tuple[Matrix, Floats]:
    """Return the gains of (x, v) over `span` [s] and those of a unit of held effort."""
    if span == 0.0:
        return np.zeros((2, 2)), np.zeros(2)
    k, b = device.stiffness, device.damping
    xv, xn, _, vv, vn, _, _, _, _ = flow_rows(k, b, device.mass, span)
    # x gains xv v + xn n with n = -k x - b v.
    return np.array([[-xn * k, xv - xn * b], [-vn * k, vv - vn * b]]), np.array([xn, vn])


def _step(theta: Floats) -> Complexes:
    """Return e^(j theta) - 1 without cancellation."""
    return np.asarray(-2.0 * np.sin(0.5 * theta) ** 2 + 1j * np.sin(theta))


def _velocity(wall: SampledWall, step: Complexes) -> Complexes:
    """Return H, the filtered velocity per position [1/s]; `step` is z - 1."""
    gain = velocity_gain(wall)
    return np.asarray(gain * step / (wall.period * (step + gain)))


def _inverse(wall: SampledWall, device: Device, step: Complexes) -> Complexes:
    """Return z**d / G: effort per position, hold and delay included; `step` is z - 1."""
    whole, rest = split_delay(wall.delay + device.command_delay)
    motion, late, prompt = _motion(device, wall.period, rest)
    (xx, xv), (vx, vv) = motion
    z = 1.0 + step
    force_x, force_v = prompt[0] + late[0] / z, prompt[1] + late[1] / z
    below = (step - vv) * force_x + xv * force_v
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(((step - xx) * (step - vv) - xv * vx) * z**whole / below)


def _angles(wall: SampledWall, device: Device) -> Floats:
    """Return the angles between which crossings are looked for: close at both ends and even."""
    periods = wall.delay + device.command_delay
    even = np.linspace(1e-3, math.pi, 200 + 80 * math.ceil(periods + 1.0))
    low = np.geomspace(1e-11, 0.05, 700)
    high = math.pi - np.geomspace(1e-7, 0.05, 200)
    return merged([even, low, high])


def _crossings(gain: Callable[[Floats], Complexes], theta: Floats, period: float) -> list[Crossing]:
    """Return where a gain along the unit circle is real; a pole is none."""
    out = []
    turn = 2.0 * math.pi * period
    theta = _with_dips(gain, theta)
    side = np.sign(gain(theta).imag)
    side[-1] = side[-2]  # at half the sampling rate it is real anyway
    at = np.flatnonzero(side[:-1] * side[1:] < 0)
    low, high, rising = theta[at], theta[at + 1], side[at + 1] > 0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = (gain(middle).imag > 0.0) == rising
        high = np.where(above, middle, high)
        low = np.where(above, low, middle)
    values = gain(0.5 * (low + high))
    # Towards a crossing the imaginary part shrinks, towards a pole it grows.
    before = np.abs(gain(theta[at]).imag) + np.abs(gain(theta[at + 1]).imag)
    shrunk = np.abs(gain(low).imag) + np.abs(gain(high).imag) < before
    for value, angle, up, real in zip(values, 0.5 * (low + high), rising, shrunk, strict=True):
        if real:
            out.append(Crossing(float(value.real), float(angle) / turn, 2 if up else -2))
    end = gain(np.array([math.pi]))[0].real
    if math.isfinite(end) and side[-1] != 0.0:
        out.append(Crossing(float(end), 0.5 / period, 1 if side[-2] < 0 else -1))
    return out


def _with_dips(gain: Callable[[Floats], Complexes], theta: Floats) -> Floats:
    """Add the angles where Im K comes closest to zero: two crossings may hide between two angles.

    They do where the delay's half turn meets the device's own resonance.
    """
    value = gain(theta).imag
    size = np.abs(value)
    inner = (size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:]) & (value[:-2] * value[2:] > 0)
    at = np.flatnonzero(inner & (value[1:-1] * value[2:] > 0)) + 1
    low, high, side = theta[at - 1], theta[at + 1], np.sign(value[at])
    share = np.linspace(0.0, 1.0, 9)[:, None]
    angles = [theta]
    for _ in range(20):
        points = low + share * (high - low)
        lowest = np.argmin(gain(points).imag * side, axis=0)
        columns = np.arange(len(at))
        angles.append(points[lowest, columns])
        low = points[np.maximum(lowest - 1, 0), columns]
        high = points[np.minimum(lowest + 1, 8), columns]
    return merged(angles)


def _polish(wall: SampledWall, device: Device, roots: Complexes) -> Complexes:
    """Return roots z - 1 of the characteristic equation, refined by Newton's method."""

    def value(step: Complexes) -> Complexes:
        law = wall.stiffness + wall.damping * _velocity(wall, step)
        return _inverse(wall, device, step) + law

    for _ in range(4):
        nudge = 1e-5 * np.abs(roots) + 1e-300
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = (value(roots + nudge) - value(roots - nudge)) / (2.0 * nudge)
            move = value(roots) / slope
        good = np.isfinite(move) & (np.abs(move) < 0.1 * np.abs(roots))
        roots = np.where(good, roots - move, roots)
    return np.asarray(roots)
