"""The report's section on precision: `precision` of the summary as tables of text."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from tautwave.config.keys.control import SCENE
from tautwave.report.run.page_hooks import page_hooks
from tautwave.report.run.rundir import Run, axis_kind, block
from tautwave.report.units import axis_units, number, quantity, share
from tautwave.summary import Summary
from tautwave.tables import Table, of_numbers

_HEAD = of_numbers("", "position, greatest", "of the travel", "effort, greatest", "of the greatest")
STOPPED = ("interrupted", "safety_stop", "fault")
_NAMES = {
    "oracle": "devices moved by the oracle",
    "half": "at half the rate",
    "double": "at double the rate",
}


def precision_sentences(run: Run) -> Iterator[str]:
    """Yield sentences on the replay: its span and its engine."""
    precision = run.result.precision
    if "error" in precision:
        yield f"Not computed: {precision['error']}."
    if "span_s" not in precision:
        return
    if precision.get("kind") == SCENE:
        yield from page_hooks().precision_sentences(precision)
        return
    span = quantity(precision["span_s"], "s")
    reach = f"the whole run, {span}" if precision.get("whole") else f"the first {span} of the run"
    if precision.get("kind") == "hardware":
        yield (
            f"The laws of this rig were run again on the recorded positions, over {reach}. "
            "Row 'replayed' is the distance from the efforts that were sent, which includes the "
            "limits, losses and lateness of the real run; the other rows show the effect of the "
            "rate alone."
        )
        return
    yield (
        f"This rig was simulated again, over {reach}: with its devices integrated by "
        "Dormand-Prince at 1e-12 with located contacts, which shows the integrator's error; and at "
        "half and double the rate, which shows the effect of sampling. Noise and faults are drawn "
        "anew."
    )
    if not precision.get("whole"):
        yield (
            "Limited because the compiled kernel is not in the cache: "
            "`tautwave.simulate(rig)` puts it there, and `tautwave report` then takes all."
        )
    equal = precision.get("replayed_equal")
    if equal is True:
        yield "At its own rate the replay reproduces the recorded truth bit for bit."
    elif equal is False:
        yield (
            "At its own rate the replay does not reproduce the recorded truth bit for bit"
            f"{_why_not(run.result)}."
        )


def _why_not(summary: Summary) -> str:
    """Return what a run had that its replay does not draw again; empty if nothing is known."""
    reasons = {
        "cycles were missed": summary.missed_cycles,
        "samples were lost or late": any(one.lost or one.late for one in summary.axes.values()),
        "devices reported faults": summary.faults,
        "it was stopped": summary.outcome.kind in STOPPED,
    }
    why = [reason for reason, applies in reasons.items() if applies]
    return f": in the run {', '.join(why)}" if why else ""


def precision_tables(run: Run) -> Iterator[Table]:
    """Yield one table per pair."""
    precision = run.result.precision
    if precision.get("kind") == SCENE and "span_s" in precision:
        yield from page_hooks().precision_tables(precision)
    for pair, errors in block(precision, "pairs").items():
        if precision.get("kind") == "hardware":
            yield _hardware(run, pair, errors)
        else:
            yield _simulated(run, pair, errors)


def _simulated(run: Run, pair: str, precision: dict[str, Any]) -> Table:
    position, _ = axis_units(axis_kind(run, "slave", pair))
    _, effort = axis_units(axis_kind(run, "master", pair))
    travel, greatest = number(precision.get("travel")), number(precision.get("effort"))
    rows = []
    for key, name in _NAMES.items():
        part = block(precision, key)
        if "why_not" in part:
            rows.append((name, str(part["why_not"]), "", "", ""))
            continue
        moved, pushed = number(part.get("position")), number(part.get("effort"))
        rows.append(
            (
                name,
                quantity(moved, position, 3),
                share(moved, travel),
                quantity(pushed, effort, 3),
                share(pushed, greatest),
            )
        )
    ended = [
        f"{_NAMES[key]} the run would have ended: {precision[key]['ended']}"
        for key in ("half", "double")
        if "ended" in block(precision, key)
    ]
    note = "; ".join([*step_notes(run, pair, precision), *order_notes(precision, position), *ended])
    title = f"Pair {pair}: differences of slave position and master effort"
    return Table(title, _HEAD, tuple(rows), note)


def step_notes(run: Run, pair: str, precision: dict[str, Any]) -> Iterator[str]:
    """Yield a warning if the oracle is within an encoder step: the difference may be rounding."""
    moved = number(block(precision, "oracle").get("position"))
    steps = [
        number(block(run.rig, side, "axes", pair).get("encoder_quantum")) or 0.0
        for side in ("master", "slave")
    ]
    if moved and moved < max(steps):
        unit, _ = axis_units(axis_kind(run, "slave", pair))
        yield (
            f"the oracle stays within one encoder step, {quantity(max(steps), unit, 3)}: a "
            f"single sample rounding the other way suffices"
        )


def order_notes(precision: dict[str, Any], unit: str) -> Iterator[str]:
    """Yield the observed order of convergence and the extrapolated error at the run's own rate."""
    half = number(block(precision, "half").get("position_rms"))
    double = number(block(precision, "double").get("position_rms"))
    if not half or not double:
        return
    order = math.log2(half / double)
    if order < 0.3:
        yield "the two differences do not shrink with the period: no convergence order is visible"
        return
    left = double * 2.0**order / (2.0**order - 1.0)
    yield (
        f"from half to double rate the difference shrinks as the period to the power {order:.2g}; "
        f"extrapolated, sampling moves the slave by {quantity(left, unit, 2)} rms"
    )


def _hardware(run: Run, pair: str, precision: dict[str, Any]) -> Table:
    rows = []
    for side in ("master", "slave"):
        part = block(precision, side)
        _, unit = axis_units(axis_kind(run, side, pair))
        greatest = number(part.get("effort"))
        cells = [quantity(greatest, unit, 3), quantity(part.get("replayed"), unit, 3)]
        for key in ("half", "double"):
            other = block(part, key)
            if "why_not" in other:
                cells.append(str(other["why_not"]))
                continue
            gap = number(other.get("effort_rms"))
            cells.append(f"{quantity(gap, unit, 3)} ({share(gap, greatest)})")
        rows.append((f"{side}.{pair}", *cells))
    head = of_numbers(
        "axis", "greatest effort", "replayed", "half the rate, rms", "double the rate, rms"
    )
    title = f"Pair {pair}: discretisation of its laws on the recorded positions"
    return Table(title, head, tuple(rows))
