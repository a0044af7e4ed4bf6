"""What holds axes at rest: certified damping, or a brake; each with joules of its own."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.controller.records import AxisParams, AxisState
from tautwave.laws.limit import stop_effort
from tautwave.laws.rest.brake import (
    BrakeParams,
    brake_effort,
    brake_velocity,
    device_takes,
    drag_anchor,
)


class Brake:
    """The brake of one axis."""

    def __init__(self, params: BrakeParams) -> None:
        self.params = params
        self.credit = 0.0
        """[J] What it may give out beyond its capital: its power, and what the device took."""
        self.drop()

    def drop(self) -> None:
        """Let go: it brakes where its next sample is."""
        self._slot = -1
        self._anchor = self._position = self._velocity = 0.0

    def effort(self, slot: int, position: float, divisor: int) -> float:
        """Return the resisting effort [N m or N] after a sample [rad or m] in a slot."""
        p = self.params
        if self._slot < 0:
            self._anchor = self._position = position
        else:
            count = max(1, (slot - self._slot) // divisor)
            moved = position - self._position
            self.credit += device_takes(p, moved, count) + p.power * p.period * count
            self._velocity = brake_velocity(p, self._velocity, moved, count)
            self._anchor = drag_anchor(p, self._anchor, position)
            self._position = position
        self._slot = slot
        return brake_effort(p, self._anchor, self._velocity, position)

    def kept(self) -> float:
        """Return the spring's last effort [N m or N], for a period without a sample."""
        return brake_effort(self.params, self._anchor, 0.0, self._position)


class Holds:
    """What holds axes at rest.

    Parameters
    ----------
    params : sequence of AxisParams
        Constants of the axes.
    quanta : sequence of float
        Their encoder steps [rad or m].
    brakes : sequence
        Constants of their brakes; None, or no entry, where there is damping only.
    """

    def __init__(
        self,
        params: Sequence[AxisParams],
        quanta: Sequence[float],
        brakes: Sequence[BrakeParams | None] = (),
    ) -> None:
        brakes = brakes or [None] * len(params)
        self._brakes = [None if one is None else Brake(one) for one in brakes]
        self._damping = [damping_capital(p, q) for p, q in zip(params, quanta, strict=True)]
        # The last command of before acts for as many closings after the first; a late share of it
        # acts in one more.
        self._acts = [p.delay + (p.late > 0.0) for p in params]
        self.renew()

    def renew(self) -> None:
        """Count what the axes supply from 0; what a brake holds it holds on."""
        self._until = [-1] * len(self._acts)
        self._closed = [-1] * len(self._acts)
        self._floor = [0.0] * len(self._acts)
        self._braked = [False] * len(self._acts)
        self._spent = [False] * len(self._acts)
        self.news: list[int] = []
        """Axes whose brakes have just supplied what they may; they are damped only from then on."""
        for one in self._brakes:
            if one is not None:
                one.credit = 0.0

    def release(self, which: int) -> None:
        """Take note that something else, or nothing, acts on an axis."""
        brake = self._brakes[which]
        if brake is not None:
            brake.drop()

    def granted(self, which: int) -> float:
        """Return what may have been supplied to an axis since the beginning [J]."""
        brake = self._brakes[which]
        if brake is None or not self._braked[which]:
            return self._damping[which]
        braked = brake.params.capital + brake.params.reserve + brake.credit
        return braked + (self._damping[which] if self._spent[which] else 0.0)

    def granted_to_all(self) -> float:
        """Return what may have been supplied to all of them since the beginning [J]."""
        return sum(self.granted(which) for which in range(len(self._acts)))

    def effort(
        self,
        which: int,
        slot: int,
        s: AxisState,
        p: AxisParams,
        *,
        valid: bool = True,
        braked: bool = True,
    ) -> float:
        """Return the resisting effort of an axis [N m or N], none once it supplied what it may.

        `braked`: by its brake, if it has one, and not by damping only. Without a `valid` sample a
        brake keeps its spring's effort for up to `p.blind` periods. What commands of before the
        hold still give out was granted to them: joules count from there, else a hold that follows
        a push would not damp.
        """
        brake = None if self._spent[which] else self._brakes[which]
        if brake is not None and not braked:
            brake.drop()
            brake = None
        if not valid and brake is not None and s.count >= p.blind:
            brake.drop()
        if not valid:
            return 0.0 if brake is None else brake.kept()
        if self._until[which] < 0:
            self._until[which] = slot + self._acts[which]
        if self._closed[which] < self._until[which]:
            self._floor[which] = min(self._floor[which], s.port_energy)
        self._closed[which] = slot
        if brake is not None:
            self._braked[which] = True
            wanted = brake.effort(slot, s.position, p.divisor)
            granted = self.granted(which)
            if s.port_energy >= self._floor[which] - granted:
                return wanted
            brake.drop()
            self._spent[which] = True
            self._floor[which] = s.port_energy + granted  # damping has joules of its own
            self.news.append(which)
        gone = s.port_energy < self._floor[which] - self.granted(which)
        return 0.0 if gone else stop_effort(p.site.limit, s.velocity)


def damping_capital(p: AxisParams, quantum: float) -> float:
    """Return what a damped hold may supply [J]: ten encoder steps against its own damping."""
    per_step = p.site.limit.stop_damping * p.site.gain / p.site.period
    return 10.0 * per_step * quantum * quantum


def spent_sentence(axis: str) -> str:
    """Say that an axis' brake has supplied what it may."""
    return f"{axis}: its brake has supplied all it may; samples were lost, or the host stalled"
