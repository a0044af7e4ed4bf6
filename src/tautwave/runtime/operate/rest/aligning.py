"""The way into an engagement: slaves are brought into place, then everything lets go and stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from tautwave.controller.axis import is_balanced, is_calm
from tautwave.controller.records import AxisParams, AxisState, PairParams
from tautwave.controller.stops import AxisName, unbalanced_sentence
from tautwave.laws.rest.alignment import align_budget
from tautwave.runtime.operate.rest.pull import Pull, PullParams, is_still

REST_SPEED = 0.05
"""[rad/s or m/s] Slower than that an axis stands, and the pairs may engage."""

REST_S = 0.1
PATIENCE_S = 5.0
"""Beyond the time that the way takes, after which an alignment is blocked."""

MAX_WAYS = 5
"""Ways that slaves go in one alignment, each with a budget, while their masters move on."""


class Alignment:
    """One way into an engagement after another.

    Parameters
    ----------
    axes : sequence of AxisState
        The axes, as the controller has them.
    pairs : sequence of PairParams
        Constants of the pairs.
    params : mapping
        By pair, of those with an offset of their own.
    quanta : sequence of float
        Encoder steps of the axes [rad or m].
    period_ns : int
        One slot.
    """

    def __init__(
        self,
        axes: Sequence[AxisState],
        pairs: Sequence[PairParams],
        params: Mapping[int, PullParams],
        quanta: Sequence[float],
        period_ns: int,
    ) -> None:
        self._axes, self.pairs, self._params, self._quanta = axes, pairs, params, quanta
        self._period_s = period_ns * 1e-9
        self._span = max(1, round(REST_S / self._period_s))
        self._since = [0.0] * len(axes)
        self._still_from = self._began = self._limit = self._ways = 0
        self.pulls: dict[int, Pull] = {}
        self._refused: dict[int, str] = {}
        self.keep_offset = self._moving = False
        self.let_go = 0
        self.granted = 0.0
        """[J] What all alignments so far might supply together."""

    def begin(self, slot: int, *, keep_offset: bool, moving: bool = False) -> None:
        """Begin in this slot; with `keep_offset` nothing has to be brought into place.

        `moving`: nor does anything have to stand; an engagement is only interrupted.
        """
        self.clear()
        self._moving = moving
        self.keep_offset = keep_offset
        self._began = slot
        self._limit = self._ways = 0

    def clear(self) -> None:
        """Stop pulling."""
        self.pulls = {}
        self.let_go = 0

    def start(self, slot: int) -> None:
        """Once all axes are measured, begin the pulls that are needed.

        None begins while one slave has a place that its range does not reach.
        """
        if self._limit:
            return
        slots = 0.0
        targets = {
            k: self._slave(k).position + gap
            for k, gap in self._gaps().items()
            if abs(gap) > self._params[k].reach
        }
        refusals = {k: self._params[k].refusal(target) for k, target in targets.items()}
        self._refused = {k: why for k, why in refusals.items() if why}
        for k, target in targets.items() if not self._refused else ():
            params, slave = self._params[k], self._slave(k)
            gap = target - slave.position
            law = params.law
            budget = align_budget(law, gap, params.coulomb, params.viscous, params.inertia)
            self.pulls[k] = Pull(params, slave.position, target, budget - slave.port_energy)
            self.granted += budget
            way_s = abs(gap) / law.speed + law.speed / law.acceleration
            slots = max(slots, way_s / self._period_s)
        self._limit = slot + round(2.0 * slots + PATIENCE_S / self._period_s)

    def is_late(self, slot: int) -> bool:
        """Return whether it has taken too long, or cannot be done."""
        gone = self.let_go > 0 and bool(self._mismatched())
        return slot > self._limit or self._ways >= MAX_WAYS or bool(self._refused) or gone

    def arrived(self, slot: int) -> bool:
        """Return whether all slaves are in place, and all axes stand.

        Where masters have moved meanwhile, slaves go on to where they are wanted now.
        """
        if self._moving:
            return True
        if not (all(self._there(k) for k in self.pulls) and self._is_still(slot)):
            return False
        if self._mismatched():
            self._ways += 1
            if self._ways < MAX_WAYS:
                self._limit = 0
                self.start(slot)
            return False
        return True

    def rescale(self, pairs: Sequence[PairParams]) -> None:
        """Take other constants of the pairs, of another scale."""
        self._params = {
            k: p._replace(reach=p.reach * pairs[k].tolerance / self.pairs[k].tolerance)
            for k, p in self._params.items()
        }
        self.pairs = pairs

    def is_calm(self, params: Sequence[AxisParams], share: float) -> bool:
        """Return whether no wall pushes, and no effort sensor is off where all has to stand."""
        return all(
            is_calm(s, p, share) and (self._moving or is_balanced(s, p))
            for s, p in zip(self._axes, params, strict=True)
        )

    def hindrance(
        self, names: Sequence[str], axes: Sequence[AxisName], params: Sequence[AxisParams]
    ) -> str:
        """Say why the pairs `names` cannot engage."""
        far = [k for k in self.pulls if not self._there(k)]
        if self.let_go and (gone := self._mismatched()):
            moved = ", ".join(names[k] for k in gone)
            return f"{moved} not aligned: it moved while everything was released"
        for k, why in self._refused.items():
            return f"{names[k]} not aligned: {why}"
        for axis, s, p in zip(axes, self._axes, params, strict=True):
            if self.let_go and not is_balanced(s, p):
                return unbalanced_sentence(axis, p, s.outside)
        if not far:
            return "an axis moves, or is in its wall; keep the devices still to engage"
        why = self.pulls[far[0]].hindrance(self._slave(far[0]))
        return f"{', '.join(names[k] for k in far)} not aligned: {why}"

    def _gaps(self) -> dict[int, float]:
        """Return how far slaves are from where their masters want them [rad or m]."""
        if self.keep_offset:
            return {}
        return {
            k: q.ratio * self._axes[q.master].position + q.offset - self._slave(k).position
            for k, q in ((k, self.pairs[k]) for k in self._params)
        }

    def _mismatched(self) -> list[int]:
        """Return the pairs whose mismatch is more than they engage at."""
        return [k for k, gap in self._gaps().items() if abs(gap) > self.pairs[k].tolerance]

    def _slave(self, k: int) -> AxisState:
        return self._axes[self.pairs[k].slave]

    def _there(self, k: int) -> bool:
        return self.pulls[k].there(self._slave(k))

    def _is_still(self, slot: int) -> bool:
        """Return whether all axes stood for a while; looked at once in that while."""
        if slot - self._still_from < self._span:
            return False
        span_s = (slot - self._still_from) * self._period_s
        still = self._began < self._still_from and all(
            is_still(s, since, span_s, quantum, REST_SPEED)
            for s, since, quantum in zip(self._axes, self._since, self._quanta, strict=True)
        )
        self._since = [s.position for s in self._axes]
        self._still_from = slot
        return still
