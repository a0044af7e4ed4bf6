"""Another scale of the pairs, while they hold or while they do not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from tautwave.controller.records import AxisParams, AxisState, PairParams
from tautwave.runtime.control import CoupledControl

Scaled = tuple[Sequence[AxisParams], Sequence[PairParams]]
"""Constants of axes and pairs at a scale; their places are the same at each."""


def held_by(control: CoupledControl, scaled: Scaled) -> str:
    """Say why the pairs cannot take another scale while they hold, '' if they can."""
    law = control.law.rescaling
    if law is None:
        return f"law {control.law.name} is disengaging"
    for which, p, new in _changing(control, scaled):
        s, name = control.axes[which], control.names[which].name
        if p.divisor > 1:
            return f"{name}: its bus is slower"
        if s.depth != 0.0:
            return f"{name}: it touches its wall"
        if p.site.compensates_inertia:
            return f"{name}: its inertia is compensated"
        why = law.hindrance(s, p, new.end, p.weight / new.weight)
        if why:
            return f"{name}: {why}"
    return ""


def take_scale(control: CoupledControl, scaled: Scaled, *, holding: bool) -> None:
    """Take the constants of a scale in one slot; what was tuned stays.

    `holding`: while the pairs hold, for which `held_by` found nothing; new offsets then leave the
    slaves where they are.
    """
    law = control.law.rescaling
    params = list(control.params)
    for which, p, new in _changing(control, scaled):
        s, ratio = control.axes[which], p.weight / new.weight
        if holding and law is not None:
            law.carry(s, p, ratio, control.table)
            _reweigh(s, ratio)
        end = new.end if law is None else law.keep(p.end, new.end)
        params[which] = p._replace(end=end, weight=new.weight)
    for c, q, after in zip(control.states, control.pairs, scaled[1], strict=True):
        if holding:
            place = control.axes[q.slave].position
            c.offset = place - after.ratio * q.to_master * (place - c.offset)
    control.params, control.pairs = params, scaled[1]


def _changing(
    control: CoupledControl, scaled: Scaled
) -> Iterator[tuple[int, AxisParams, AxisParams]]:
    """Yield place, present and new constants of the slaves; a master's are those of every scale."""
    for q in control.pairs:
        yield q.slave, control.params[q.slave], scaled[0][q.slave]


def _reweigh(s: AxisState, ratio: float) -> None:
    """Put an axis' books [J] into the new scale's energy, so that the pair's go on."""
    for name in ("port_energy", "gross_flow", "uncertainty", "help_absorbed"):
        setattr(s, name, ratio * getattr(s, name))
    for name in ("wall_absorbed", "wall_dissipated", "wall_stored_at_start"):
        setattr(s, name, ratio * getattr(s, name))
