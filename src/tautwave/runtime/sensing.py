"""The loop's first step: ask every bus, read every bus, count what is missing, late or broken."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import Driver
from tautwave.errors import DeviceFault, DriverError, SafetyStop, TautwaveError
from tautwave.runtime.site import SiteAxis
from tautwave.types import JointState

ABSENT = JointState(0.0, 0.0, 0.0, False, 0)


class LoopBus(NamedTuple):
    """One driver and its axes, in the driver's order."""

    name: str
    driver: Driver
    sites: Sequence[SiteAxis]
    axes: Sequence[str]


class Sensing:
    """The latest sample of every axis, in bus order, and what went wrong getting it.

    Parameters
    ----------
    buses : sequence of LoopBus
        Who is asked.
    period_ns : int
        One cycle [ns]; an older sample is late.
    missing_limit : int
        Cycles in a row without a sample of an axis that end the run.
    """

    def __init__(self, buses: Sequence[LoopBus], period_ns: int, missing_limit: int) -> None:
        axes = sum(len(bus.axes) for bus in buses)
        self._buses = buses
        self._period_ns = period_ns
        self._missing_limit = missing_limit
        self._missing = [0] * axes
        self._error: TautwaveError | None = None
        self.states: list[JointState] = [ABSENT] * axes
        self.lost = [0] * axes
        self.late = [0] * axes
        self.faults: list[str] = []

    def sense(self, deadline_ns: int) -> TautwaveError | None:
        """Fill `states`; return the first thing that has to end the run, if any came up."""
        self._error = None
        for bus in self._buses:
            bus.driver.request()
        at = 0
        for bus in self._buses:
            measured = bus.driver.read(deadline_ns)
            if len(measured) != len(bus.axes):
                raise DriverError(
                    f"bus {bus.name!r}: {len(measured)} samples for {len(bus.axes)} axes; "
                    "its driver has to return one per axis, valid or not"
                )
            for index, state in enumerate(measured):
                self._take(at, bus, index, state)
                at += 1
            for fault in bus.driver.faults():
                self.faults.append(f"{fault.axis or bus.name}: {fault.text}")
                if fault.fatal and self._error is None:
                    self._error = DeviceFault(self.faults[-1])
        return self._error

    def _take(self, at: int, bus: LoopBus, index: int, state: JointState) -> None:
        if state.valid and not self._finite(bus, index, state):
            state = ABSENT
        self.states[at] = state
        if state.valid:
            self._missing[at] = 0
            if state.age_ns > self._period_ns:
                self.late[at] += 1
            return
        self.lost[at] += 1
        self._missing[at] += 1
        if self._missing[at] == self._missing_limit and self._error is None:
            self._error = DriverError(
                f"{bus.axes[index]} on bus {bus.name!r}: no sample in "
                f"{self._missing[at]} cycles running; check power and cable"
            )

    def _finite(self, bus: LoopBus, index: int, state: JointState) -> bool:
        """Return False when what a driver calls valid is no number: the run has to end."""
        effort = 0.0 if bus.sites[index].impedance else state.effort
        total = state.position + effort
        if total - total == 0.0:
            return True
        if self._error is None:
            told = f"{bus.axes[index]}: measured position {state.position}, effort {state.effort}"
            self._error = SafetyStop(f"{told}; a sensor or its driver is broken")
        return False
