"""What the motors of a pair gave in a run, and what the certificate lets them give.

Every element has to be passive only together with its device, so the sum over elements of what
each gave at its own worst moment says little. What the motors gave, all together, net and at the
worst moment, is one number; beside it stands the most that the ports' accounts may have owed.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import SIDES, Run, block, served_rows
from tautwave.report.units import number


def given_energy(run: Run, axes: list[str]) -> Floats | None:
    """Return what the motors of `axes` gave since the first row [J], (rows,); None if unrecorded.

    Axes by their full names; the slave's in the pair's units, as recorded.
    """
    columns = [f"{axis}.port_energy" for axis in axes]
    if not run.rows or not all(column in run.columns for column in columns):
        return None
    given = np.zeros(run.rows)
    for _, taken in run.each(columns):
        given -= taken - taken[0]
    return given


def worst_moment(run: Run, given: Floats) -> dict[str, float]:
    """Return what was given net, at the worst moment, and when [J, J, s after the first row]."""
    at = int(np.nanargmax(given))
    time = 0.0 if run.time is None else float(run.time[at] - run.time[0])
    return {"net": float(given[-1]), "worst": float(given[at]), "worst_at_s": time}


def motor_energy(run: Run, pair: str) -> dict[str, float]:
    """Return `worst_moment` of a pair and, where its rig states one, `stated_debt` [J]."""
    given = given_energy(run, [f"{side}.{pair}" for side in SIDES])
    if given is None or not np.isfinite(given).all():
        return {}
    worst = worst_moment(run, given)
    debt = stated_debt(run, pair)
    return worst if debt is None else {**worst, "stated_debt": debt}


def stated_debt(run: Run, pair: str) -> float | None:
    """Return the most that a wave pair may have given [J] by what was stated of it beforehand.

    What its ends claim, where their law does. Else both ports' `port_debt` at the speed and flow of the run, and what each gave until it could
    let go; what was forgiven to encoders; what walls held at the start, or created where the
    device's damping took it again; and what the books leave open. None for other couplings.
    """
    own = block(run.summary, "pairs", pair)
    rates, claims = block(own, "port_debt"), block(own, "claim_j")
    if not rates and not claims:
        return None
    debt = 0.0
    for side in SIDES:
        weight = 1.0 if side == "master" else 1.0 / (number(own.get("power_ratio")) or 1.0)
        if claims:
            debt += weight * (number(claims.get(side)) or 0.0) + _wall(run, pair, side, weight)
            continue
        debt += _port(run, f"{side}.{pair}", block(rates, side), weight)
        forgiven = _last(run, f"{pair}.port_{side}.dissipated")
        debt += max(0.0, -forgiven) + _wall(run, pair, side, weight)
    return debt


def _port(run: Run, axis: str, rates: dict[str, Any], weight: float) -> float:
    served = served_rows(run, axis)
    names = (f"{axis}.port_energy", f"{axis}.gross_flow")
    read = run.read(*names)
    energy = read[names[0]][served]
    flow = float(read[names[1]][-1]) if names[1] in read else 0.0
    fastest = float(np.max(_speeds(run, axis), initial=0.0))
    debt = weight * float(rates["per_speed_squared"]) * fastest**2 + float(rates["per_flow"]) * flow
    exchanges = int(rates["exchanges"])
    until = float(np.max(energy[:-exchanges] - energy[exchanges:], initial=0.0))
    return debt + until + max(0.0, _last(run, f"{axis}.uncertainty"))


def _steps(run: Run, axis: str) -> tuple[Floats, Floats]:
    """Return displacements between valid samples, and the time that each took [s]."""
    names = (f"{axis}.position", f"{axis}.valid", "skipped_slots")
    read = run.read(*names)
    position = read[names[0]]
    skipped = read.get(names[2], np.zeros(len(position)))
    slots = np.cumsum(1.0 + np.nan_to_num(skipped))
    good = np.zeros(len(position), bool)
    good[served_rows(run, axis)] = True
    good &= np.isfinite(position) & (read.get(names[1], np.ones(len(position))) > 0.5)
    return np.diff(position[good]), np.diff(slots[good]) / run.rate_hz


def _speeds(run: Run, axis: str) -> Floats:
    moved, time = _steps(run, axis)
    return np.asarray(np.abs(moved) / time)


def _wall(run: Run, pair: str, side: str, weight: float) -> float:
    names = (f"{pair}.wall_{side}.absorbed", f"{pair}.wall_{side}.stored")
    read = run.read(*names)
    if len(read) < len(names) or not run.rows:
        return 0.0
    held = max(0.0, -float(np.nanmin(read[names[1]])))
    created = max(0.0, -float(np.nanmin(read[names[0]])) - held)
    moved, time = _steps(run, f"{side}.{pair}")
    damping = number(block(run.rig, side, "axes", pair, "damping").get("lower")) or 0.0
    return held + min(created, weight * damping * float(np.sum(moved**2 / time)))


def _last(run: Run, column: str) -> float:
    values = run.read(column).get(column)
    return 0.0 if values is None or not len(values) else float(np.nan_to_num(values[-1]))
