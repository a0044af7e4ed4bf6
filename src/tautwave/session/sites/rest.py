"""A slave between two sessions: brought into place, or held by certified damping."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

from tautwave.columns import ACCOUNT
from tautwave.contracts import Row
from tautwave.controller.run import stop_on_guard
from tautwave.laws.limit import guard_axis
from tautwave.laws.rest.alignment import align_budget
from tautwave.laws.rest.brake import BrakeParams
from tautwave.link.columns import ALIGNED
from tautwave.runtime.control import CoupledControl
from tautwave.runtime.operate.rest.aligning import PATIENCE_S
from tautwave.runtime.operate.rest.axis import resting, send_resting, sense_resting
from tautwave.runtime.operate.rest.holds import Holds
from tautwave.runtime.operate.rest.pull import Pull, PullParams


class Approach(NamedTuple):
    """What brings slaves into place.

    `pulls` by pair, of those that can be; `quanta` [rad or m] are the axes' encoder steps, `brakes`
    what brakes them at rest; `offsets` the pairs whose rig gives one; `tolerances` [rad or m,
    slave] by pair how far from its place it may begin.
    """

    pulls: Mapping[int, PullParams]
    quanta: Sequence[float]
    brakes: Sequence[BrakeParams | None]
    offsets: Collection[str]
    tolerances: Sequence[float]


class Rest:
    """The axes of a site while no coupling holds them.

    Parameters
    ----------
    control : CoupledControl
        Whose axes they are.
    own : sequence of int
        Places of this site's axes, by pair.
    approach : Approach
        Constants.
    """

    def __init__(self, control: CoupledControl, own: Sequence[int], approach: Approach) -> None:
        self._control = control
        self._own = own
        self._approach = approach
        self._params = [resting(p) for p in control.params]
        self.holds = Holds(control.params, approach.quanta, approach.brakes)
        self._latency = max((control.params[i].delay for i in own), default=0) + 2
        self._pulls: dict[int, Pull] = {}
        self._limit = self._let_go = 0
        self._beyond = False
        self._seated: dict[int, bool] = {}
        self._granted = [0.0] * len(own)
        self.hindrance = ""
        self._resting = False
        self._taken = [0.0] * len(own)
        self.free = False
        """Whether nothing holds the axes."""

    def begin(self, *, seated: bool) -> None:
        """Begin to rest: to hold; `seated`: the axes have been measured before."""
        self.anew()
        self._seated = dict.fromkeys(self._own, seated)

    def anew(self) -> None:
        """Count what the motors take from 0 on; axes stay seated, and held where they are."""
        self.release()
        self._resting = True
        self._granted = self.granted
        self.holds.renew()
        for i in self._own:
            s = self._control.axes[i]
            s.port_energy = s.gross_flow = s.uncertainty = 0.0

    @property
    def granted(self) -> list[float]:
        """What all alignments and holds so far might supply, by pair [J]."""
        own = zip(self._granted, self._own, strict=True)
        return [already + self.holds.granted(i) for already, i in own]

    def unseat(self) -> None:
        """Mark the axes as not measured: their devices were enabled anew."""
        self._seated = dict.fromkeys(self._own, False)
        for i in self._own:
            self.holds.release(i)

    def aim(self, targets: Mapping[int, float], slot: int) -> None:
        """Bring the slaves of some pairs to their places [rad or m], or on to other ones.

        None is moved while one has a place that its range does not reach.
        """
        self._let_go = 0
        if self._beyond:
            self._beyond, self.hindrance = False, ""
        for k, target in targets.items():
            why = self._approach.pulls[k].refusal(target)
            if why:
                name = self._control.pair_names[k]
                self.release()
                self._beyond, self.hindrance = True, f"slave {name} not aligned: {why}"
                return
        slots = 0.0
        for k, target in targets.items():
            params = self._approach.pulls[k]
            pull = self._pulls.get(k)
            if pull is None:
                here = self._control.axes[self._own[k]].position
                spent = -self._control.axes[self._own[k]].port_energy
                self._pulls[k] = pull = Pull(params, here, here, spent)
                self._grant(k, 0.0, begins=True)
            self._grant(k, target - pull.target)
            pull.target = target
            law = params.law
            way_s = math.fabs(target - pull.reference) / law.speed + law.speed / law.acceleration
            slots = max(slots, way_s * self._slots_per_s)
        self._limit = slot + round(2.0 * slots + PATIENCE_S * self._slots_per_s)

    def _grant(self, k: int, gap: float, *, begins: bool = False) -> None:
        """Add to a pull's budget what `gap` [rad or m] more may take."""
        params = self._approach.pulls[k]
        friction = params.coulomb, params.viscous, params.inertia
        joules = align_budget(params.law, gap, *friction)
        if not begins:
            joules -= align_budget(params.law, 0.0, *friction)
        self._pulls[k].budget += joules
        self._granted[k] += joules

    def release(self) -> None:
        """Pull no more: hold."""
        self._pulls.clear()
        self._let_go = 0
        self._beyond = False

    def sense(self, slot: int, skipped: int) -> None:
        """Close the slots that went by with the sample of this one; stop outside the limits."""
        control = self._control
        for i in self._own:
            s, p, m = control.axes[i], self._params[i], control.samples[i]
            seated = self._seated[i]
            self._seated[i] = sense_resting(s, p, m, control.table, skipped, seated)
            s.guard = guard_axis(p.site.limit, s.position, s.velocity) if s.valid else 0
            stop_on_guard(control.run, control.state, control.axes, slot, i)

    def arrived(self, slot: int) -> bool:
        """Go on; return whether all are in place, and no command of before acts."""
        axes = self._control.axes
        far = [k for k, pull in self._pulls.items() if not pull.there(axes[self._own[k]])]
        if self._beyond:
            return False
        if self._let_go:
            gone = all(axes[i].total == 0.0 for i in self._own)
            return gone and slot - self._let_go >= self._latency
        if not far:
            self._let_go = slot
        elif slot > self._limit:
            why = self._pulls[far[0]].hindrance(axes[self._own[far[0]]])
            names = ", ".join(self._control.pair_names[k] for k in far)
            self.hindrance = f"slave {names} not aligned: {why}"
            targets = {k: pull.target for k, pull in self._pulls.items()}
            self.release()
            self.aim(targets, slot)  # again, with a budget of its own
        return False

    def send(self, slot: int) -> None:
        """Send each axis its effort of the next period."""
        control = self._control
        ending = control.stopped or control.state.end < control.run.cycles
        share = min(1.0, (control.state.end - slot) / max(1, control.run.release_cycles))
        for k, i in enumerate(self._own):
            s, p, valid = control.axes[i], self._params[i], control.samples[i].valid
            pull = None if ending else self._pulls.get(k)
            effort = 0.0
            if self.free or self._let_go or i in control.dead:
                self.holds.release(i)
            elif pull is not None:
                self.holds.release(i)
                effort = pull.effort(s) if valid else 0.0
            else:
                effort = self.holds.effort(i, slot, s, p, valid=valid)
            ceiling = share * control.params[i].ceiling
            send_resting(s, p, effort, ceiling, pushes=pull is not None)

    def end(self) -> None:
        """Rest no more; what the motors took is kept."""
        for k in range(len(self._own)):
            self._taken[k] += self._taking(k) if self._resting else 0.0
        self._resting = False

    def columns(self, side: str) -> list[str]:
        """Return the names of what `fill` writes at a side: the books of what the motors took."""
        names = self._control.pair_names
        return [f"{name}.{ALIGNED[side]}.{part}" for name in names for part in ACCOUNT]

    def fill(self, row: Row, at: int) -> None:
        """Write the books' columns at index `at`."""
        for k in range(len(self._own)):
            taken = self._taken[k] + (self._taking(k) if self._resting else 0.0)
            row[at], row[at + 1], row[at + 2] = taken, 0.0, taken
            at += len(ACCOUNT)

    def _taking(self, k: int) -> float:
        """Return what the motor of a pair took out of its device since it rests [J, master]."""
        i = self._own[k]
        return self._params[i].weight * self._control.axes[i].port_energy

    @property
    def _slots_per_s(self) -> float:
        return 1e9 / self._control.run.period_ns
