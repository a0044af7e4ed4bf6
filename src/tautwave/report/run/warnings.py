"""What a person should know of a run beside how it ended: never a cause of an exit code.

An axis at its limit for long, a pair further apart than line or spring explain, an operated rig
that was hardly engaged. A rig says in `expect` which of them are meant.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from tautwave.laws.limit import AT_LIMIT
from tautwave.report.run.conditions import met_rows
from tautwave.report.run.rundir import Run, block, kind_of, pair_settings
from tautwave.report.units import axis_units, number, quantity
from tautwave.summary import Summary

AT_LIMIT_SHARE = 0.2
"""Of the coupled cycles, at its limit."""

EXPLAINED = 3.0
"""Times the offset that line or spring explain."""

STEPS = 5.0
"""Encoder steps more."""

ENGAGED_SHARE = 0.5
"""Of an operated run, engaged."""


class Warned(NamedTuple):
    """A warning: its kind, one of the rig's `expect`, and a sentence."""

    kind: str
    sentence: str


def with_warnings(run: Run) -> Summary:
    """Return a run's summary with `warnings`: sentences on what the rig does not expect."""
    expected = run.rig.get("expect") or ()
    sentences = tuple(one.sentence for one in warnings_of(run) if one.kind not in expected)
    return run.result.model_copy(update={"warnings": sentences})


def warnings_of(run: Run) -> Iterator[Warned]:
    """Yield what there is to warn of, expected or not."""
    axes = [f"{side}.{pair}" for pair in run.pairs for side in run.sides]
    for axis in [*axes, *(f"master.{port}" for port in run.ports)]:
        met, acted = met_rows(run, axis, AT_LIMIT)
        if met > AT_LIMIT_SHARE * acted:
            yield Warned(
                "at_limit",
                f"{axis} was at its limit in {100.0 * met / acted:.0f} % of the coupled cycles: it "
                "cannot follow, or render, what is requested of it.",
            )
    for pair in run.pairs:
        yield from _apart(run, pair)
    operation, lasted = run.result.operation, run.result.duration_s
    engaged = None if operation is None else operation.engaged_s
    if engaged is not None and lasted and engaged < ENGAGED_SHARE * lasted:
        yield Warned(
            "not_engaged",
            f"Engaged for {quantity(engaged, 's', 3)} of {quantity(lasted, 's', 3)}.",
        )


def _apart(run: Run, pair: str) -> Iterator[Warned]:
    """Yield a warning of a pair that is further apart than its coupling explains."""
    figures = run.result_of(pair)
    error = figures.delayed_error or figures.position_error
    measured, offset = None if error is None else error.rms, figures.expected_offset
    if measured is None or offset is None:
        return
    steps = STEPS * encoder_step(run, pair)
    if measured > EXPLAINED * abs(offset) + steps:
        position, _ = axis_units(kind_of(run, pair))
        yield Warned(
            "position_error",
            f"{pair}: its ends were {quantity(measured, position, 3)} apart (rms, delay and scale "
            f"taken out), and its coupling explains {quantity(abs(offset), position, 3)} at the "
            "largest held effort.",
        )


def encoder_step(run: Run, pair: str) -> float:
    """Return the greater encoder step of a pair's devices [rad or m, master]."""
    scale = number(pair_settings(run, pair).get("position_scale")) or 1.0
    steps = [
        number(block(run.rig, side, "axes", pair).get("encoder_quantum")) or 0.0
        for side in ("master", "slave")
    ]
    return max(steps[0], steps[1] / scale)
