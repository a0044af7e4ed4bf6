"""The loop's first step: request from and read the buses; count missing and late samples, faults.

A bus with divisor n gets its request in slots j n and is read in slots j n + n - 1, so that an
exchange may take n - 1 slots and the loop never waits for it; its driver's `poll`, if it has one,
is called in the slots between, for an exchange of several requests. A request up to half a bus
period late still belongs to its slot, since drives round; later, the exchange is skipped. A
response that was not fetched in its slot is discarded: its pair has already booked a missing
sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from typing import NamedTuple

from tautwave.contracts import Driver
from tautwave.errors import DeviceFault, DriverError
from tautwave.runtime.control import Control
from tautwave.types import AxisCommand, Fault


class LoopBus(NamedTuple):
    """One driver and its axes, in the driver's order; it is served every `divisor`-th slot."""

    name: str
    driver: Driver
    axes: Sequence[str]
    divisor: int = 1

    def due(self, slot: int) -> bool:
        """Return whether the bus is read and written in this slot."""
        return self.divisor == 1 or slot % self.divisor == self.divisor - 1


def first_axes(buses: Sequence[LoopBus]) -> list[int]:
    """Return the number of each bus' first axis."""
    return [sum(len(other.axes) for other in buses[:at]) for at in range(len(buses))]


def bus_commands(control: Control, bus: LoopBus, first: int) -> list[AxisCommand]:
    """Return the commands of a bus' axes, of which the first has the number `first`."""
    return control.commands(first, len(bus.axes))


class Sensing:
    """Passes the samples of every axis to the controller, and keeps the faults.

    Parameters
    ----------
    buses : sequence of LoopBus
        The buses.
    control : Control
        Receives the samples.
    """

    def __init__(self, buses: Sequence[LoopBus], control: Control) -> None:
        axes = sum(len(bus.axes) for bus in buses)
        self._buses = buses
        self._firsts = first_axes(buses)
        self._control = control
        self._period_ns = control.run.period_ns
        self._asked = [-1] * len(buses)  # pending exchange of a slow bus
        self._polls = [getattr(bus.driver, "poll", None) for bus in buses]
        self.fault: DeviceFault | None = None
        self.lost = [0] * axes
        self.late = [0] * axes
        self.faults: list[Fault] = []
        self._until_stop = 0
        self.misses: dict[str, str] = {}
        """What drivers say of axes without a sample, by axis."""

    def sense(self, slot: int, deadline_ns: int) -> None:
        """Fill in the controller's samples; `fault` is the device fault that stopped the run.

        All requests leave before the first answer is read, so that buses wait at the same time
        and a cycle takes as long as the slowest, not as their sum. Reading ends at `deadline_ns`;
        what has not come by then is missing in this cycle, of those axes alone. Faults are looked
        at before missing samples are counted: a drive that says why it is silent is a better
        reason to stop than silence. Afterwards each axis of a bus that was due has a new sample,
        valid or not, and the axes of a slow bus between its slots keep theirs.
        """
        control = self._control
        for number, bus in enumerate(self._buses):
            if bus.divisor == 1:
                bus.driver.request()
            else:
                self._ask(number, bus, slot)
                poll = self._polls[number]
                if poll is not None and self._asked[number] >= 0:
                    poll()
        for number, bus in enumerate(self._buses):
            first = self._firsts[number]
            if bus.divisor > 1:
                if not bus.due(slot):
                    continue
                asked, self._asked[number] = self._asked[number], -1
                if asked < 0:
                    # The loop was too late to send the request: no sample counts as missing.
                    control.on_missing(first, len(bus.axes))
                    continue
            measured = bus.driver.read(deadline_ns)
            if len(measured) != len(bus.axes):
                raise DriverError(
                    f"bus {bus.name!r}: {len(measured)} samples for {len(bus.axes)} axes; "
                    "its driver must return one per axis, valid or not"
                )
            self._take_faults(bus, first, slot)  # first: they tell more than a missing sample
            unusable = control.on_samples(first, measured, slot)
            for which in unusable:
                self.lost[which] += 1
            if unusable:
                self.misses.update(getattr(bus.driver, "misses", {}))
            stale_ns = self._period_ns * bus.divisor
            for which, (_, _, _, _, age_ns) in enumerate(measured, first):
                if age_ns > stale_ns and which not in unusable:
                    self.late[which] += 1

    def take_last_faults(self) -> None:
        """Keep what was reported after the last cycle, by devices that were being switched off."""
        for bus in self._buses:
            with suppress(Exception):  # the run is over, whatever its driver does
                self.faults += [_named(bus, fault) for fault in bus.driver.faults()]

    @property
    def later_faults(self) -> Sequence[Fault]:
        """What was reported once the controller had its reason to stop."""
        return self.faults[self._until_stop :]

    def _take_faults(self, bus: LoopBus, first: int, slot: int) -> None:
        """Keep the faults of a bus, and stop for one that is fatal."""
        for fault in map(partial(_named, bus), bus.driver.faults()):
            self.faults.append(fault)
            if not self._control.stopped:
                self._until_stop = len(self.faults)
            which = first + bus.axes.index(fault.axis) if fault.axis in bus.axes else -1
            if fault.fatal and self._control.fault(slot, which, fault.text):
                self.fault = DeviceFault(fault.text)

    def _ask(self, number: int, bus: LoopBus, slot: int) -> None:
        """Begin an exchange on a slow bus, if this is the slot for it."""
        exchange, phase = divmod(slot, bus.divisor)
        if 0 <= self._asked[number] < exchange:
            first = self._firsts[number]
            bus.driver.read(0)
            bus.driver.write(bus_commands(self._control, bus, first))
            self._asked[number] = -1
            self._control.on_missing(first, len(bus.axes))
        on_time = phase == 0 or 2 * (phase + 1) <= bus.divisor
        if on_time and self._asked[number] < 0:
            bus.driver.request()
            self._asked[number] = exchange


def _named(bus: LoopBus, fault: Fault) -> Fault:
    """Return a fault whose text begins with its axis, or the bus."""
    who = fault.axis or bus.name
    named = fault.text.startswith((f"{who} ", f"{who}:"))
    return fault if named else fault._replace(text=f"{who}: {fault.text}")
