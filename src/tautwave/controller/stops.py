"""The sentences of a stop: which axis, what it measured, the limit that it passed, with units.

The loop and the compiled simulation share them, so both stop with the same message.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from tautwave.controller.records import (
    BROKEN,
    FAULT,
    FINISHED,
    GUARD,
    LINK,
    MISMATCH,
    MISSING,
    NOT_ARMED,
    OVERRUN,
    UNBALANCED,
    AxisParams,
    PairParams,
    RunParams,
    RunState,
)
from tautwave.controller.steps import ALONE, Law
from tautwave.errors import DriverError, SafetyStop, TautwaveError
from tautwave.laws.limit import NOT_A_NUMBER, RUNAWAY, UNSEEN, LimitParams

ARM_SHARE = 0.1
"""The engage ramp begins when every requested effort is below this share of its limit."""

ARM_TIMEOUT_S = 5.0


class AxisName(NamedTuple):
    """What people call an axis: full name, its bus, and the unit of its position, `rad` or `m`."""

    name: str
    bus: str
    unit: str


class StopPlace(NamedTuple):
    """Where a run was stopped.

    `at_s` counts from its start [s], `axis` is the full name of an axis, empty where it is none's
    doing, and `reason` a word for programs: one of `REASONS` or `GUARDS`.
    """

    at_s: float
    axis: str
    reason: str


REASONS = {
    MISSING: "no_sample",
    OVERRUN: "overrun",
    BROKEN: "broken_sample",
    MISMATCH: "mismatch",
    NOT_ARMED: "not_engaged",
    FAULT: "device_fault",
    LINK: "peer_lost",
}
GUARDS = {
    1: "position_range",
    2: "velocity_limit",
    3: "not_finite",
    RUNAWAY: "runaway",
    NOT_A_NUMBER: "coupling_not_finite",
    UNSEEN: "unseen",
}


CHECK_CABLE = "; check power and cable"
"""Advice for an axis without samples, where its driver has no better."""


def stop_place(
    r: RunParams,
    o: RunState,
    names: Sequence[AxisName],
    pairs: Sequence[PairParams],
    law: Law = ALONE,
) -> StopPlace | None:
    """Return where the controller's reason to end a run early came up, None without one."""
    if o.kind == FINISHED:
        return None
    which = -1
    if o.kind == MISMATCH:
        which = pairs[o.which].slave
    elif o.kind in (MISSING, BROKEN, GUARD, FAULT) or (o.kind, o.code) == (NOT_ARMED, UNBALANCED):
        which = o.which
    reason = guard_word(o.code, law) if o.kind == GUARD else REASONS[o.kind]
    at_s = round(o.slot * r.period_ns * 1e-9, 9)
    return StopPlace(at_s, names[which].name if which >= 0 else "", reason)


def stop_error(
    r: RunParams,
    o: RunState,
    names: Sequence[AxisName],
    params: Sequence[AxisParams],
    pairs: Sequence[PairParams],
    law: Law = ALONE,
) -> TautwaveError | None:
    """Return the controller's reason to end a run early, or None."""
    period_s, time_s = r.period_ns * 1e-9, o.slot * r.period_ns * 1e-9
    if o.kind == OVERRUN:
        return SafetyStop(overrun_sentence(o.code, r.overrun_limit, period_s, time_s))
    if o.kind == MISMATCH:
        pair = pairs[o.which]
        name = names[pair.master].name.partition(".")[2]
        unit = names[pair.slave].unit
        return SafetyStop(mismatch_sentence(name, o.first, pair.tolerance, unit))
    if o.kind == NOT_ARMED and o.code == UNBALANCED:
        shown = unbalanced_sentence(names[o.which], params[o.which], o.found)
        return SafetyStop(f"not engaged after {ARM_TIMEOUT_S:g} s: {shown}")
    if o.kind == NOT_ARMED:
        limits = [(it.name, it.unit, p.site.limit) for it, p in zip(names, params, strict=True)]
        return SafetyStop(unarmed_sentence(limits))
    if o.kind not in (MISSING, BROKEN, GUARD):
        return None
    axis, bus, unit = names[o.which]
    p = params[o.which]
    if o.kind == MISSING:
        each = "cycle" if p.divisor == 1 else "exchange"
        many = f"{o.code} {each}s in a row" if o.code != 1 else f"one {each}"
        return DriverError(f"{axis} on bus {bus!r}: no sample in {many}{CHECK_CABLE}")
    if o.kind == BROKEN:
        return SafetyStop(broken_sentence(axis, unit, o.first, o.second))
    limit = p.site.limit
    law = with_numbers(law, o.found, o.allowed, _effort(unit))
    return SafetyStop(guard_sentence(axis, o.code, unit, limit, o.first, o.second, time_s, law))


def with_numbers(law: Law, found: float, allowed: float, effort: str) -> Law:
    """Return a law whose sentences have the numbers of a stop, and the unit of an effort."""
    numbers = {"found": found, "allowed": allowed, "effort": effort}
    named = {
        code: guard._replace(
            sentence=guard.sentence.format(**numbers), detail=guard.detail.format(**numbers)
        )
        for code, guard in law.guards.items()
    }
    return law._replace(guards=named)


def guard_word(code: int, law: Law) -> str:
    """Return the word of a guard for programs, also for an undeclared code."""
    if code in GUARDS:
        return GUARDS[code]
    return law.guards[code].word if code in law.guards else f"guard_{code}"


def never_began(o: RunState) -> bool:
    """Return True if the coupling never engaged."""
    return int(o.kind) in (MISMATCH, NOT_ARMED)


def guard_sentence(
    axis: str,
    code: int,
    unit: str,
    limit: LimitParams,
    position: float,
    velocity: float,
    time_s: float,
    law: Law = ALONE,
) -> str:
    """Say which guard stopped a run.

    Parameters
    ----------
    axis : str
        Full name.
    code : int
        Of the guard: 1 to 3 (`laws.limit.guard_axis`), `RUNAWAY`, `NOT_A_NUMBER`, `UNSEEN`,
        or one of the coupling's own.
    unit : str
        Of the position, `rad` or `m`.
    limit : LimitParams
        Of the axis.
    position, velocity : float
        As measured [rad or m, rad/s or m/s].
    time_s : float
        When [s since the start].
    law : Law
        The coupling.
    """
    passed = {
        1: f"left its position range of {limit.position_low:.6g} to {limit.position_high:.6g} "
        f"{unit}",
        2: f"exceeded its velocity limit of {limit.velocity:.6g} {unit}/s",
        3: "is not finite",
        RUNAWAY: "received a scene effort over a million times its limit of "
        f"{limit.effort:.6g} {_effort(unit)}",
        NOT_A_NUMBER: f"was commanded a non-finite effort by its coupling, law {law.name}",
        UNSEEN: "had no sample for too long",
    } | {own: guard.sentence for own, guard in law.guards.items()}
    details = {UNSEEN: "skipped slots count, too (loop.missing_limit)"} | {
        own: guard.detail for own, guard in law.guards.items()
    }
    detail = details.get(code, "")
    own = f"was stopped by its coupling, guard {code},"
    return (
        f"{axis} {passed.get(code, own)} at {time_s:.3f} s: {detail}{detail and '; '}position "
        f"{position:.6g} {unit}, velocity {velocity:.6g} {unit}/s"
    )


def mismatch_sentence(pair: str, gap: float, tolerance: float, unit: str) -> str:
    """Say that a slave starts too far from where its master wants it [slave's `unit`]."""
    return (
        f"pair {pair}: the slave starts {gap:+.6g} {unit} away from where the master puts it, "
        f"more than engage_tolerance ({tolerance:.6g} {unit} at the "
        "slave); move one of them, or use "
        "offset: at_engage"
    )


def unarmed_sentence(axes: Iterable[tuple[str, str, LimitParams]]) -> str:
    """Say that the pairs did not engage; `axes` are name, unit of position, and limits."""
    limits = ", ".join(f"{name} {p.effort:.6g} {_effort(unit)}" for name, unit, p in axes)
    return (
        f"not engaged after {ARM_TIMEOUT_S:g} s: an axis has no samples, or needs more than "
        f"{ARM_SHARE:.0%} of its effort limit ({limits}) at rest; move the axes out of their walls"
    )


def unbalanced_sentence(axis: AxisName, p: AxisParams, shown: float) -> str:
    """Say what is wrong with the effort sensor of an axis at rest, which shows `shown` [N m or N].

    What it shows of nothing may be wrong by up to what friction balances without being noticed.
    """
    unit = _effort(axis.unit)
    raw = p.sensor_zero + shown / p.sensor_gain
    return (
        f"{axis.name}: its effort sensor reads {shown:+.3g} {unit} with the motors off, but "
        f"friction at rest balances at most {p.rest_effort:.3g} {unit}; release it, or, if "
        f"nothing touches it, set effort_sensor.offset to about {raw:.3g}"
    )


def overrun_sentence(skipped: int, limit: int, period_s: float, time_s: float) -> str:
    """Say that the host missed too many slots in a row."""
    missed = "slots of {} ms were missed in a row" if skipped != 1 else "slot of {} ms was missed"
    return (
        f"{skipped} {missed.format(f'{1e3 * period_s:g}')} at {time_s:.3f} s "
        f"(loop.overrun_limit: {limit}); the host is too slow or was stopped"
    )


def broken_sentence(axis: str, unit: str, position: float, effort: float) -> str:
    """Say that a sample that a driver marked valid is NaN."""
    return (
        f"{axis}: measured position {position:.6g} {unit}, effort {effort:.6g} {_effort(unit)}; "
        "a sensor or its driver is broken"
    )


def position_unit(kind: str) -> str:
    """Return the unit of an axis' position: its `kind` is `rotary` or `linear`."""
    return "rad" if kind == "rotary" else "m"


def _effort(unit: str) -> str:
    return "N m" if unit == "rad" else "N"
