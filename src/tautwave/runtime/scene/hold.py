"""What a scene gives out beyond what it got, because its efforts are held: watched, and bounded.

No theorem bounds what holding the effort of a stiff contact creates. It is booked sample by
sample: what the network says it got through its ports, less what the devices gave at the effort it
asked for, and with a scheme that holds forces what that made (`numeric`). Against it stand what the
devices' own damping takes at least, b dx**2 / t, and what the scene loses itself. The difference is
a debt that is never negative: calm times earn no credit. While it stays below an allowance, scene
and devices give the hand no more than they got and that allowance, whatever the scene is.

Limits and ramps are left out of it: an effort that they cut off is one the device does not get.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from tautwave.controller.records import AxisState
from tautwave.scene.ledger import Ledger

STORED_SHARE = 0.25
"""Of the scene's energy: by so much may `numeric` swing without any growth where w T < 1."""


class _Held:
    """One axis: the efforts asked for that acted since its last sample."""

    __slots__ = ("count", "late", "pipe", "position", "recent", "total")

    def __init__(self, delay_periods: int, late: float) -> None:
        self.pipe = deque([0.0] * delay_periods)
        self.late = late
        self.recent = 0.0
        self.total = 0.0
        self.count = 0
        self.position = 0.0

    def pass_slot(self, asked: float) -> None:
        """One slot went by: an effort acted in it, the command delay behind what is asked."""
        self.pipe.append(asked)
        acting = self.pipe.popleft()
        self.total += self.late * self.recent + (1.0 - self.late) * acting
        self.recent = acting
        self.count += 1

    def close(self, position: float) -> tuple[float, float]:
        """Return the energy that the device gave [J] and dx**2 / slots, since the last sample."""
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
        Of its ports.
    delays : sequence of (int, float)
        Whole periods until a command acts, and the rest as a share of one.
    dampings : sequence of float
        What each device's damping is at least [N s/m or N m s/rad].
    period : float
        T [s].
    allowance : float
        Debt above which a run is to be stopped [J].
    holds_forces : bool
        The scheme holds forces: `numeric` swings with what is stored.
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
        """Start with no debt, the axes where they are."""
        self.debt = 0.0
        self._held = [_Held(periods, late) for periods, late in self._delays]
        for held, axis in zip(self._held, self._axes, strict=True):
            held.position = axis.position
        self._created = 0.0

    def overdrawn(self, asked: Sequence[float], slots: int, ledger: Ledger) -> bool:
        """Book a cycle; return whether the scene has created more than can be answered for.

        Parameters
        ----------
        asked : sequence of float
            Resisting efforts [N m or N] that the scene asked for until now.
        slots : int
            That went by.
        ledger : Ledger
            Of the scene, its ports where the devices are now.
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
        self.debt = max(self.debt + (created - self._created) - given - dissipated, 0.0)
        self._created = created
        return self.debt > self.allowance + self._share * (ledger.kinetic + ledger.stored)
