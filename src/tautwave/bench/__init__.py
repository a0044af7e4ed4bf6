"""Performance of this machine: cost of the laws, of the loop, of start-up, of an hour's memory.

Every figure is CPU time unless its table says otherwise, taken in short chunks between two runs of
a calibration kernel; goals are printed as ratios, not enforced: a measurement has no exit code.
"""

from __future__ import annotations

from tautwave.bench.buses import buses
from tautwave.bench.compensation import compensation
from tautwave.bench.couplings.frontier_suite import frontier_suite
from tautwave.bench.couplings.long_delays import long_delays
from tautwave.bench.couplings.suite import couplings
from tautwave.bench.extremes.suite import extremes
from tautwave.bench.lines.suite import network
from tautwave.bench.networks import networks
from tautwave.bench.plain.lanes import lanes
from tautwave.bench.port.long_hold import holding
from tautwave.bench.port.suite import port
from tautwave.bench.result import Goal, Suite, Table
from tautwave.bench.sites.suite import link
from tautwave.bench.suites import laws, loop, rates, view
from tautwave.bench.workprecision.suite import workprecision

__all__ = [
    "Goal",
    "Suite",
    "Table",
    "buses",
    "compensation",
    "couplings",
    "extremes",
    "frontier_suite",
    "holding",
    "lanes",
    "laws",
    "link",
    "long_delays",
    "loop",
    "network",
    "networks",
    "port",
    "rates",
    "view",
    "workprecision",
]
