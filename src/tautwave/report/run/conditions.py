"""Which conditions of its certificate a run did not keep: those that its rows can tell."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from tautwave.laws.limit import AT_LIMIT, CLIPPED, RATE_LIMITED, STOPPED
from tautwave.report.ends import longest_gap
from tautwave.report.run.rundir import Run, engaged_rows
from tautwave.report.units import count, plural, quantity

ROUNDING = 1e-3
"""Relative: the digits with which a gap is stated."""

Bits = npt.NDArray[np.int64]

REACHED = re.compile(r"the effort_rate_limit of (\S+) is not reached")
ASKED = re.compile(r"the coupling of (\S+) asks for no more than")
STRONG = re.compile(r"the motor of (\S+) is not at its effort_limit while")
GAP = re.compile(r"no gap between samples of (\S+) is longer than (\S+) ms")
WHOLE = re.compile(r"no sample of (\S+) is lost and the host does not stall")
"""How the conditions begin that rows can tell, with the axis or pair that they are about."""


def broken_conditions(run: Run) -> Iterator[str]:
    """Yield the conditions that a run did not keep, each with how often, as sentences."""
    verdicts = run.result.certificate.verdicts.values()
    for condition in dict.fromkeys(one for verdict in verdicts for one in verdict.conditions):
        how = _broken(run, condition)
        if how:
            yield f"The certificate holds if {condition.partition(';')[0]}; {how}."


def _broken(run: Run, condition: str) -> str:
    """Return how often a condition was not kept, as a clause; empty if it was, or if unknown."""
    rate, clip, strong, gap, whole = (
        one.match(condition) for one in (REACHED, ASKED, STRONG, GAP, WHOLE)
    )
    axes, bits = [], 0
    if rate is not None:
        axes, bits = [rate[1]], RATE_LIMITED
    elif clip is not None:
        axes, bits = [f"{side}.{clip[1]}" for side in run.sides], CLIPPED
    elif strong is not None:
        axes, bits = [strong[1]], AT_LIMIT
    elif gap is not None:
        longest = longest_gap(run, gap[1])
        if longest > 1e-3 * float(gap[2]) * (1.0 + ROUNDING):
            return f"it had no sample for {quantity(longest, 's', 3)}"
    elif whole is not None:
        axis = run.result.axes.get(whole[1])
        lost = 0 if axis is None else axis.lost or 0
        missed = run.result.missed_cycles or 0
        if lost or missed:
            return f"{plural(lost, 'sample')} of it and {plural(missed, 'cycle')} were lost"
    met, acted = max((met_rows(run, axis, bits) for axis in axes), default=(0, 0))
    return f"it was violated in {count(met)} of {count(acted)} cycles" if met else ""


def limited_rows(run: Run, axis: str) -> Bits | None:
    """Return what limited an axis in each row in which its coupling acted, None: not recorded."""
    bits = run.read(f"{axis}.limited").get(f"{axis}.limited")
    if bits is None:
        return None
    engaged = engaged_rows(run)
    kept = np.nan_to_num(bits if engaged is None else bits[engaged]).astype(np.int64)
    acted: Bits = kept[kept & STOPPED == 0]
    return acted


def met_rows(run: Run, axis: str, bits: int) -> tuple[int, int]:
    """Return in how many rows one of some limits was met, and of how many the coupling's."""
    acted = limited_rows(run, axis)
    if acted is None:
        return 0, 0
    return int(np.count_nonzero(acted & bits)), len(acted)
