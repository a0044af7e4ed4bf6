"""A master axis and a slave axis joined by the wave line or by a position coupling.

One `cycle` is: slots that went by, close on both sides, exchange, think on both sides. The two
sides never see each other's present, so the order in which they are evaluated changes no bit.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

from tautwave.laws.coupler import coupler_loss, coupler_stored
from tautwave.laws.wall import wall_effort
from tautwave.laws.wave import filter_step
from tautwave.link.memory import DelayLine
from tautwave.runtime.site import SiteAxis
from tautwave.types import JointState


class PairScale(NamedTuple):
    """How slave units map to master units: x_slave = sign * scale * x_master + offset.

    `power` is the energy of the slave device per energy of the pair (force_scale * scale).
    """

    scale: float
    force_scale: float
    sign: float
    power: float


class WaveFilter:
    """A first-order low-pass on the leaving waves of one side, with its account."""

    __slots__ = ("_gain", "_half_period", "_period", "absorbed", "dissipated", "state", "stored")

    def __init__(self, gain: float, period: float) -> None:
        self._gain = gain
        self._period = period
        self._half_period = 0.5 * period
        self.state = self.absorbed = self.stored = self.dissipated = 0.0

    def step(self, wave: float) -> float:
        """Filter one wave and book it."""
        out, self.stored, lost = filter_step(self._gain, self._period, self.state, wave)
        self.state = out
        self.dissipated += lost
        self.absorbed += self._half_period * (wave * wave - out * out)
        return out


class Pair(ABC):
    """Base of both couplings: what is common to the start and the tracking errors."""

    def __init__(self, name: str, master: SiteAxis, slave: SiteAxis, scale: PairScale) -> None:
        self.name = name
        self.master = master
        self.slave = slave
        self.scale = scale
        self.offset = 0.0
        self.weight = 1.0 / scale.power
        self._slave_to_master = scale.sign / scale.scale
        self._sign = scale.sign
        self._force_scale = scale.force_scale
        self.guard = 0
        self.slot = 0  # of the loop, at engagement; kept up by pairs with a slow side

    def mismatch(self, master_position: float, slave_position: float, offset: float) -> float:
        """Return how far the slave is from where `offset` wants it [slave's rad or m]."""
        target = self.scale.sign * self.scale.scale * master_position + offset
        return slave_position - target

    def start(self, master: JointState, slave: JointState, offset: float | None) -> None:
        """Engage at the measured positions; `offset` None takes the present one."""
        gap = 0.0
        if offset is None:
            self.offset = self.mismatch(master.position, slave.position, 0.0)
        else:
            self.offset = offset
            gap = self.mismatch(master.position, slave.position, offset)
        self.master.start(master.position, master.effort, 0.0)
        self.slave.start(slave.position, slave.effort, gap * self.slave.params.port.root)

    def arm(self, share: float) -> bool:
        """Return True when both walls ask for less than `share` of the limits where they stand."""
        for site in (self.master, self.slave):
            p = site.params
            if p.has_wall and wall_effort(p.wall, site.depth, 0.0) ** 2 > (
                (share * p.limit.effort) ** 2
            ):
                return False
        return True

    @abstractmethod
    def engage(self, ramp: float) -> None:
        """Think for the first time, with nothing on its way yet."""

    @abstractmethod
    def cycle(self, master: JointState, slave: JointState, skipped: int, ramp: float) -> None:
        """Run one cycle on fresh samples; `skipped` slots went by unseen before this one."""

    def position_error(self) -> float:
        """Return master position less the slave's in master units [rad or m]."""
        return self.master.position - self._slave_to_master * (self.slave.position - self.offset)

    def effort_error(self) -> float:
        """Return the sum of both ports' efforts in master units [N m or N]; 0 in equilibrium."""
        slave = self._sign * self.slave.port_effort / self._force_scale
        return self.master.port_effort + slave


class WavePair(Pair):
    """Master and slave on a transmission line.

    Parameters
    ----------
    name : str
        Name of the pair.
    master, slave : SiteAxis
        The two ends.
    scale : PairScale
        Mapping of the slave's units.
    line : DelayLine, optional
        None when there is no delay: the wave closed for the last period is used now.
    filters : tuple of WaveFilter, optional
        Low-pass on the waves leaving master and slave.
    """

    def __init__(
        self,
        name: str,
        master: SiteAxis,
        slave: SiteAxis,
        scale: PairScale,
        line: DelayLine | None,
        filters: tuple[WaveFilter, WaveFilter] | None,
    ) -> None:
        super().__init__(name, master, slave, scale)
        self.line = line
        self.filters = filters

    def cycle(self, master: JointState, slave: JointState, skipped: int, ramp: float) -> None:
        """Run one cycle on fresh samples; `skipped` slots went by unseen before this one."""
        one = self.master
        two = self.slave
        line = self.line
        one.pass_slot()
        two.pass_slot()
        for _ in range(skipped):
            if line is None:
                one.receive(0.0)
                two.receive(0.0)
            else:
                at_master, at_slave = line.exchange(0.0, 0.0)
                one.receive(at_master)
                two.receive(at_slave)
            one.pass_slot()
            two.pass_slot()
        master_valid = one.take(master)
        slave_valid = two.take(slave)
        from_master = one.leaving
        from_slave = two.leaving
        if self.filters is not None:
            from_master = self.filters[0].step(from_master)
            from_slave = self.filters[1].step(from_slave)
        if line is not None:
            at_master, at_slave = line.exchange(from_master, from_slave)
            one.receive(at_master)
            two.receive(at_slave)
        else:
            one.receive(from_slave)
            two.receive(from_master)
        guard = 0
        if master_valid:
            guard = one.think(0.0, 0.0, ramp * one.ceiling)
        elif one.stopping:
            one.fade(ramp * one.ceiling)
        if slave_valid:
            guard += 8 * two.think(0.0, 0.0, ramp * two.ceiling)
        elif two.stopping:
            two.fade(ramp * two.ceiling)
        self.guard = guard

    def engage(self, ramp: float) -> None:
        """Think for the first time, with nothing on the line."""
        for site in (self.master, self.slave):
            site.receive(0.0)
            site.think(0.0, 0.0, ramp * site.ceiling)


class PositionPair(Pair):
    """Master and slave joined by a spring and a damper between delayed positions."""

    def __init__(
        self, name: str, master: SiteAxis, slave: SiteAxis, scale: PairScale, samples: int
    ) -> None:
        super().__init__(name, master, slave, scale)
        self._samples = samples
        self._positions: DelayLine | None = None
        self._velocities: DelayLine | None = None
        self.absorbed = 0.0
        self.stored = 0.0
        self.start_stored = 0.0
        self.dissipated = 0.0
        self._error = 0.0

    def start(self, master: JointState, slave: JointState, offset: float | None) -> None:
        """Engage; what is on the way is the present, at rest."""
        super().start(master, slave, offset)
        if self._samples:
            self._positions = DelayLine(self._samples, 0.0)
            self._positions.fill(master.position, slave.position)
            self._velocities = DelayLine(self._samples, 0.0)
        self.dissipated = 0.0
        self._error = 0.0
        self._book()
        self.start_stored = self.stored
        self.dissipated = 0.0

    def engage(self, ramp: float) -> None:
        """Think for the first time: the far side is where it is."""
        self._think(*self._exchange(), ramp=ramp, master_valid=True, slave_valid=True)

    def _exchange(self) -> tuple[float, float, float, float]:
        """Pass one slot; return far position and velocity at the master, then at the slave."""
        one = self.master
        two = self.slave
        if self._positions is None or self._velocities is None:
            return two.position, two.velocity, one.position, one.velocity
        back, ahead = self._positions.exchange(one.position, two.position)
        back_rate, ahead_rate = self._velocities.exchange(one.velocity, two.velocity)
        return back, back_rate, ahead, ahead_rate

    def _book(self) -> None:
        """Book the spring between the present positions, in pair units."""
        stiffness = self.master.params.stiffness
        absorbed = self.master.port_absorbed + self.weight * self.slave.port_absorbed
        far = self._slave_to_master * (self.slave.position - self.offset)
        error = self.master.position - far
        self.stored = coupler_stored(stiffness, self.master.position, far)
        self.dissipated += coupler_loss(stiffness, absorbed - self.absorbed, self._error, error)
        self.absorbed = absorbed
        self._error = error

    def cycle(self, master: JointState, slave: JointState, skipped: int, ramp: float) -> None:
        """Run one cycle; see `WavePair.cycle`."""
        one = self.master
        two = self.slave
        one.pass_slot()
        two.pass_slot()
        for _ in range(skipped):
            self._exchange()
            one.pass_slot()
            two.pass_slot()
        master_valid = one.take(master)
        slave_valid = two.take(slave)
        self._book()
        self._think(
            *self._exchange(), ramp=ramp, master_valid=master_valid, slave_valid=slave_valid
        )

    def _think(
        self,
        back: float,
        back_rate: float,
        ahead: float,
        ahead_rate: float,
        *,
        ramp: float,
        master_valid: bool,
        slave_valid: bool,
    ) -> None:
        """Think on both sides with what arrived, in each side's own units."""
        one = self.master
        two = self.slave
        ratio = self.scale.sign * self.scale.scale
        guard = 0
        if master_valid:
            far = self._slave_to_master * (back - self.offset)
            guard = one.think(far, self._slave_to_master * back_rate, ramp * one.ceiling)
        elif one.stopping:
            one.fade(ramp * one.ceiling)
        if slave_valid:
            far = ratio * ahead + self.offset
            guard += 8 * two.think(far, ratio * ahead_rate, ramp * two.ceiling)
        elif two.stopping:
            two.fade(ramp * two.ceiling)
        self.guard = guard
