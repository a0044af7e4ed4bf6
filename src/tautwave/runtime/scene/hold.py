"""Energy that a scene generates because its efforts are held: monitored, and bounded.

No theorem bounds the energy created by holding the effort of a stiff contact. It is booked sample
by sample: what the network received through its ports by its own account, minus what the devices
delivered at the scene's effort, plus, for a scheme that holds forces, what that created
(`numeric`). It is offset by the least dissipation of the devices' damping, b dx**2 / t, and by the
scene's own losses. The difference is a debt that is never negative: quiet periods earn no credit.
While it stays below an allowance, scene and devices give the hand no more than they received plus
that allowance, whatever the scene is.

An effort that limits or ramps clip is another matter: the network takes it as given, so a hand that
presses beyond the limit pays less than the network stores, and gets nothing as long as it stays
there. A second debt counts the efforts that acted; it is compared after taking off all that the
network still holds.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from tautwave.controller.records import AxisState
from tautwave.scene.ledger import Ledger

STORED_SHARE = 0.25
"""Share of the scene's energy by which `numeric` may oscillate without growth for w T < 1."""


class _Held:
    """One axis: the scene's efforts that acted since its last sample."""

    __slots__ = ("count", "late", "pipe", "position", "recent", "total")

    def __init__(self, delay_periods: int, late: float) -> None:
        self.pipe = deque([0.0] * delay_periods)
        self.late = late
        self.recent = 0.0
        self.total = 0.0
        self.count = 0
        self.position = 0.0

    def pass_slot(self, asked: float) -> None:
        """Book one slot: the effort that acted in it, one command delay after it was computed."""
        self.pipe.append(asked)
        acting = self.pipe.popleft()
        self.total += self.late * self.recent + (1.0 - self.late) * acting
        self.recent = acting
        self.count += 1

    def close(self, position: float) -> tuple[float, float]:
        """Return the energy from the device [J] and dx**2 / slots, since the last sample."""
        moved = position - self.position
        self.position = position
        given = moved * self.total / self.count
        dissipated = moved * moved / self.count
        self.total = 0.0
        self.count = 0
        return given, dissipated


class HoldAccount:
    """The debt of a scene [J].

    Parameters
    ----------
    axes : sequence of AxisState
        Axes of its ports.
    delays : sequence of (int, float)
        Whole periods until a command acts, and the remainder as a share of one.
    dampings : sequence of float
        Lower bound of each device's damping [N s/m or N m s/rad].
    period : float
        T [s].
    allowance : float
        Debt above which the run is stopped [J].
    holds_forces : bool
        The scheme holds forces: `numeric` oscillates with the stored energy.
    """

    def __init__(
        self,
        axes: Sequence[AxisState],
        delays: Sequence[tuple[int, float]],
        dampings: Sequence[float],
        period: float,
        allowance: float,
        *,
        holds_forces: bool = False,
    ) -> None:
        self._axes = axes
        self._delays = delays
        self._rates = [damping / period for damping in dampings]
        self.allowance = allowance
        self._share = STORED_SHARE if holds_forces else 0.0
        self.begin()

    def begin(self) -> None:
        """Start with no debt, the axes at their present positions."""
        self.debt = 0.0
        self.clipped_debt = 0.0
        self._given = self._absorbed()
        self._held = [_Held(periods, late) for periods, late in self._delays]
        for held, axis in zip(self._held, self._axes, strict=True):
            held.position = axis.position
        self._created = 0.0

    def _absorbed(self) -> float:
        """Return what the devices gave, with the efforts that acted [J]."""
        total: float = sum(axis.end.absorbed for axis in self._axes)
        return total

    def overdrawn(self, asked: Sequence[float], slots: int, ledger: Ledger) -> bool:
        """Book a cycle; return whether the scene has created more energy than allowed.

        Parameters
        ----------
        asked : sequence of float
            Resisting efforts [N m or N] of the scene until now.
        slots : int
            Elapsed slots.
        ledger : Ledger
            Ledger of the scene, its ports at the present positions.
        """
        given = 0.0
        dissipated = 0.0
        for axis, held, effort, rate in zip(
            self._axes, self._held, asked, self._rates, strict=True
        ):
            for _ in range(slots):
                held.pass_slot(effort)
            if axis.valid and held.count:
                energy, square = held.close(axis.position)
                given += energy
                dissipated += rate * square
        # Sums since the start on one side, those of this cycle on the other.
        created = ledger.port_work + ledger.numeric - ledger.lost
        gained = created - self._created - dissipated
        self._created = created
        self.debt = max(self.debt + gained - given, 0.0)
        acted = self._absorbed()
        self.clipped_debt = max(self.clipped_debt + gained - (acted - self._given), 0.0)
        self._given = acted
        inside = ledger.kinetic + ledger.stored
        if self.clipped_debt - inside > self.allowance:
            return True
        return self.debt > self.allowance + self._share * inside
