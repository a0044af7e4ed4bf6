"""Closed motions of both ends of a pair, what they gain from its motors, and better ones.

Who moves both ends along a closed path, and finds that the motors gave more than friction took, has
energy without end. The books are exact: a motor's effort is held between two samples, so its work
is effort times displacement, and the least that a damper takes of a displacement is that of a
uniform motion. Nothing here but `Stepper` is ours, so that no model is believed twice; `Suspected`
is a spring written down anew, to find motions fast, and what it finds is tried on the product.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tautwave import Rig, Stepper

Array = npt.NDArray[np.float64]
OUTSIDE = ("master.a", "slave.a")


class Gain(NamedTuple):
    """What who moves both ends has of it [J]: `net` after friction, of a `gross` flow."""

    net: float
    gross: float

    @property
    def share(self) -> float:
        return self.net / self.gross if self.gross > 0.0 else 0.0


class Friction(NamedTuple):
    """What two devices take of any motion [N s/m, N], by end; `weights` of their energies [1]."""

    damping: tuple[float, float]
    coulomb: tuple[float, float] = (0.0, 0.0)
    weights: tuple[float, float] = (1.0, 1.0)

    def gain(self, efforts: Array, moves: Array, period: float) -> Gain:
        """Return what held efforts gain over displacements, both of shape (2, n)."""
        work = efforts * moves
        viscous = np.multiply(self.damping, np.sum(moves * moves, axis=1)) / period
        taken = viscous + np.multiply(self.coulomb, np.sum(np.abs(moves), axis=1))
        net = np.dot(self.weights, np.sum(work, axis=1) - taken)
        return Gain(float(net), float(np.dot(self.weights, np.sum(np.abs(work), axis=1))))


def lap_of(rig: Rig, motion: Array, friction: Friction, settle: int) -> Gain:
    """Return what one lap of a closed motion gains, after as many laps as `settle` periods take.

    `motion`: positions of both devices, of shape (2, n), the first again after the last.
    """
    size = motion.shape[1]
    before = -(-settle // size) * size
    rest = np.zeros((2, 8))
    way = motion[:, :1] * minimum_jerk(64)  # from 0, where walls begin: pairs engage out of them
    path = np.concatenate([rest, way, *[motion] * (before // size + 1), motion[:, :1]], axis=1)
    begin = path.shape[1] - 1 - size
    efforts = np.zeros((2, size))
    with Stepper(rig, outside=("master", "slave"), duration_s=path.shape[1] * rig.period_s) as one:
        for at, places in enumerate(path[:, :-1].T):
            acting = one.step(dict(zip(OUTSIDE, places, strict=True)))
            if at >= begin:
                efforts[:, at - begin] = [acting[name] for name in OUTSIDE]
    return friction.gain(efforts, np.diff(path[:, begin:], axis=1), rig.period_s)


def greedy_gain(rig: Rig, friction: Friction, kick: Sequence[float], periods: int) -> Gain:
    """Return the most that one has who goes with every effort as far as it pays, after a kick.

    An effort f pays most, less the damper's share, over f T / 2 d. From rest, so nothing is stored:
    at no time may there be more than nothing.
    """
    period = rig.period_s
    place, best, gross, net = np.zeros(2), 0.0, 0.0, 0.0
    damping, coulomb = np.array(friction.damping), np.array(friction.coulomb)
    with Stepper(rig, outside=("master", "slave"), duration_s=(periods + 8) * period) as one:
        for at in range(periods):
            acting = one.step(dict(zip(OUTSIDE, place, strict=True)))
            efforts = np.array([acting[name] for name in OUTSIDE])
            driving = np.sign(efforts) * np.maximum(np.abs(efforts) - coulomb, 0.0)
            moves = np.array(kick) if at == 8 else driving * period / (2.0 * damping)
            found = friction.gain(efforts[:, None], moves[:, None], period)
            net, gross = net + found.net, gross + found.gross
            best = max(best, net)
            place = place + moves
    return Gain(best, gross)


def minimum_jerk(size: int) -> Array:
    """Return a smooth way from 0 to 1."""
    s = np.linspace(0.0, 1.0, size, endpoint=False)
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s)


def through(places: Sequence[float], sizes: Sequence[int]) -> Array:
    """Return a smooth way from place to place, and back to the first."""
    ends = zip(places, (*places[1:], places[0]), sizes, strict=True)
    return np.concatenate([a + (b - a) * minimum_jerk(size) for a, b, size in ends])


def carry(stretch: float, way: float, pull: int, walk: int) -> Array:
    """Pull one end from the other, walk with both, let go there, and walk back."""
    sizes = (pull, walk, pull, walk)
    return np.stack(
        [through((0.0, 0.0, way, way), sizes), through((0.0, stretch, way + stretch, way), sizes)]
    )


def opposed(size: int, stretch: float, lean: float, lag: float) -> Array:
    """Swing both ends, against each other at `lag` pi."""
    angle = 2.0 * np.pi * np.arange(size) / size
    return stretch * np.stack([np.cos(angle), lean * np.cos(angle - lag)])


def dither(size: int, step: float, lean: float, place: float) -> Array:
    """Shake both ends to and fro in every period, at a place that comes and goes."""
    side = np.where(np.arange(size) % 2, -step, step)
    rest = place * (minimum_jerk(size) * (1.0 - minimum_jerk(size)) * 4.0)
    return np.stack([rest + side, rest - lean * side])


def drawn_motions(draw: np.random.Generator, stretch: float, memory: int) -> Iterator[Array]:
    """Yield motions of every kind, about as wide as a `stretch`, for a law of such a memory."""
    slow = max(16, 2 * round(draw.uniform(4.0, 12.0) * (memory + 1)))
    wide = stretch * 10.0 ** draw.uniform(-1.0, 0.7)
    yield opposed(slow, 0.4 * stretch, 1.0, np.pi)
    yield opposed(slow, wide, draw.uniform(0.3, 1.5), draw.uniform(0.0, 2.0 * np.pi))
    yield carry(wide, draw.uniform(2.0, 20.0) * wide, slow // 4 + 4, slow // 2 + 8)
    yield carry(-wide, draw.uniform(2.0, 20.0) * wide, slow // 4 + 4, slow // 2 + 8)
    yield dither(16, 0.4 * stretch, 1.0, 0.0)
    yield dither(slow, 0.1 * wide, draw.uniform(0.5, 1.5), wide)
    tones = np.zeros((2, slow // 2 + 1), np.complex128)
    few = min(6, slow // 2)
    tones[:, 1 : few + 1] = draw.normal(size=(2, few)) + 1j * draw.normal(size=(2, few))
    yield wide * np.fft.irfft(tones, slow) * slow / 4.0
    yield wide * draw.normal(size=(2, 24))


class Suspected(NamedTuple):
    """A spring between two ends, as it may be suspected; all in the units of the master.

    taps: efforts at both ends `lag` periods after a sample was off by 1: (end, of end, lag, value);
    clips: of what each end sends; walls: stiffness, place and clip at each end (0: none).
    """

    taps: Sequence[tuple[int, int, int, float]]
    clips: tuple[float, float]
    walls: tuple[tuple[float, float, float], tuple[float, float, float]]
    friction: Friction
    period: float

    def _asked(self, motion: Array) -> Array:
        asked = np.zeros_like(motion)
        for end, of, lag, value in self.taps:
            asked[end] += value * np.roll(motion[of], lag % motion.shape[1])
        return asked

    def pressed(self, motion: Array) -> float:
        """Return the greatest effort that a motion asks for, as a share of its clip."""
        return float(np.max(np.abs(self._asked(motion)) / np.array(self.clips)[:, None]))

    def lap(self, motion: Array) -> Gain:
        """Return what one lap of a motion would gain."""
        asked = self._asked(motion)
        sent = np.clip(asked.T, -np.array(self.clips), self.clips).T
        for end, (stiffness, place, clip) in enumerate(self.walls):
            sent[end] += np.clip(stiffness * (motion[end] - place), 0.0, clip)
        moves = np.roll(motion, -1, axis=1) - motion
        return self.friction.gain(-sent, moves, self.period)

    def climb(self, draw: np.random.Generator, motion: Array, tries: int) -> tuple[Array, Gain]:
        """Return a motion that pays better, found by changes that pay."""
        best, found = motion, self.lap(motion)
        width = 0.3
        for _ in range(tries):
            trial = self._changed(draw, best, width)
            now = self.lap(trial)
            if now.share > found.share:
                best, found, width = trial, now, min(1.0, 1.5 * width)
            else:
                width = max(1e-3, 0.9 * width)
        return best, found

    @staticmethod
    def _changed(draw: np.random.Generator, motion: Array, width: float) -> Array:
        size = motion.shape[1]
        kind = draw.integers(5)
        if kind == 0:
            return motion * np.exp(width * draw.normal())
        scaled = motion.copy()
        if kind == 1:
            scaled[draw.integers(2)] *= 1.0 + width * draw.normal()
        elif kind == 2:
            end = draw.integers(2)
            scaled[end] = np.roll(scaled[end], draw.integers(-3, 4))
        elif kind == 3:
            tone = draw.integers(1, max(2, size // 2 + 1))
            angle = 2.0 * np.pi * (tone * np.arange(size) / size + draw.uniform())
            scaled[draw.integers(2)] += width * float(np.std(motion)) * np.cos(angle)
        else:
            scaled += (
                width
                * float(np.std(motion))
                * draw.normal(size=(2, 1))
                * np.cos(2.0 * np.pi * (np.arange(size) / size + draw.uniform()))
            )
        return scaled
