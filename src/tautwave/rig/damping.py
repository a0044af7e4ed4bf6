"""From a rig to drivers whose motors damp near walls only."""

from __future__ import annotations

from collections.abc import Sequence

from tautwave.config import Rig, axis_damper
from tautwave.rig.rates import damper_reach
from tautwave.runtime.control import Control
from tautwave.runtime.damping import DampedAxis, DampingDriver
from tautwave.runtime.sensing import LoopBus


def damped(rig: Rig, buses: Sequence[LoopBus], control: Control) -> list[LoopBus]:
    """Return the buses of a rig, with the dampers that are commanded."""
    if rig.scene is not None:
        return list(buses)  # it has no local walls
    order = [name for bus in buses for name in bus.axes]
    with_dampers = []
    for bus in buses:
        axes: list[DampedAxis | None] = []
        for name in bus.axes:
            damper = axis_damper(rig, name)
            if damper is None or not damper.commanded:
                axes.append(None)
                continue
            reach = damper_reach(rig, name, damper, bus.driver.command_delay)
            axes.append(DampedAxis(order.index(name), damper.damping, reach))
        if any(axis is not None for axis in axes):
            bus = bus._replace(driver=DampingDriver(bus.driver, axes, control))
        with_dampers.append(bus)
    return with_dampers
