"""The certificate recomputed with a run's measurements: period, jitter, gaps, losses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from tautwave.analysis.walls.passivity import wall_leak
from tautwave.analysis.walls.sampled import SNAP, SampledWall
from tautwave.certificate.belief import declared_delays, delay_in_periods
from tautwave.certificate.verdict import certify
from tautwave.certificate.walls import damping_at, wall_name
from tautwave.config import Rig, Wall, axis_damper, local_wall
from tautwave.rig import at_axis_rate
from tautwave.types import CommandDelay

RESOLUTION_S = 1.1e-6
"""[s] A measured period this close counts as nominal: the loop's histogram has bins of 1 us."""


class Measured(NamedTuple):
    """What a run measured.

    Attributes
    ----------
    period_s, worst_period_s : float
        Median and 99.9th percentile of the time between cycles [s].
    latched : bool
        Samples and commands belong to slots of a grid unaffected by host jitter.
    held_s : mapping of str to float
        By axis: the longest time for which one effort of its wall was held [s]; 0 if it was
        never touched.
    missed_cycles : int
        Slots that were skipped.
    lost, late : mapping of str to int
        Missing samples, and samples older than a period, by axis.
    balance_j : mapping of str to float
        By axis: the least that wall and device's damping had taken in a contact, at any moment of
        it [J]; no key where that is not known.
    debt_j, claim_j : mapping of str to float
        By axis: what a wall that pays its debts was in debt at most, and may have been [J]; no key
        where that is not known.
    """

    period_s: float
    worst_period_s: float
    latched: bool
    held_s: Mapping[str, float]
    missed_cycles: int
    lost: Mapping[str, int]
    late: Mapping[str, int]
    balance_j: Mapping[str, float] = MappingProxyType({})
    debt_j: Mapping[str, float] = MappingProxyType({})
    claim_j: Mapping[str, float] = MappingProxyType({})


def recheck(rig: Rig, measured: Measured) -> dict[str, Any]:
    """Return the certificate after a run as plain data.

    A wall passes if its condition holds for the longest time that its effort was actually held:
    the leak of a held effort, K T / 2, grows with that time. This is the worst case over all
    motions. If the loop's slots are also the devices', the energy of a held effort is known, its
    force times the displacement between two samples; then a wall also passes if at no moment of a
    contact more energy had come out than went in, or never more than the debt that it claims.
    Skipped slots and lost samples out of contact
    cost a wall nothing, and a wave port keeps its account over them.

    Returns
    -------
    dict
        passed, sentences, period_s, worst_period_s, missed_cycles, lost, late, verdicts, walls.
    """
    nominal = rig.period_s
    period = measured.period_s
    if abs(period - nominal) <= RESOLUTION_S or not period > 0.0:
        period = nominal
    real = rig if period == nominal else rig.model_copy(update={"rate_hz": 1.0 / period})
    certificate = certify(real, brief=True)
    sentences = certificate.sentences()
    walls: dict[str, Any] = {}
    delays = declared_delays(rig)
    for axis_name in rig.axes:
        wall = local_wall(rig, axis_name)
        if wall is None or rig.axes[axis_name].causality == "admittance":
            continue
        own = at_axis_rate(rig, axis_name)
        held = measured.held_s.get(axis_name, 0.0)
        if not measured.latched and held > 0.0:
            # A slow axis waits for its bus period, one cycle of which may be late.
            held = max(held, own.period_s - rig.period_s + measured.worst_period_s)
        delay = delay_in_periods(own, delays[axis_name])
        recomputed = _wall(own, axis_name, wall, delays[axis_name], delay, held, measured)
        walls[axis_name] = recomputed
        if not recomputed["passed"] and rig.require != "coupled_stable":
            sentences.append(recomputed["sentence"])
    return {
        "passed": certificate.passed and not sentences,
        "sentences": sentences,
        "period_s": measured.period_s,
        "worst_period_s": measured.worst_period_s,
        "missed_cycles": measured.missed_cycles,
        "lost": dict(measured.lost),
        "late": dict(measured.late),
        "verdicts": {name: verdict.as_dict() for name, verdict in certificate.verdicts.items()},
        "walls": walls,
    }


def _wall(
    rig: Rig,
    axis_name: str,
    wall: Wall,
    declared: CommandDelay,
    delay: float,
    held: float,
    measured: Measured,
) -> dict[str, Any]:
    """Return the verdict on a wall for the longest time its effort was held."""
    axis = rig.axes[axis_name]
    longest = max(held, rig.period_s)
    periods = delay + (1.0 if held > 0.0 and measured.late.get(axis_name, 0) else 0.0)
    sampled = SampledWall(
        wall.stiffness,
        wall.damping,
        longest,
        periods * rig.period_s / longest,
        axis.velocity_filter_s,
    )
    if axis_damper(rig, axis_name) is not None:  # what it lends is known for whole delays
        sampled = sampled._replace(delay=math.ceil(sampled.delay - SNAP))
    needed = wall_leak(sampled).damping
    present = damping_at(rig, axis_name, declared, sampled)
    regular = longest <= rig.period_s + RESOLUTION_S and periods == delay
    balance = measured.balance_j.get(axis_name) if measured.latched and periods == delay else None
    kept = balance is not None and balance >= 0.0
    claim = measured.claim_j.get(axis_name, math.inf)
    debt = measured.debt_j.get(axis_name, math.inf) if measured.latched else math.inf
    within = math.isfinite(claim) and debt <= claim
    passed = needed <= present or (wall.passivity_control and regular) or kept or within
    unit = "N m s/rad" if axis.kind == "rotary" else "N s/m"
    sentence = (
        f"{wall_name(rig, axis_name)}: its effort was held for {1e3 * longest:.4g} ms at most, "
    )
    if periods > delay:
        sentence += "from a sample up to a period old, "
    sentence += f"which needs {needed:.4g} {unit} of the device's {present:.4g}."
    if balance is not None and needed > present:
        sentence += (
            " No contact of this run returned more energy than it absorbed."
            if kept
            else f" A contact returned {-balance:.2g} J more than it absorbed."
        )
        if within and not kept:
            sentence += f" It claims {claim:.2g} J for that."
    if not passed:
        sentence += (
            " Sampling may have created energy: lower K, or make the loop keep its deadlines."
        )
    return {
        "held_s": held,
        "balance_j": balance,
        "claim_j": claim if math.isfinite(claim) else None,
        "needed_damping": needed,
        "damping": present,
        "passed": passed,
        "sentence": sentence,
    }
