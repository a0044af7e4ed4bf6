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

from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass

from tautwave.controller.records import AxisState
from tautwave_scenes.networks.ledger import Ledger

STORED_SHARE = 0.25
"""Share of the scene's energy by which `numeric` may oscillate without growth for w T < 1."""


@dataclass(slots=True)
class Held:
    """One axis: the scene's efforts that acted since its last sample.

    `rate` is the device's least damping over the period; a command waits `periods` in the pipe,
    from `first` on, and then `late` of one.
    """

    rate: float = 0.0
    late: float = 0.0
    recent: float = 0.0
    total: float = 0.0
    position: float = 0.0
    count: int = 0
    periods: int = 0
    first: int = 0
    head: int = 0


@dataclass(slots=True)
class Debt:
    """Both debts [J], the sums of the last cycle, and what is allowed."""

    debt: float = 0.0
    clipped_debt: float = 0.0
    given: float = 0.0
    created: float = 0.0
    allowance: float = 0.0
    share: float = 0.0


def absorbed(axes: Sequence[AxisState], ports: Sequence[int]) -> float:
    """Return what the devices gave, with the efforts that acted [J]."""
    total = 0.0
    for port in range(len(ports)):
        total += axes[ports[port]].end.absorbed
    return total


def pass_held(h: Held, pipe: MutableSequence[float], asked: float) -> None:
    """Book one slot: the effort that acted in it, one command delay after it was computed."""
    acting = asked
    if h.periods > 0:
        at = h.first + h.head
        acting = pipe[at]
        pipe[at] = asked
        h.head += 1
        if h.head == h.periods:
            h.head = 0
    h.total += h.late * h.recent + (1.0 - h.late) * acting
    h.recent = acting
    h.count += 1


def book_hold(
    a: Debt,
    helds: Sequence[Held],
    pipe: MutableSequence[float],
    axes: Sequence[AxisState],
    ports: Sequence[int],
    asked: Sequence[float],
    slots: int,
    ledger: Sequence[float],
) -> bool:
    """Book a cycle; return whether the scene has created more energy than allowed.

    `ports` are the axes of the ports, `asked` the scene's resisting efforts [N m or N] until now,
    `slots` those that have passed; `ledger` is the scene's, its ports at the present positions.
    """
    given = 0.0
    dissipated = 0.0
    for port in range(len(ports)):
        s = axes[ports[port]]
        h = helds[port]
        for _ in range(slots):
            pass_held(h, pipe, asked[port])
        if s.valid and h.count > 0:
            moved = s.position - h.position
            h.position = s.position
            given += moved * h.total / h.count
            dissipated += h.rate * (moved * moved / h.count)
            h.total = 0.0
            h.count = 0
    # Sums since the start on one side, those of this cycle on the other.
    created = ledger[6] + ledger[5] - ledger[3]  # work of the ports, numeric, lost
    gained = created - a.created - dissipated
    a.created = created
    a.debt = a.debt + gained - given
    if a.debt < 0.0:
        a.debt = 0.0
    acted = absorbed(axes, ports)
    a.clipped_debt = a.clipped_debt + gained - (acted - a.given)
    if a.clipped_debt < 0.0:
        a.clipped_debt = 0.0
    a.given = acted
    inside = ledger[0] + ledger[1]
    if a.clipped_debt - inside > a.allowance:
        return True
    return a.debt > a.allowance + a.share * inside


class HoldAccount:
    """The debt of a scene.

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
        self._ports = range(len(axes))
        self._delays = delays
        self._rates = [damping / period for damping in dampings]
        self.allowance = allowance
        self._share = STORED_SHARE if holds_forces else 0.0
        self.begin()

    def begin(self) -> None:
        """Start with no debt, the axes at their present positions."""
        self.state = Debt(allowance=self.allowance, share=self._share)
        self.state.given = absorbed(self._axes, self._ports)
        self.helds, first = [], 0
        for (periods, late), axis, rate in zip(self._delays, self._axes, self._rates, strict=True):
            held = Held(rate, late, position=axis.position, periods=periods, first=first)
            self.helds.append(held)
            first += periods
        self.pipe = [0.0] * first

    def overdrawn(self, asked: Sequence[float], slots: int, ledger: Ledger) -> bool:
        """Book a cycle; see `book_hold`."""
        return book_hold(
            self.state, self.helds, self.pipe, self._axes, self._ports, asked, slots, ledger
        )
