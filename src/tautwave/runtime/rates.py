"""Pairs with a slow side: its bus is served every n-th slot, the line every slot.

At slot j n the bus is asked, at slot j n + n - 1 its answer is there: the port closes, takes the
mean of the waves of the last n slots, thinks, and its leaving wave is held for the n slots from
there on. What it decides goes out with the next request.
"""

from __future__ import annotations

from tautwave.laws.conversion import gather_wave, hand_over
from tautwave.link.memory import DelayLine
from tautwave.runtime.pair import PairScale, WaveFilter, WavePair
from tautwave.runtime.site import SiteAxis
from tautwave.types import JointState


class RateConverter:
    """Both directions between line and slow port, with their account.

    Parameters
    ----------
    divisor : int
        n, the slots per period of the port.
    period : float
        Period T of the line [s].

    Attributes
    ----------
    absorbed, stored, dissipated : float
        Energy that went in less what came out, that is under way, and that was lost [J].
    """

    __slots__ = (
        "_count", "_half_period", "_held", "_left", "_mean", "absorbed", "dissipated", "divisor",
    )  # fmt: skip

    def __init__(self, divisor: int, period: float) -> None:
        self.divisor = divisor
        self._half_period = 0.5 * period
        self.reset()

    def reset(self) -> None:
        """Begin with nothing under way and nothing booked."""
        self._held = self._mean = 0.0
        self._left = self._count = 0
        self.absorbed = self.dissipated = 0.0

    @property
    def stored(self) -> float:
        """Energy under way [J]: what is still to be given, and the block so far."""
        held = self._left * self._held * self._held
        return self._half_period * (held + self._count * self._mean * self._mean)

    def load(self, wave: float) -> None:
        """Take the wave that leaves the slow port, to give it away over n slots."""
        half = self._half_period
        # Nothing is left but when the port closes out of turn.
        self.dissipated += half * self._left * self._held * self._held
        self._held = wave
        self._left = self.divisor
        self.absorbed += half * self.divisor * wave * wave

    def give(self) -> float:
        """Return the wave of this slot for the line."""
        if self._left == 0:
            return 0.0
        self._left -= 1
        self.absorbed -= self._half_period * self._held * self._held
        return self._held

    def take(self, wave: float) -> None:
        """Take the wave that the line delivers in this slot."""
        half = self._half_period
        self._mean, lost = gather_wave(self._count, self._mean, wave)
        self._count += 1
        self.absorbed += half * wave * wave
        self.dissipated += half * lost

    def hand_over(self) -> float:
        """Return the wave for the slow port, and begin a new block."""
        half = self._half_period
        wave, lost = hand_over(self.divisor, self._count, self._mean)
        self.dissipated += half * lost
        self.absorbed -= half * self.divisor * wave * wave
        self._mean = 0.0
        self._count = 0
        return wave


class MultiratePair(WavePair):
    """A wave pair of which one side, or both, are served every n-th slot; see `WavePair`.

    Parameters
    ----------
    converters : tuple of RateConverter, optional each
        At the master and at the slave; None where that side is served every slot.
    """

    def __init__(
        self,
        name: str,
        master: SiteAxis,
        slave: SiteAxis,
        scale: PairScale,
        line: DelayLine | None,
        filters: tuple[WaveFilter, WaveFilter] | None,
        converters: tuple[RateConverter | None, RateConverter | None],
    ) -> None:
        super().__init__(name, master, slave, scale, line, filters)
        self.converters = converters

    def start(self, master: JointState, slave: JointState, offset: float | None) -> None:
        """Engage at the measured positions, with nothing under way."""
        super().start(master, slave, offset)
        for converter in self.converters:
            if converter is not None:
                converter.reset()

    def engage(self, ramp: float) -> None:
        """Think for the first time; a slow side does so when it is served next."""
        for site, converter in zip((self.master, self.slave), self.converters, strict=True):
            site.receive(0.0)
            if converter is None:
                site.think(0.0, 0.0, ramp * site.ceiling)

    def cycle(self, master: JointState, slave: JointState, skipped: int, ramp: float) -> None:
        """Run one cycle; the sample of a slow side is looked at in the slots where it is due."""
        for _ in range(skipped):
            self._pass(None, None)
        due = self._pass(master, slave)
        guard = 0
        for place, site, state in ((0, self.master, master), (1, self.slave, slave)):
            if not due[place]:
                continue
            if state.valid:
                guard += (8 if place else 1) * site.think(0.0, 0.0, ramp * site.ceiling)
            elif site.stopping:
                site.fade(ramp * site.ceiling)
        self.guard = guard

    def _pass(self, master: JointState | None, slave: JointState | None) -> tuple[bool, bool]:
        """Pass one slot up to `receive`; None: the loop did not see it. Return who is due."""
        self.slot += 1
        sites = (self.master, self.slave)
        due = tuple(c is None or self.slot % c.divisor == c.divisor - 1 for c in self.converters)
        leaving = [0.0, 0.0]
        for place, state in ((0, master), (1, slave)):
            site, converter = sites[place], self.converters[place]
            if due[place]:
                site.pass_slot()
                if state is None:
                    # Nobody closed: as without a converter, nothing leaves.
                    if converter is not None:
                        site.miss()
                else:
                    site.take(state)
            if converter is not None:
                if due[place]:
                    converter.load(site.leaving)
                leaving[place] = converter.give()
            elif state is not None:
                leaving[place] = site.leaving
            else:
                continue
            if self.filters is not None:
                leaving[place] = self.filters[place].step(leaving[place])
        line = self.line
        arriving = (leaving[1], leaving[0]) if line is None else line.exchange(*leaving)
        for site, converter, wave, now in zip(sites, self.converters, arriving, due, strict=True):
            if converter is None:
                site.receive(wave)
                continue
            converter.take(wave)
            if now:
                site.receive(converter.hand_over())
        return due[0], due[1]
