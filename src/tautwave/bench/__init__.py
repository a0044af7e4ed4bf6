"""Performance of this machine: cost of the laws, of the loop, of start-up, of an hour's memory.

Every figure is CPU time unless its table says otherwise, taken in short chunks between two runs of
a calibration kernel; goals are printed as ratios, not enforced: a measurement has no exit code.
"""

from __future__ import annotations

from tautwave.bench.buses import buses
from tautwave.bench.result import Goal, Suite, Table
from tautwave.bench.sites.suite import link
from tautwave.bench.suites import laws, loop, rates, view

__all__ = [
    "Goal",
    "Suite",
    "Table",
    "buses",
    "laws",
    "link",
    "loop",
    "rates",
    "view",
]
