"""An arm as a bus: the coordinates of its tip are axes, its joints are on a bus behind it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tautwave.contracts import (
    AxisFacts,
    Budget,
    BusSpec,
    Clock,
    Driver,
    DriverPlugin,
    Endpoint,
    ScanProgress,
    no_progress,
)
from tautwave.errors import ConfigError
from tautwave.registry import load_driver
from tautwave.types import BusElement
from tautwave_drivers.arm.driver import ArmDriver
from tautwave_drivers.arm.following import FollowingArm
from tautwave_drivers.arm.options import ArmOptions, accept, follows, joint_bus


def _make(options: ArmOptions, bus: BusSpec, clock: Clock, transport: Any) -> Driver:
    make = FollowingArm if follows(bus) else ArmDriver
    return make(options, bus, clock, transport)


def _budget(options: ArmOptions, bus: BusSpec) -> Budget:
    plugin = load_driver(options.bus.driver)
    budget: Budget = plugin.budget(
        plugin.options.model_validate(options.bus.options), joint_bus(options, bus)
    )
    return budget


def _facts(options: ArmOptions, bus: BusSpec) -> Sequence[AxisFacts]:
    accept(options, bus)
    return [AxisFacts()] * len(bus.axes)


def _endpoint(options: ArmOptions) -> Endpoint:
    plugin = load_driver(options.bus.driver)
    if plugin.endpoint is not None:
        endpoint: Endpoint = plugin.endpoint(plugin.options.model_validate(options.bus.options))
        return endpoint
    return Endpoint("real" if plugin.hardware else "none")


def _elements(
    options: ArmOptions, bus: BusSpec, axes: Mapping[str, Any], late: float
) -> Sequence[BusElement]:
    from tautwave_drivers.arm.verdict import arm_elements  # needs NumPy, a live loop does not

    return arm_elements(options, bus, axes, late)


def _scan(options: Any, progress: ScanProgress = no_progress) -> Sequence[dict[str, Any]]:
    raise ConfigError("an arm cannot be scanned; scan the bus of its joints instead")


plugin = DriverPlugin(
    options=ArmOptions,
    make=_make,
    budget=_budget,
    scan=_scan,
    hardware=True,
    summary="the tip of an arm whose joints are on a bus of another driver",
    facts=_facts,
    endpoint=_endpoint,
    files=(("chain", "urdf"), ("truth", "chain", "urdf")),
    elements=_elements,
    plain=True,
    columns="tautwave_drivers.arm.columns:COLUMNS",
)
