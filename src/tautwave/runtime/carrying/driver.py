"""A driver whose axes carry their loads: the controller sees devices that weigh nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from tautwave.contracts import Driver
from tautwave.runtime.carrying.side import SideLoad
from tautwave.types import SAFE_COMMAND, AxisCommand, CommandDelay, Fault, JointState


class CarryingDriver:
    """A driver whose axes carry their loads; in all else the driver itself.

    Parameters
    ----------
    driver : Driver
        The driver.
    seats : sequence
        Per axis of the driver its side's loads and its number there, None without a load.
    period_ns : int
        Of the bus.
    """

    def __init__(
        self, driver: Driver, seats: Sequence[tuple[SideLoad, int] | None], period_ns: int
    ) -> None:
        self._driver = driver
        self._seats = seats
        self._period_ns = period_ns
        self._deadline_ns: int | None = None
        self.command_delay: CommandDelay = driver.command_delay
        self.enable_step = driver.enable_step
        self.request = driver.request
        self.disable = driver.disable
        self.close = driver.close

    def __getattr__(self, name: str) -> Any:
        """Return what else a driver may have: `poll`, `notes`."""
        return getattr(self._driver, name)

    def open(self) -> None:
        """Open the driver, at the start or for a reset; no earlier effort acts any more."""
        for seat in self._seats:
            if seat is not None:
                seat[0].drop(seat[1])
        self._driver.open()

    def faults(self) -> Sequence[Fault]:
        """Return the faults reported since the last call."""
        return self._driver.faults()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the driver's samples, and close the loads' books with them."""
        states = self._driver.read(deadline_ns)
        slots = 0
        if self._deadline_ns is not None:
            slots = max(round((deadline_ns - self._deadline_ns) / self._period_ns), 0)
        self._deadline_ns = deadline_ns
        for state, seat in zip(states, self._seats, strict=False):
            if seat is not None:
                side, which = seat
                side.pass_slots(which, slots)
                if state.valid and math.isfinite(state.position):
                    side.take(which, state.position)
        return states

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Add the loads to the commands; a safe command stays what it is."""
        sent = []
        for command, seat in zip(commands, self._seats, strict=True):
            if seat is None:
                sent.append(command)
            elif command is SAFE_COMMAND:
                seat[0].rest(seat[1])
                sent.append(command)
            else:
                sent.append(AxisCommand(command.effort + seat[0].effort(seat[1]), command.velocity))
        self._driver.write(sent)
