"""A string at its contact point: two lines of the same kind as the wave coupling's.

The point moves at v; a line of impedance b gets the wave u = sqrt(2 b) v - a where a arrives, and
resists with b v - sqrt(2 b) a. So the point is a node of the network without mass, with the damping
2 b, pushed by sqrt(2 b)(a_near + a_far): links to it are solved together with it, and the energy it
gives is on the lines, exactly. Without a force the waves pass through unchanged.

A line is two rings of floats, one per direction. It also advances in a slot that the loop skipped:
nothing enters it (a null wave, which is passive), and the leaving waves are handed over.
"""

from __future__ import annotations

import math

from tautwave.laws.wave_filter import filter_step
from tautwave_scenes.networks.compiling import Arrays
from tautwave_scenes.networks.network import String


class DelayLine:
    """A lossless line that delays by a whole number of samples, both ways.

    Parameters
    ----------
    samples : int
        Delay in loop periods, >= 1.
    period : float
        Loop period T [s]; half a wave squared times T is the energy of a sample.

    Attributes
    ----------
    absorbed, stored : float
        Energy in minus energy out [J], and energy on the line [J].
    """

    __slots__ = ("_at", "_half_period", "_samples", "_to_master", "_to_slave", "absorbed", "stored")

    def __init__(self, samples: int, period: float) -> None:
        if samples < 1:
            raise ValueError("a delay line holds at least one sample; leave it out for no delay")
        self._samples = samples
        self._half_period = 0.5 * period
        self._to_slave = [0.0] * samples
        self._to_master = [0.0] * samples
        self._at = 0
        self.absorbed = 0.0
        self.stored = 0.0

    def exchange(self, from_master: float, from_slave: float) -> tuple[float, float]:
        """Pass one slot: take both leaving waves, return those arriving at (master, slave)."""
        at = self._at
        at_slave = self._to_slave[at]
        at_master = self._to_master[at]
        self._to_slave[at] = from_master
        self._to_master[at] = from_slave
        at += 1
        self._at = 0 if at == self._samples else at
        change = self._half_period * (
            from_master * from_master
            + from_slave * from_slave
            - at_slave * at_slave
            - at_master * at_master
        )
        self.absorbed += change
        self.stored += change
        return at_master, at_slave

    def fill(self, from_master: float, from_slave: float) -> None:
        """Fill the whole line with the same two values, without booking energy."""
        for index in range(self._samples):
            self._to_slave[index] = from_master
            self._to_master[index] = from_slave


class LineEnd:
    """One half of a string: a line to an end that inverts waves, with losses."""

    __slots__ = (
        "_back",
        "_half_period",
        "_line",
        "_period",
        "_string",
        "arriving",
        "lost",
        "state",
    )

    def __init__(self, string: String, samples: int, period: float) -> None:
        self._string = string
        self._line = DelayLine(samples, period)
        self._period = period
        self._half_period = 0.5 * period
        self._back = 0.0
        self.state = 0.0
        self.arriving = 0.0
        self.lost = 0.0

    def send(self, wave: float) -> None:
        """Pass one sample: `wave` leaves the point, `arriving` is what comes next."""
        self.arriving, at_end = self._line.exchange(wave, self._back)
        string = self._string
        out = at_end
        if string.smoothing < 1.0:
            out, _, absorbed = filter_step(string.smoothing, self._period, self.state, at_end)
            self.lost += absorbed
            self.state = out
        self._back = -string.reflection * out
        self.lost += self._half_period * (out * out - self._back * self._back)

    @property
    def stored(self) -> float:
        """Energy on the line, at its end and about to leave it at the point [J]."""
        waiting = self.arriving * self.arriving + self._back * self._back
        filtered = 0.0
        gain = self._string.smoothing
        if gain < 1.0:
            filtered = self._half_period * (1.0 - gain) / gain * self.state * self.state
        return self._line.stored + self._half_period * waiting + filtered


class TouchedString:
    """Both halves of a string, and the node of the network where they meet."""

    __slots__ = ("_ends", "_node", "_root", "string")

    def __init__(self, string: String, node: int, period: float) -> None:
        self.string = string
        self._node = node
        self._root = math.sqrt(2.0 * string.impedance)
        self._ends = (LineEnd(string, string.near, period), LineEnd(string, string.far, period))

    def push(self, s: Arrays) -> None:
        """Before a step: apply the arriving waves to the node."""
        near, far = self._ends
        s.pushed[self._node] = self._root * (near.arriving + far.arriving)

    def carry_on(self, s: Arrays) -> None:
        """After a step: send the waves that result from the node's motion."""
        motion = self._root * s.v[self._node]
        for end in self._ends:
            end.send(motion - end.arriving)

    def absorbed(self, s: Arrays) -> float:
        """Energy from the node to both lines [J]."""
        return float(s.dragged[self._node] - s.pumped[self._node])

    @property
    def stored(self) -> float:
        """Energy on both lines [J]."""
        return self._ends[0].stored + self._ends[1].stored

    @property
    def lost(self) -> float:
        """Energy lost at both ends [J]."""
        return self._ends[0].lost + self._ends[1].lost
