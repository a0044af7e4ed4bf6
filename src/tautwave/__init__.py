"""Teleoperation over fieldbuses: a master and a slave device coupled by a taut string.

The public names below are imported when they are first used, so that `import tautwave`, and with
it the command line, stays light.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tautwave.clock import FakeClock, MonotonicClock
    from tautwave.config import Rig, load_rig
    from tautwave.contracts import Driver, DriverPlugin
    from tautwave.errors import ConfigError, DriverError, SafetyStop, TautwaveError
    from tautwave.recordings.recording import read_recording
    from tautwave.session import Session, check, run
    from tautwave.simulation import simulate
    from tautwave.simulation.stepper import Stepper
    from tautwave.types import AxisCommand, JointState

__version__ = "0.3.0"

__all__ = [
    "AxisCommand",
    "ConfigError",
    "Driver",
    "DriverError",
    "DriverPlugin",
    "FakeClock",
    "JointState",
    "MonotonicClock",
    "Rig",
    "SafetyStop",
    "Session",
    "Stepper",
    "TautwaveError",
    "check",
    "load_rig",
    "read_recording",
    "run",
    "simulate",
]

_MODULES = {
    "clock": ("FakeClock", "MonotonicClock"),
    "config": ("Rig", "load_rig"),
    "contracts": ("Driver", "DriverPlugin"),
    "errors": ("ConfigError", "DriverError", "SafetyStop", "TautwaveError"),
    "simulation": ("simulate",),
    "simulation.stepper": ("Stepper",),
    "recordings.recording": ("read_recording",),
    "session": ("Session", "check", "run"),
    "types": ("AxisCommand", "JointState"),
}
_HOME = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    module = _HOME.get(name)
    if module is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(f"{__name__}.{module}"), name)
    globals()[name] = value  # cached: later look-ups bypass this function
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
