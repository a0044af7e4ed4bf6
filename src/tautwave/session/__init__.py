"""One run from rig file to report, and the check before it.

The names below are imported when they are first used: a check loads nothing of what moves motors.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tautwave.session.checking import CheckResult, check
    from tautwave.session.devices import describe_ways
    from tautwave.session.operator import Session
    from tautwave.session.running import RunResult, run

__all__ = ["CheckResult", "RunResult", "Session", "check", "describe_ways", "run"]

_HOME = {
    "CheckResult": "checking",
    "RunResult": "running",
    "Session": "operator",
    "check": "checking",
    "describe_ways": "devices",
    "run": "running",
}


def __getattr__(name: str) -> Any:
    home = _HOME.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{home}"), name)
    globals()[name] = value
    return value
