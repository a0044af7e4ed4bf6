"""How a simulation ended, in the sentences of `runtime.loop`."""

from __future__ import annotations

from typing import Any

from tautwave.errors import DriverError, SafetyStop, TautwaveError
from tautwave.offline.pack import Job
from tautwave.offline.records import (
    BROKEN,
    FINISHED,
    MISMATCH,
    MISSING,
    NOT_ARMED,
    OVERRUN,
)
from tautwave.runtime.loop import ARM_SHARE, ARM_TIMEOUT_S, GUARDS


def error_of(job: Job, outcome: Any) -> TautwaveError | None:
    """Return what ended the run early, or None; `outcome` is an `Outcome` of any engine."""
    kind, slot, which, code = (
        int(outcome.kind),
        int(outcome.slot),
        int(outcome.which),
        int(outcome.code),
    )
    first, second = float(outcome.first), float(outcome.second)
    period = job.run.period_ns
    if kind == FINISHED:
        return None
    if kind == MISSING:
        each = "cycles" if job.sides[which].divisor == 1 else "exchanges"
        return DriverError(
            f"{job.axes[which]} on bus {job.buses[which]!r}: no sample in "
            f"{code} {each} running; check power and cable"
        )
    if kind == OVERRUN:
        return SafetyStop(
            f"{code} slots of {period / 1e6:g} ms were missed in a row at "
            f"{slot * period / 1e9:.3f} s; the host is too slow or was stopped"
        )
    if kind == BROKEN:
        told = f"{job.axes[which]}: measured position {first}, effort {second}"
        return SafetyStop(f"{told}; a sensor or its driver is broken")
    if kind == MISMATCH:
        pair = job.pairs[which]
        name = job.axes[pair.master].partition(".")[2]
        return SafetyStop(
            f"pair {name}: master and slave start {first:+.6g} apart, more than "
            f"engage_tolerance {pair.tolerance:g}; move one of them, or use "
            "offset: at_engage"
        )
    if kind == NOT_ARMED:
        return SafetyStop(
            f"not engaged after {ARM_TIMEOUT_S:g} s: an axis is not measured, or asks for "
            f"more than {ARM_SHARE:.0%} of its effort limit while standing; "
            "move the axes out of their walls"
        )
    return SafetyStop(
        f"{job.axes[which]} {GUARDS[code]} at {slot * period / 1e9:.3f} s: "
        f"position {first:.6g}, velocity {second:.6g}"
    )


def never_began(outcome: Any) -> bool:
    """Return True if the coupling never engaged."""
    return int(outcome.kind) in (MISMATCH, NOT_ARMED)
