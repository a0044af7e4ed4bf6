"""What the hand feels of the slave's loads: rendered at the master while the coupling holds both.

The slave's potential V is taken at the place that the master's stands for, x_s = ratio x_m +
offset, times a share. While the pair is coupled the share is 1 and the hand gets the gradient of
V, so no energy is left around any loop. While it is not, as with a clutch, the master stands for
no place and the share is 0: a hand that clutches its way down gets no more energy than the slave
loses in height. The share rises and falls over a ramp, and the offset changes at share 0 only;
both change the potential by a number that is booked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

Weighing = Callable[[Sequence[float]], tuple[list[float], float]]
"""Takes a side's positions; returns the efforts that hold its loads there, and their potential."""


class FeltPlace(NamedTuple):
    """Where the master stands for a slave's axis: x_slave = ratio x_master + offset.

    `pair` is its name, `at` the seat of the master's axis among the carried ones, below 0 where
    the hand does not feel this axis.
    """

    pair: str
    at: int
    ratio: float
    offset: float


class FeltLoad:
    """The slave's loads as the hand feels them.

    Parameters
    ----------
    weigh : Weighing
        What the slave's loads weigh.
    places : sequence of FeltPlace
        In the order in which they are weighed.
    power : float
        Energy of the slave's devices per energy of the pair.
    ramp : int
        Periods in which the share rises or falls.
    coupled : bool
        Whether the coupling holds the axes from the start to the end of the run.
    level : float
        Potential that counts as 0 [J]: what a ramp books is from there.
    """

    def __init__(
        self,
        weigh: Weighing,
        places: Sequence[FeltPlace],
        power: float,
        ramp: int,
        *,
        coupled: bool,
        level: float = 0.0,
    ) -> None:
        self._weigh = weigh
        self._places = places
        self.power = power
        self._ramp = ramp
        self._level = level
        self.lets_go = not coupled
        """Whether the coupling begins and ends within a run."""
        self._coupled = coupled
        self._steps = ramp if coupled else 0
        self._offsets = self._wanted = [place.offset for place in places]

    @property
    def changing(self) -> bool:
        """Whether the share or an offset has to change."""
        return self._steps != self._aim() or self._offsets is not self._wanted

    def _aim(self) -> int:
        # An engagement that begins before the last one is felt no more: first let that fade.
        return self._ramp if self._coupled and self._offsets is self._wanted else 0

    def engage(self, offsets: Mapping[str, float]) -> None:
        """Take note that the coupling holds the axes, by pair with the slave's place for 0."""
        self._coupled = True
        self._wanted = [offsets.get(p.pair, p.offset) for p in self._places]
        if self._wanted == self._offsets:
            self._wanted = self._offsets

    def disengage(self) -> None:
        """Take note that the coupling let the axes go."""
        self._coupled = False

    def drop(self) -> None:
        """Begin at share 0: the devices were without torque, and nothing is left to ramp out."""
        if self.lets_go:
            self._steps = 0

    def advance(self) -> None:
        """Go on by a period of the ramp."""
        if self._steps == 0:
            self._offsets = self._wanted
        aim = self._aim()
        self._steps += (aim > self._steps) - (aim < self._steps)

    def add(self, x: Sequence[float], efforts: list[float]) -> float:
        """Add to a side's efforts what the hand feels at `x`; return its potential [J]."""
        if self._steps == 0:
            return 0.0
        share = self._steps / self._ramp
        there = [
            p.ratio * x[p.at] + offset if p.at >= 0 else 0.0
            for p, offset in zip(self._places, self._offsets, strict=True)
        ]
        held, height = self._weigh(there)
        for p, effort in zip(self._places, held, strict=True):
            if p.at >= 0:
                efforts[p.at] -= share * (p.ratio / self.power * effort)
        return -share * ((height - self._level) / self.power)
