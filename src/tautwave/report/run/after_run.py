"""The certificate recomputed with the measured period, gaps and losses of a run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from tautwave.certificate.after import Measured, recheck
from tautwave.certificate.belief import declared_delays
from tautwave.certificate.walls import wall_claims
from tautwave.config import Rig, local_wall, replace_wall
from tautwave.errors import TautwaveError
from tautwave.registry import load_driver
from tautwave.report.ends import ends_of, port_of
from tautwave.report.figures.envelope import Floats
from tautwave.report.link import kept_of
from tautwave.report.motors import Rows
from tautwave.report.noise import noise_sentences
from tautwave.report.run.conditions import broken_conditions
from tautwave.report.run.judging import ALLOWED, REMEDY, RULES, judged_of
from tautwave.report.run.rundir import Run, served_rows
from tautwave.report.sensors import sensor_sentences
from tautwave.rig import axis_allowance, pair_scale
from tautwave.rig.scales import scaled
from tautwave.summary import Summary, checked
from tautwave.summary.model import AfterRun

ROUNDING = 1e-12
"""Of all that passed to and fro: sums of doubles are no better."""


def recheck_run(run: Run) -> Summary:
    """Return a run's summary with `certificate.after_run`.

    `invalidated` is true if the certificate held before the run and its measurements break it, or
    if a coupling generated energy, an end supplied more than it claimed, or a receiver more than it
    got, whatever the certificate said. If it cannot be computed, `error` says why. `generated` is
    what couplings without claims generated (`report.run.judging`), `judged` a sentence on the rule
    that judged. `ends` are `report.ends` by axis, `receivers` what those held at the least;
    `broken_conditions` are those of the certificate that the run did not keep; `notes` are
    sentences on ends that were hit and kept their claim, on noise beyond the declared, on effort
    sensors that motors contradict, and on energy generated where no more than stability with the
    stated hand is required.
    """
    certificate = run.result.certificate
    after: dict[str, Any]
    try:
        rig, tuned = worst_rig(run)
        after = recheck(rig, measured_of(run, rig))
        for at_scale in acted_scales(run, rig):
            other = recheck(at_scale, measured_of(run, at_scale))
            if other["passed"] is False:
                sentences = [f"{at_scale.name}: {sentence}" for sentence in other["sentences"]]
                after |= {"passed": False, "sentences": [*after["sentences"], *sentences]}
        judged = list(judged_of(run, rig))
    except TautwaveError as err:
        after, tuned, judged = {"passed": None, "error": str(err)}, [], []
    after["invalidated"] = certificate.passed is True and after["passed"] is False
    ends = list(ends_of(run))
    after["ends"] = {
        end.axis: {
            "given_j": end.given,
            "blow_j": end.blow,
            "claim_j": end.claim,
            "true_j": port_of(run, end.axis).true_j,
            "gap_s": end.gap_s,
            "stalled": end.stalled,
            "passed": end.passed,
        }
        for end in ends
    }
    hit = [end.sentence for end in ends if end.passed and end.sentence]
    after["notes"] = [*hit, *noise_sentences(run), *sensor_sentences(run), *tuned]
    after["generated"] = {one.name: one.as_dict() for one in judged}
    after["judged"] = judged_sentence([*(one.rule for one in judged), *(["ends"] if ends else [])])
    after["broken_conditions"] = list(broken_conditions(run))
    generated = [f"{one.sentence} {REMEDY}" for one in judged if not one.passed]
    if certificate.require == "coupled_stable":
        allowed = [f"{one.sentence} {ALLOWED}" for one in judged if not one.passed]
        after["notes"] = [*allowed, *after["notes"]]
        generated = []
    kept = list(kept_of(run))
    if kept:
        after["receivers"] = {one.element: {"least_j": one.least} for one in kept}
    broken = [*generated, *(end.sentence for end in ends if not end.passed)]
    broken += [one.sentence for one in kept if not one.passed]
    if broken:
        after |= {"passed": False, "invalidated": True}
        after["sentences"] = [*broken, *after.get("sentences", ())]
    judged_so = certificate.model_copy(update={"after_run": checked(AfterRun, after)})
    return run.result.model_copy(update={"certificate": judged_so})


def judged_sentence(rules: list[str]) -> str:
    """Return by which rules a run's energy was judged, as a sentence; empty without any."""
    by_rules = "; ".join(RULES[rule] for rule in dict.fromkeys(rules))
    return f"Its energy is judged {by_rules}." if by_rules else ""


def acted_scales(run: Run, rig: Rig) -> Iterator[Rig]:
    """Yield the rig at each other scale that a person chose in its run."""
    for scale in np.unique(run.read("operation.scale").get("operation.scale", [])):
        if scale != 1.0:
            yield scaled(rig, float(scale))


def worst_rig(run: Run) -> tuple[Rig, list[str]]:
    """Return a run's rig with the worst of what acted while it was tuned, and a sentence on it.

    Of a wall that is the stiffness and damping, of one row, whose K T / 2 + B is greatest. The
    filter of a wave line takes no part in what is looked at after a run.
    """
    rig, sentences = run.checked_rig, []
    for axis in rig.axes:
        wall = local_wall(rig, axis)
        names = [f"tuning.{axis}.wall_{key}" for key in ("stiffness", "damping")]
        columns = run.read(*names)
        if wall is None or len(columns) < len(names):
            continue
        stiffness, damping = (columns[name] for name in names)
        half = 0.5 * rig.axis_period_s(axis)
        at = int(np.argmax(half * stiffness + damping))
        worst = {"stiffness": float(stiffness[at]), "damping": float(damping[at])}
        if np.ptp(stiffness) or np.ptp(damping):
            unit = "N m/rad" if rig.axes[axis].kind == "rotary" else "N/m"
            sentences.append(
                f"{axis}: its wall was tuned; the certificate looks at the worst that acted, "
                f"K = {worst['stiffness']:.4g} {unit}, B = {worst['damping']:.4g}"
            )
        rig = replace_wall(rig, axis, wall.model_copy(update=worst))
    return rig, sentences


def measured_of(run: Run, rig: Rig) -> Measured:
    """Return what a run measured about its own loop."""
    period, axes = run.result.period_us, run.result.axes
    nominal = 1e6 * rig.period_s
    return Measured(
        period_s=1e-6 * (period.p50 or nominal),
        worst_period_s=1e-6 * (period.p999 or nominal),
        # A simulated bus without hardware latches on the loop's slots, as a drive with a SYNC.
        latched=not any(load_driver(bus.driver).hardware for bus in rig.buses.values()),
        held_s={name: held_wall(run, name) * rig.period_s for name in rig.axes},
        missed_cycles=run.result.missed_cycles or 0,
        lost={name: axes[name].lost or 0 if name in axes else 0 for name in rig.axes},
        late={name: axes[name].late or 0 if name in axes else 0 for name in rig.axes},
        balance_j={
            name: balance
            for name in rig.axes
            if (balance := wall_balance(run, rig, name)) is not None
        },
        debt_j={name: debt for name in rig.axes if (debt := wall_debt(run, rig, name)) is not None},
        claim_j=wall_claims(run.checked_rig),
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


def wall_balance(run: Run, rig: Rig, axis: str) -> float | None:
    """Return the least that a wall had taken in a contact, at any moment of it [J]; None: unknown.

    Counted in is what the device's damping took at least, b (dx)^2 / dt between two samples, while
    the wall pushed. Below 0 more came out than went in; what had not come out by the end of the run
    never will. Each contact begins at nothing: what one took does not pay for the next. 0: it was
    never touched.
    """
    contacts = _contacts(run, rig, axis)
    if contacts is None:
        return None
    taken, damped, pushed = contacts
    if not pushed.any():
        return 0.0
    total = np.cumsum(np.where(pushed, taken + damped, 0.0))
    begins = pushed & ~np.concatenate([[False], pushed[:-1]])
    before = np.concatenate([[0.0], total[:-1]])
    last = np.maximum.accumulate(np.where(begins, np.arange(len(total)), 0))
    least = float((total - before[last])[pushed].min())
    rounding = ROUNDING * float(np.abs(taken).sum())
    return 0.0 if abs(least) <= rounding else least


def wall_debt(run: Run, rig: Rig, axis: str) -> float | None:
    """Return what a wall had given beyond what it took, at most [J]; None: unknown.

    A debt is carried from contact to contact, what a contact left over is not. What the device's
    damping took at least is counted in, as in `wall_balance`.
    """
    contacts = _contacts(run, rig, axis)
    if contacts is None:
        return None
    taken, damped, pushed = contacts
    taken = taken + damped
    edges = np.flatnonzero(np.diff(np.concatenate([[False], pushed, [False]])))
    balance = least = 0.0
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        total = min(balance, 0.0) + np.cumsum(taken[begin:end])
        balance, least = float(total[-1]), min(least, float(total.min()))
    return -least


def _contacts(run: Run, rig: Rig, axis: str) -> tuple[Floats, Floats, Rows] | None:
    """Return, between samples, what wall and damping took [J] and where the wall pushed."""
    side, _, pair = axis.partition(".")
    names = ("skipped_slots", f"{axis}.valid", f"{axis}.position", f"{axis}.wall_effort")
    columns = run.read(*names, f"{pair}.wall_{side}.absorbed")
    if len(columns) < len(names) + 1 or rig.axes[axis].causality != "impedance":
        return None
    served = served_rows(run, axis)
    slots = np.cumsum(1.0 + np.nan_to_num(columns["skipped_slots"]))[served]
    _, valid, position, effort, absorbed = (column[served] for column in columns.values())
    fresh = valid > 0.5
    weight = 1.0 if side == "master" else 1.0 / pair_scale(rig.coupling.pairs[pair]).power
    taken = np.diff(absorbed[fresh]) / weight
    spans = np.diff(slots[fresh]) * rig.period_s
    damping = axis_allowance(rig, axis, declared_delays(rig)[axis]).sampled_damping
    damped = damping * np.diff(position[fresh]) ** 2 / spans
    return taken, damped, (effort[fresh][:-1] != 0.0) | (taken != 0.0)
