"""What authors of drivers, simulators, couplings, environments and hands may use.

    from tautwave.plugin import Budget, BusSpec, DriverPlugin, JointState

The names below are kept, as those of `tautwave.__all__` are, but provisional until 0.3: a record
may gain fields with defaults, a protocol members that have one. Everything else is internal. As
with `tautwave` itself, a name is imported when it is first used. The suites that a plugin should
pass are in `tautwave.testing`.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tautwave.certificate.data import CouplingVerdict, Element, Verdict
    from tautwave.clock import FakeClock, MonotonicClock
    from tautwave.columns import Column
    from tautwave.config import Coupling, EnvironmentPart, HandPart, Pair, Rig
    from tautwave.contracts import (
        AxisFacts,
        AxisSpec,
        Bench,
        Budget,
        BusSpec,
        BytePort,
        Clock,
        CoupledAxis,
        CouplingPlugin,
        CycleCost,
        Driver,
        DriverPlugin,
        Endpoint,
        FramePort,
        InMemory,
        Row,
        RowSource,
        ScanProgress,
        Simulator,
        SimulatorPlugin,
    )
    from tautwave.controller.records import AxisParams, AxisState, PairParams, PairView
    from tautwave.controller.seen import seen_law
    from tautwave.controller.steps import OWN_GUARDS, Guard, Law, Steps, fill_each
    from tautwave.device_settings import (
        DeviceSetting,
        DeviceSettings,
        Lasts,
        SettingRefusedError,
        Settled,
        refuse_differences,
    )
    from tautwave.driver_base import DriverBase
    from tautwave.errors import (
        BusTimeout,
        ConfigError,
        DeviceFault,
        DriverError,
        SettingsDifferError,
        TautwaveError,
    )
    from tautwave.truth import AxisModel, EnvironmentPlugin, HandPlugin
    from tautwave.types import (
        AxisCommand,
        BusElement,
        Choice,
        CommandDelay,
        Damper,
        Fault,
        FoundBus,
        FoundDevice,
        Imposed,
        JointState,
        Setting,
        Survey,
    )
    from tautwave.wording import CouplingMessages

_MODULES = {
    "certificate.data": ("CouplingVerdict", "Element", "Verdict"),
    "clock": ("FakeClock", "MonotonicClock"),
    "columns": ("Column",),
    "config": ("Coupling", "EnvironmentPart", "HandPart", "Pair", "Rig"),
    "contracts": (
        "AxisFacts", "AxisSpec", "Bench", "Budget", "BusSpec", "BytePort", "Clock", "CoupledAxis",
        "CouplingPlugin", "CycleCost", "Driver", "DriverPlugin", "Endpoint", "FramePort",
        "InMemory", "Row", "RowSource", "ScanProgress", "Simulator", "SimulatorPlugin",
    ),
    "controller.records": ("AxisParams", "AxisState", "PairParams", "PairView"),
    "controller.seen": ("seen_law",),
    "controller.steps": ("OWN_GUARDS", "Guard", "Law", "Steps", "fill_each"),
    "device_settings": (
        "DeviceSetting", "DeviceSettings", "Lasts", "SettingRefusedError", "Settled",
        "refuse_differences",
    ),
    "driver_base": ("DriverBase",),
    "errors": (
        "BusTimeout", "ConfigError", "DeviceFault", "DriverError", "SettingsDifferError",
        "TautwaveError",
    ),
    "truth": ("AxisModel", "EnvironmentPlugin", "HandPlugin"),
    "types": (
        "AxisCommand", "BusElement", "Choice", "CommandDelay", "Damper", "Fault", "FoundBus",
        "FoundDevice", "Imposed", "JointState", "Setting", "Survey",
    ),
    "wording": ("CouplingMessages",),
}  # fmt: skip
_HOME = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "OWN_GUARDS",
    "AxisCommand",
    "AxisFacts",
    "AxisModel",
    "AxisParams",
    "AxisSpec",
    "AxisState",
    "Bench",
    "Budget",
    "BusElement",
    "BusSpec",
    "BusTimeout",
    "BytePort",
    "Choice",
    "Clock",
    "Column",
    "CommandDelay",
    "ConfigError",
    "CoupledAxis",
    "Coupling",
    "CouplingMessages",
    "CouplingPlugin",
    "CouplingVerdict",
    "CycleCost",
    "Damper",
    "DeviceFault",
    "DeviceSetting",
    "DeviceSettings",
    "Driver",
    "DriverBase",
    "DriverError",
    "DriverPlugin",
    "Element",
    "Endpoint",
    "EnvironmentPart",
    "EnvironmentPlugin",
    "FakeClock",
    "Fault",
    "FoundBus",
    "FoundDevice",
    "FramePort",
    "Guard",
    "HandPart",
    "HandPlugin",
    "Imposed",
    "InMemory",
    "JointState",
    "Lasts",
    "Law",
    "MonotonicClock",
    "Pair",
    "PairParams",
    "PairView",
    "Rig",
    "Row",
    "RowSource",
    "ScanProgress",
    "Setting",
    "SettingRefusedError",
    "SettingsDifferError",
    "Settled",
    "Simulator",
    "SimulatorPlugin",
    "Steps",
    "Survey",
    "TautwaveError",
    "Verdict",
    "fill_each",
    "refuse_differences",
    "seen_law",
]


def __getattr__(name: str) -> Any:
    module = _HOME.get(name)
    if module is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    import importlib

    value = getattr(importlib.import_module(f"tautwave.{module}"), name)
    globals()[name] = value  # cached: later look-ups bypass this function
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
