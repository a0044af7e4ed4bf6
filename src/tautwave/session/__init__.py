"""One run from rig file to report, and the check before it."""

from tautwave.session.checking import CheckResult, check
from tautwave.session.devices import describe_ways
from tautwave.session.operator import Session
from tautwave.session.running import RunResult, run

__all__ = ["CheckResult", "RunResult", "Session", "check", "describe_ways", "run"]
