"""What carries the loads of a side: efforts beside the controller's, and their books.

The effort of an axis holds its load half-way through the period in which it will act. Every
period's energy is taken from the displacement measured and the effort that acted; beside it stands
the change of the load's potential, and `leak` is what is between them.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from tautwave.columns import Column, names, under
from tautwave.contracts import Row
from tautwave.laws.limit import clamp, truncate
from tautwave.runtime.carrying.felt import FeltLoad, Weighing
from tautwave.types import UNDO_PAYLOAD

LOAD = (
    Column("effort", "N m, N", "sent beside the coupling's, along the position"),
    Column("energy", "J", "absorbed by it from the device; negative: supplied"),
)
"""What is recorded of an axis whose load is carried: `load.SIDE.AXIS.name`."""
LOADS = (
    Column("potential", "J", "what the loads of a side or arm hold more than at the start"),
    Column("leak", "J", "all of that energy with the potential's change"),
    Column("given", "J", "most that was given at any time beyond the potential"),
)
"""What is recorded of all loads of a side or arm: `load.ARM.name`."""
CHANGED = Column("changed", "J", "put into the potential by payload changes and felt ramps")
"""Where they change in the run, too."""


class CarriedAxis(NamedTuple):
    """One axis whose load is carried.

    `reserve` is the greatest effort for it [N m or N], `step` its greatest change per period,
    `quantum` the drive's step; `delay` the command's, in whole periods, and `late` the remainder
    as a share of one. Below `still` [rad or m per period] it stands.
    """

    name: str
    reserve: float
    step: float
    quantum: float
    delay: int
    late: float
    still: float = 0.0


class SideLoad:
    """The loads of one side, or of one of its several arms; a row source.

    Parameters
    ----------
    name : str
        `master` or `slave` or, of several arms, the arm's full name.
    axes : sequence of CarriedAxis
        From base to tip if there is a chain.
    weigh : Weighing
        What they weigh, the gradient of its potential.
    others : mapping of str to Weighing
        What they weigh with other payloads.
    ramp : int
        Periods in which another payload is taken up.
    back : int
        Periods in which a change is undone.
    felt : FeltLoad, optional
        What the hand feels of the other side's, weighed at the same positions.
    """

    def __init__(
        self,
        name: str,
        axes: Sequence[CarriedAxis],
        weigh: Weighing,
        others: Mapping[str, Weighing] | None = None,
        ramp: int = 1,
        back: int = 1,
        felt: FeltLoad | None = None,
    ) -> None:
        self.name = name
        self._arm = f"arm {name}" if "." in name else f"the {name}'s arm"
        self.axes = axes
        self.others = others or {}
        self._loads = self._before = weigh
        self._felt = felt
        self._take, self._undo = ramp, back
        self._ramp = ramp
        self._left = 0  # of the ramp's periods, while a payload is taken up or undone
        self._returns = False
        self._changed = 0.0
        count = len(axes)
        self._known = [False] * count
        self._x = [0.0] * count
        self._stride = [0.0] * count  # per period
        self._effort = [0.0] * count
        self._waiting = [deque([0.0] * axis.delay) for axis in axes]
        self._acted = [0.0] * count
        self._sum = [0.0] * count
        self._slots = [0] * count
        self._energy = [0.0] * count
        self._start: float | None = None
        self._potential = 0.0
        self._least = 0.0
        self._stale = True
        self._resting: set[int] = set()
        self._leak = 0.0  # as of the last update
        self.columns = [
            column for axis in axes for column in names(under(f"load.{axis.name}", LOAD))
        ]
        self.columns += names(under(f"load.{name}", LOADS))
        self._changes = bool(self.others) or (felt is not None and felt.lets_go)
        if self._changes:
            self.columns.append(f"load.{name}.{CHANGED.name}")

    def drop(self, which: int) -> None:
        """Reset an axis' place and effort: its device is opened, perhaps again."""
        self._known[which] = False
        self._stride[which] = self._effort[which] = 0.0
        self._waiting[which] = deque([0.0] * self.axes[which].delay)
        self._acted[which] = self._sum[which] = 0.0
        self._slots[which] = 0
        self._start = None
        self._resting.discard(which)
        if self._felt is not None:
            self._felt.drop()

    def pass_slots(self, which: int, slots: int) -> None:
        """File the effort that acted in each of the slots that went by."""
        axis = self.axes[which]
        for _ in range(slots):
            effort = self._effort[which]
            waiting = self._waiting[which]
            if axis.delay:
                waiting.append(effort)
                effort = waiting.popleft()
            before = self._acted[which]
            self._acted[which] = effort
            self._sum[which] += axis.late * before + (1.0 - axis.late) * effort
            self._slots[which] += 1
        self._stale = True

    def take(self, which: int, position: float) -> None:
        """Close all periods since the last sample of an axis with a new one [rad or m]."""
        slots = self._slots[which]
        if self._known[which] and slots:
            moved = position - self._x[which]
            self._energy[which] -= self._sum[which] / slots * moved
            self._stride[which] = moved / slots
        self._known[which] = True
        self._x[which] = position
        self._sum[which] = 0.0
        self._slots[which] = 0

    def effort(self, which: int) -> float:
        """Return the effort that carries an axis' load in the period to come [N m or N]."""
        if self._stale:
            self._stale = False
            if all(self._known):
                self._update()
        self._resting.discard(which)
        return self._effort[which]

    def take_up(self, payload: str) -> str:
        """Weigh with another payload from now on, over the ramp; return why not, or ''."""
        if payload == UNDO_PAYLOAD:
            return self._return()
        if payload not in self.others:
            return f"unknown; choose one of {', '.join(self.others)}"
        if not all(self._known):
            return f"the position of {self._arm} is not known yet"
        if self._left:
            return "the previous payload is still being applied"
        if any(abs(s) > axis.still for s, axis in zip(self._stride, self.axes, strict=True)):
            undo = f", or give `payload {self.name} {UNDO_PAYLOAD}` to undo the last change"
            back = undo if self._returns else ""
            return f"{self._arm} is moving; keep it still{back}"
        self._before, self._loads = self._loads, self.others[payload]
        self._left = self._ramp = self._take
        self._returns = True
        return ""

    def _return(self) -> str:
        """Undo the last change, at any speed and from within its ramp: a wrong one moves the arm.

        What it puts into the potential is booked as with any change, wherever the arm is.
        """
        if not self._returns:
            return "there is no change to undo"
        self._before, self._loads = self._loads, self._before
        self._left = math.ceil((1.0 - self._left / self._ramp) * self._undo)
        self._ramp = self._undo
        self._returns = False
        return ""

    def engage(self, offsets: Mapping[str, float]) -> None:
        """Let the hand feel the other side's loads at these offsets, by pair [slave's rad or m]."""
        if self._felt is not None:
            self._felt.engage(offsets)

    def disengage(self) -> None:
        """Let the hand feel no more of the other side's loads."""
        if self._felt is not None:
            self._felt.disengage()

    def _weigh(self, x: Sequence[float]) -> tuple[list[float], float]:
        """Return what holds the loads at `x`, and their potential; linear in what they weigh."""
        efforts, height = self._loads(x)
        if self._left:
            share = self._left / self._ramp
            before, lower = self._before(x)
            efforts = [b + share * (a - b) for a, b in zip(before, efforts, strict=True)]
            height += share * (lower - height)
        if self._felt is not None:
            height += self._felt.add(x, efforts)
        return efforts, height

    def rest(self, which: int) -> None:
        """Note that nothing is sent to an axis: it gets its safe command."""
        self._effort[which] = 0.0
        self._resting.add(which)

    def _update(self) -> None:
        axes = self.axes
        felt = self._felt if self._felt is not None and self._felt.changing else None
        if self._left or felt is not None:
            _, before = self._weigh(self._x)
            self._left = max(self._left - 1, 0)
            if felt is not None:
                felt.advance()
            self._changed += self._weigh(self._x)[1] - before
        wanted, _ = self._weigh(
            [
                x + stride * (0.5 + axis.delay + axis.late)
                for x, stride, axis in zip(self._x, self._stride, axes, strict=True)
            ]
        )
        for which, axis in enumerate(axes):
            last = self._effort[which]
            change = clamp(clamp(wanted[which], axis.reserve) - last, axis.step)
            effort = truncate(last + change, axis.quantum)
            self._effort[which] = 0.0 if which in self._resting else effort
        _, potential = self._weigh(self._x)
        if self._start is None:
            # What moved while the devices were reset is no work of theirs.
            self._start = potential - self._changed - self._potential
        elif self._resting:
            # Nor what moved while one of them got no effort, and may have fallen.
            self._start = potential - self._changed + sum(self._energy) - self._leak
        self._potential = potential - self._start - self._changed
        self._leak = self.leak
        self._least = min(self._least, self._leak)

    @property
    def leak(self) -> float:
        """Energy taken out of the devices beyond the loads' potential [J]; below 0: given."""
        return sum(self._energy) + self._potential

    def fill(self, row: Row, at: int) -> None:
        """Write efforts, energies, potential, leak and the most that was given."""
        for effort, energy in zip(self._effort, self._energy, strict=True):
            row[at] = effort
            row[at + 1] = energy
            at += 2
        row[at] = self._potential
        row[at + 1] = self.leak
        row[at + 2] = -self._least
        if self._changes:
            row[at + 3] = self._changed


def take_payload(loads: Sequence[SideLoad], argument: str) -> tuple[str, bool]:
    """Do what the command `payload` asks for: return what to note, and whether it was refused.

    `argument` is the payload's name; that of its arm comes before it, and may be left out where no
    other has payloads. What is noted has it wherever another has.
    """
    sides = {side.name: side for side in loads if side.others}
    if not sides:
        return "payload: no arm in the rig defines `payloads`", True
    first, _, payload = argument.partition(" ")
    if not payload and len(sides) == 1:
        first, payload = next(iter(sides)), argument
    payload = payload.strip()
    if first not in sides:
        what = "arm" if any("." in name for name in sides) else "side"
        return f"payload: state the {what}, {' or '.join(sides)} (got {first[:40]!r})", True
    why = sides[first].take_up(payload)
    note = payload if len(sides) == 1 else f"{first} {payload}"
    return (f"payload {note[:60]!r}: {why}", True) if why else (note, False)
