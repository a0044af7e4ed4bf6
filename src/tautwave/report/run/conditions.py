"""Which conditions of its certificate a run did not keep: those that its rows can tell."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from tautwave.laws.limit import AT_LIMIT, CLIPPED, RATE_LIMITED, STOPPED
from tautwave.report.run.rundir import Run, block, engaged_rows
from tautwave.report.units import count, number, plural

Bits = npt.NDArray[np.int64]

KEPT_BY = (
    (re.compile(r"the effort_rate_limit of (\S+) is not reached"), RATE_LIMITED),
    (re.compile(r"the coupling of (\S+) asks for no more than"), CLIPPED | AT_LIMIT),
)
"""A condition by how it begins, with the axis that it is about, and the bits that break it."""

UNBROKEN = "no sample is lost and the host does not stall"
"""A condition on the loop itself."""


def broken_conditions(run: Run) -> Iterator[str]:
    """Yield the conditions that a run did not keep, each with how often, as sentences."""
    verdicts = block(run.summary, "certificate", "verdicts").values()
    found = [one for verdict in verdicts for one in block(verdict).get("conditions") or ()]
    for condition in dict.fromkeys(str(one) for one in found):
        for pattern, bits in KEPT_BY:
            begins = pattern.match(condition)
            if begins is not None:
                met, all_rows = met_rows(run, begins[1], bits)
                if met:
                    yield (
                        f"The certificate holds if {condition}; in {count(met)} of "
                        f"{count(all_rows)} cycles it was not so."
                    )
        if condition.startswith(UNBROKEN):
            lost = sum(
                int(number(block(axis).get("lost")) or 0)
                for axis in block(run.summary, "axes").values()
            )
            missed = int(number(run.summary.get("missed_cycles")) or 0)
            if lost or missed:
                yield (
                    f"The certificate holds if {condition}; {plural(lost, 'sample')} "
                    f"and {plural(missed, 'cycle')} were lost."
                )


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
