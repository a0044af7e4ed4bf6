"""The certificate recomputed with the measured period, gaps and losses of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from tautwave.certificate.after import Measured, recheck
from tautwave.config import Rig
from tautwave.errors import TautwaveError
from tautwave.registry import load_driver
from tautwave.report.run.rundir import Run, block, served_rows
from tautwave.report.units import number


def recheck_run(run: Run) -> dict[str, Any]:
    """Return a run's summary with `certificate.after_run`.

    `invalidated` is true if the certificate held before the run and its measurements break it. If
    it cannot be computed, `error` says why.
    """
    summary = dict(run.summary)
    certificate = dict(block(summary, "certificate"))
    try:
        after = recheck(run.checked_rig, measured_of(run, run.checked_rig))
    except TautwaveError as err:
        after = {"passed": None, "error": str(err)}
    after["invalidated"] = certificate.get("passed") is True and after["passed"] is False
    certificate["after_run"] = after
    summary["certificate"] = certificate
    return summary


def measured_of(run: Run, rig: Rig) -> Measured:
    """Return what a run measured about its own loop."""
    period = block(run.summary, "period_us")
    axes = block(run.summary, "axes")
    nominal = 1e6 * rig.period_s
    return Measured(
        period_s=1e-6 * (number(period.get("p50")) or nominal),
        worst_period_s=1e-6 * (number(period.get("p999")) or nominal),
        # A simulated bus without hardware latches on the loop's slots, as a drive with a SYNC.
        latched=not any(load_driver(bus.driver).hardware for bus in rig.buses.values()),
        held_s={name: held_wall(run, name) * rig.period_s for name in rig.axes},
        missed_cycles=int(number(run.summary.get("missed_cycles")) or 0),
        lost={name: int(block(axes, name).get("lost", 0)) for name in rig.axes},
        late={name: int(block(axes, name).get("late", 0)) for name in rig.axes},
    )


def held_wall(run: Run, axis: str) -> float:
    """Return the greatest number of slots over which one effort of an axis' wall was held.

    A skipped slot and a lost sample both leave the command as it is; on a bus with a divisor it
    changes in every n-th slot only. 0: the wall never pushed.
    """
    names = ("skipped_slots", f"{axis}.wall_effort", f"{axis}.valid")
    columns = run.read(*names)
    if len(columns) < len(names):
        return 0.0
    skipped, effort, valid = (columns[name] for name in names)
    served = served_rows(run, axis)
    slots = np.cumsum(1.0 + np.nan_to_num(skipped))[served]
    effort, valid = effort[served], valid[served]
    fresh = np.flatnonzero(valid > 0.5)
    pushed = effort[fresh][:-1] != 0.0
    spans = np.diff(slots[fresh])[pushed]
    return float(spans.max()) if spans.size else 0.0
