"""The loop's first step: ask the buses, read the buses, count what is missing, late or broken.

A bus with divisor n is asked in slots j n and read in slots j n + n - 1, so that an exchange may
take n - 1 slots and the loop never waits for it; its driver's `poll`, if it has one, is called in
the slots between, for an exchange of several questions. A request up to half a bus period late
still belongs to its slot, as drives round; later, the exchange is left out. An answer that nobody
fetched in its slot is thrown away: its pair has booked a missing sample by then.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import Driver
from tautwave.errors import DeviceFault, DriverError, SafetyStop, TautwaveError
from tautwave.runtime.site import SiteAxis
from tautwave.types import Fault, JointState

ABSENT = JointState(0.0, 0.0, 0.0, False, 0)


class LoopBus(NamedTuple):
    """One driver and its axes, in the driver's order; it is served every `divisor`-th slot."""

    name: str
    driver: Driver
    sites: Sequence[SiteAxis]
    axes: Sequence[str]
    divisor: int = 1

    def due(self, slot: int) -> bool:
        """Return whether this slot is one in which the bus is read and written."""
        return self.divisor == 1 or slot % self.divisor == self.divisor - 1


class Sensing:
    """The latest sample of every axis, in bus order, and what went wrong getting it.

    Parameters
    ----------
    buses : sequence of LoopBus
        Who is asked.
    period_ns : int
        One cycle [ns]; a sample older than that of its bus is late.
    missing_limit : int
        Exchanges in a row without a sample of an axis that end the run.
    """

    def __init__(self, buses: Sequence[LoopBus], period_ns: int, missing_limit: int) -> None:
        axes = sum(len(bus.axes) for bus in buses)
        self._buses = buses
        self._period_ns = period_ns
        self._missing_limit = missing_limit
        self._missing = [0] * axes
        self._asked = [-1] * len(buses)  # exchange that a slow bus still has to answer
        self._polls = [getattr(bus.driver, "poll", None) for bus in buses]
        self._error: TautwaveError | None = None
        self.states: list[JointState] = [ABSENT] * axes
        self.lost = [0] * axes
        self.late = [0] * axes
        self.faults: list[Fault] = []

    def sense(self, slot: int, deadline_ns: int) -> TautwaveError | None:
        """Fill `states`; return the first thing that has to end the run, if any came up."""
        self._error = None
        for number, bus in enumerate(self._buses):
            if bus.divisor == 1:
                bus.driver.request()
            else:
                self._ask(number, bus, slot)
                poll = self._polls[number]
                if poll is not None and self._asked[number] >= 0:
                    poll()
        at = 0
        for number, bus in enumerate(self._buses):
            if bus.divisor > 1:
                if not bus.due(slot):
                    at += len(bus.axes)
                    continue
                asked, self._asked[number] = self._asked[number], -1
                if asked < 0:
                    # The loop was away when it should have asked: nobody's sample is missing.
                    self.states[at : at + len(bus.axes)] = [ABSENT] * len(bus.axes)
                    at += len(bus.axes)
                    continue
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
                who = fault.axis or bus.name
                named = fault.text.startswith((f"{who} ", f"{who}:"))
                told = fault.text if named else f"{who}: {fault.text}"
                self.faults.append(fault._replace(text=told))
                if fault.fatal and self._error is None:
                    self._error = DeviceFault(told)
        return self._error

    def _ask(self, number: int, bus: LoopBus, slot: int) -> None:
        """Begin an exchange on a slow bus, if this is the slot for it."""
        exchange, phase = divmod(slot, bus.divisor)
        if 0 <= self._asked[number] < exchange:
            bus.driver.read(0)
            bus.driver.write([site.axis_command() for site in bus.sites])
            self._asked[number] = -1
            at = sum(len(other.axes) for other in self._buses[:number])
            self.states[at : at + len(bus.axes)] = [ABSENT] * len(bus.axes)
        on_time = phase == 0 or 2 * (phase + 1) <= bus.divisor
        if on_time and self._asked[number] < 0:
            bus.driver.request()
            self._asked[number] = exchange

    def _take(self, at: int, bus: LoopBus, index: int, state: JointState) -> None:
        if state.valid and not self._finite(bus, index, state):
            state = ABSENT
        self.states[at] = state
        if state.valid:
            self._missing[at] = 0
            if state.age_ns > self._period_ns * bus.divisor:
                self.late[at] += 1
            return
        self.lost[at] += 1
        self._missing[at] += 1
        if self._missing[at] == self._missing_limit and self._error is None:
            self._error = DriverError(
                f"{bus.axes[index]} on bus {bus.name!r}: no sample in "
                f"{self._missing[at]} {'cycles' if bus.divisor == 1 else 'exchanges'} running; "
                "check power and cable"
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
