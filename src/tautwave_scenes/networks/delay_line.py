"""Constant-delay line between two sites in one process.

Two rings of floats, one per direction. The line also advances in a slot that the loop skipped:
nothing enters it (a null wave, which is passive), and the leaving waves are handed over.
"""

from __future__ import annotations


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
