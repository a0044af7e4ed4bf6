"""Devices without a bus: a driver whose other end is the physics itself, in one process.

It has no bytes and no bus time. The drive latches on the loop's slots (see `axis`); what it does
not model is a host so late that a command misses its slot by half a period.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from tautwave.contracts import (
    AxisSpec,
    Budget,
    BusSpec,
    Clock,
    DriverPlugin,
    Endpoint,
    ScanProgress,
    SimulatorPlugin,
    no_progress,
)
from tautwave.driver_base import DriverBase
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay, JointState

if TYPE_CHECKING:
    from tautwave.truth import AxisModel
    from tautwave_sim.axis import SimulatedAxis
    from tautwave_sim.loaded import ArmPhysics


class LoopbackOptions(BaseModel):
    """Options of a loopback bus."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    command_delay_s: Annotated[float, Field(ge=0.0)] = 0.0
    """Time until a command acts [s], as the driver declares it; with a divisor, at least a period
    of the bus."""


class LoopbackSimulator:
    """The axes of one loopback bus and the grid on which they move."""

    def __init__(self, axes: Sequence[AxisSpec], truths: Sequence[AxisModel]) -> None:
        self.axes: list[SimulatedAxis] = []
        self.arms: list[ArmPhysics] = []
        if truths:  # a check asks the driver, and simulates nothing
            from tautwave_sim.axis import SimulatedAxis, join_arms

            self.axes = [
                SimulatedAxis(spec.name, truth, truth.loop)
                for spec, truth in zip(axes, truths, strict=True)
            ]
            self.arms = join_arms(self.axes, truths)
        self._period_ns = round(truths[0].period * 1e9) if truths else 0
        self._origin_ns: int | None = None
        self._slot = 0
        self.transport = self

    def rest(self) -> None:
        """Hold still: the next `advance` begins a new grid at its own time."""
        self._origin_ns = None

    def advance(self, to_ns: int) -> None:
        """Move all axes over the slots that have passed at `to_ns`."""
        if self._origin_ns is None:
            self._origin_ns = to_ns
            self._slot = 0
            return
        slot = (to_ns - self._origin_ns + self._period_ns // 2) // self._period_ns
        while self._slot < slot:
            for axis in self.axes:
                axis.pass_slot()
            self._slot += 1
            self.settle()

    def settle(self) -> None:
        """A slot has passed, and all axes with it."""

    def measure(self) -> list[JointState]:
        """Return what every axis measures at this slot."""
        return [axis.measure() for axis in self.axes]

    def command(self, values: Sequence[float]) -> None:
        """Hand one number to every axis."""
        for axis, value in zip(self.axes, values, strict=True):
            axis.command(value)

    def close(self) -> None:
        """Nothing to release."""


def _taken(spec: AxisSpec) -> int:
    """Return which number of a command an axis takes."""
    name = "velocity" if spec.causality == "admittance" else "effort"
    return AxisCommand._fields.index("position" if spec.takes_position else name)


class LoopbackDriver(DriverBase):
    """Driver for the axes of a `LoopbackSimulator`."""

    def __init__(
        self,
        options: LoopbackOptions,
        bus: BusSpec,
        clock: Clock,
        transport: LoopbackSimulator | None,
    ) -> None:
        super().__init__(bus)  # the devices are in this process: they stop with it
        self._world = transport if transport is not None else LoopbackSimulator((), ())
        self._clock = clock
        self._taken = [_taken(spec) for _, spec in zip(self._world.axes, bus.axes, strict=False)]
        period = 1.0 / bus.rate_hz
        delay = options.command_delay_s
        if bus.divisor > 1:
            delay = max(delay, period)  # written just before the next latch, which it waits for
        periods = math.floor(delay / period + 1e-9)
        rest = delay - periods * period
        # Rounding leaves a rest of a whole number of periods: that is none, as in `axis`.
        self.command_delay = CommandDelay(periods, rest if rest > 1e-9 * period else 0.0)

    def _bring_up(self) -> None:
        """Torque off; the devices are held until they are enabled."""
        self._world.rest()

    def _enable(self) -> bool:
        """Enable at once; there is nothing to wait for."""
        self._on = True
        return True

    def request(self) -> None:
        """Bring the physics to the present slot."""
        if self._on:
            self._world.advance(self._clock.now_ns())

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return what every axis measures at this slot; `deadline_ns` is never needed."""
        return self._world.measure()

    def _take(self, commands: Sequence[AxisCommand]) -> None:
        """Hand one command to every axis."""
        taken = zip(commands, self._taken, strict=True)
        self._world.command([command[which] for command, which in taken])

    def disable(self) -> None:
        """Zero command on every axis, then ignore commands."""
        self.write([SAFE_COMMAND] * self._count)
        self._on = False

    def _release(self) -> None:
        """Nothing is open."""


def _make(options: LoopbackOptions, bus: BusSpec, clock: Clock, transport: Any) -> LoopbackDriver:
    return LoopbackDriver(options, bus, clock, transport)


def _simulate(
    options: LoopbackOptions, bus: BusSpec, physics: Sequence[Any], clock: Clock
) -> LoopbackSimulator:
    if bus.divisor > 1:
        physics = [it._replace(command_delay=max(it.command_delay, 1.0)) for it in physics]
    return LoopbackSimulator(bus.axes, physics)


def _budget(options: LoopbackOptions, bus: BusSpec) -> Budget:
    return Budget(0.0, float("inf"), "no bus: nothing is transmitted")


def _scan(options: Any, progress: ScanProgress = no_progress) -> Sequence[dict[str, Any]]:
    return ()


plugin = DriverPlugin(
    options=LoopbackOptions,
    make=_make,
    budget=_budget,
    scan=_scan,
    hardware=False,
    summary="simulated devices without a bus, in this process",
    endpoint=lambda options: Endpoint("none"),
    positions=True,
)
simulator = SimulatorPlugin(
    options=LoopbackOptions,
    make=_simulate,
    summary="the devices behind the loopback driver",
    arms=True,
    loops=True,
)
