"""Energy that the motors of a pair delivered in a run, and the limit from the certificate.

Every element has to be passive only together with its device, so adding up each element's own worst
moment says little. The energy of all motors together, net and at the worst moment, is one number;
it is compared with what the ports claim.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from tautwave.report.figures.envelope import Floats
from tautwave.report.run.rundir import Run, block, served_rows
from tautwave.report.units import number

Rows = npt.NDArray[np.bool_]


def given_energy(run: Run, axes: list[str]) -> Floats | None:
    """Return the energy delivered by the motors of `axes` since the first row [J], (rows,).

    None if unrecorded. Axes by full name; the slave's in the pair's units, as recorded.
    """
    columns = [f"{axis}.port_energy" for axis in axes]
    if not run.rows or not all(column in run.columns for column in columns):
        return None
    supplied = np.zeros(run.rows)
    for _, taken in run.each(columns):
        supplied -= taken - taken[0]
    return supplied


def worst_moment(run: Run, given: Floats) -> dict[str, float]:
    """Return net energy, energy at the worst moment, and its time [J, J, s from the first row]."""
    at = int(np.nanargmax(given))
    time = 0.0 if run.time is None else float(run.time[at] - run.time[0])
    return {"net": float(given[-1]), "worst": float(given[at]), "worst_at_s": time}


def motor_energy(run: Run, pair: str) -> dict[str, float]:
    """Return `worst_moment` of a pair and, if its rig states one, `stated_debt` [J]."""
    supplied = given_energy(run, [f"{side}.{pair}" for side in run.sides])
    if supplied is None or not np.isfinite(supplied).all():
        return {}
    worst = worst_moment(run, supplied)
    debt = stated_debt(run, pair)
    return worst if debt is None else {**worst, "stated_debt": debt}


def stated_debt(run: Run, pair: str) -> float | None:
    """Return the greatest energy [J] that a wave pair may have delivered by its certificate.

    What its ends claim, the reserves of receivers, and energy that walls held at the start, or
    created and the device's damping dissipated. None where the law claims nothing.
    """
    own = run.result_of(pair)
    if not own.claim_j:
        return None
    debt = 0.0
    for side in run.sides:
        weight = 1.0 if side == "master" else 1.0 / (own.power_ratio or 1.0)
        debt += weight * (own.claim_j.get(side) or 0.0) + _wall(run, pair, side, weight)
        debt += _compensation(run, pair, side)
        debt += own.receiver_j or 0.0
    return debt


def _compensation(run: Run, pair: str, side: str) -> float:
    """Return what compensations gave [J]: friction takes the one, the other has an account."""
    supplied = 0.0
    for what in ("compensation", "inertia"):
        name = f"{pair}.{what}_{side}.absorbed"
        read = run.read(name)
        if name in read and run.rows:
            supplied += max(0.0, -float(np.nanmin(read[name])))
    return supplied


def motion(run: Run, axis: str) -> tuple[Floats, Floats, Rows]:
    """Return displacements between valid samples, the duration of each [s], and their rows."""
    names = (f"{axis}.position", f"{axis}.valid", "skipped_slots")
    read = run.read(*names)
    position = read[names[0]]
    skipped = read.get(names[2], np.zeros(len(position)))
    slots = np.cumsum(1.0 + np.nan_to_num(skipped))
    good = np.zeros(len(position), bool)
    good[served_rows(run, axis)] = True
    good &= np.isfinite(position) & (read.get(names[1], np.ones(len(position))) > 0.5)
    return np.diff(position[good]), np.diff(slots[good]) / run.rate_hz, good


def _wall(run: Run, pair: str, side: str, weight: float) -> float:
    names = (f"{pair}.wall_{side}.absorbed", f"{pair}.wall_{side}.stored")
    read = run.read(*names)
    if len(read) < len(names) or not run.rows:
        return 0.0
    stored = max(0.0, -float(np.nanmin(read[names[1]])))
    created = max(0.0, -float(np.nanmin(read[names[0]])) - stored)
    moved, time, _ = motion(run, f"{side}.{pair}")
    damping = number(block(run.rig, side, "axes", pair, "damping").get("lower")) or 0.0
    return stored + min(created, weight * damping * float(np.sum(moved**2 / time)))
