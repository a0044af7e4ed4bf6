"""What holds axes at rest: certified damping, or a brake; each with a capital of energy."""

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
        self.begin()

    def begin(self) -> None:
        """Brake where the next sample is."""
        self._slot = -1
        self._anchor = self._position = self._velocity = 0.0
        self._taken = 0.0

    def effort(self, slot: int, position: float, divisor: int) -> float:
        """Return the resisting effort [N m or N] after a sample [rad or m] in a slot."""
        p = self.params
        if self._slot < 0:
            self._anchor = self._position = position
            self._slot = slot
        elif slot > self._slot:
            count = max(1, (slot - self._slot) // divisor)
            moved = position - self._position
            self._taken += device_takes(p, moved, count) + p.power * p.period * count
            self._velocity = brake_velocity(p, self._velocity, moved, count)
            self._anchor = drag_anchor(p, self._anchor, position)
            self._position, self._slot = position, slot
        return brake_effort(p, self._anchor, self._velocity, position)

    @property
    def credit(self) -> float:
        """What it may give out beyond its capital: its power, and what the device took [J]."""
        return self._taken


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
        self._capital = [
            damping_capital(p, q) if one is None else one.capital
            for p, q, one in zip(params, quanta, brakes, strict=True)
        ]
        self.reserve = [0.0 if one is None else one.reserve for one in brakes]
        """[J] What an axis may get beyond that if the host stalls."""
        # The last command of before acts for as many closings after the first; a late share of it
        # acts in one more.
        self._acts = [p.delay + (p.late > 0.0) for p in params]
        self.begin()

    def begin(self) -> None:
        """Count what the axes supply, from 0; brakes brake where the axes are then."""
        self._until = [-1] * len(self._acts)
        self._closed = [-1] * len(self._acts)
        self._floor = [0.0] * len(self._acts)
        for one in self._brakes:
            if one is not None:
                one.begin()

    def granted(self, which: int) -> float:
        """Return what may have been supplied to an axis since the beginning [J]."""
        brake = self._brakes[which]
        return self._capital[which] + (0.0 if brake is None else brake.credit)

    def granted_to_all(self) -> float:
        """Return what may have been supplied to all of them since the beginning [J]."""
        return sum(self.granted(which) for which in range(len(self._capital)))

    def effort(
        self, which: int, slot: int, s: AxisState, p: AxisParams, *, braked: bool = True
    ) -> float:
        """Return the resisting effort of an axis [N m or N], none once it supplied what it may.

        `braked`: by its brake, if it has one, and not by damping only.
        What commands of before the hold still give out was granted to them: the capital counts
        from there, else a hold that follows a push would not damp.
        """
        if self._until[which] < 0:
            self._until[which] = slot + self._acts[which]
        if self._closed[which] < self._until[which]:
            self._floor[which] = min(self._floor[which], s.port_energy)
        self._closed[which] = slot
        brake = self._brakes[which] if braked else None
        if brake is None:
            wanted = stop_effort(p.site.limit, s.velocity)
        else:
            wanted = brake.effort(slot, s.position, p.divisor)
        return 0.0 if s.port_energy < self._floor[which] - self.granted(which) else wanted


def damping_capital(p: AxisParams, quantum: float) -> float:
    """Return what a damped hold may supply [J]: ten encoder steps against its own damping."""
    per_step = p.site.limit.stop_damping * p.site.gain / p.site.period
    return 10.0 * per_step * quantum * quantum
