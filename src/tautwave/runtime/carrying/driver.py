"""A driver whose axes carry their loads: the controller sees devices that weigh nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence

from tautwave.contracts import Driver
from tautwave.runtime.carrying.side import SideLoad
from tautwave.types import SAFE_COMMAND, AxisCommand, JointState
from tautwave.wrapper import DriverWrapper, SlotCount


class CarryingDriver(DriverWrapper):
    """A driver whose axes carry their loads.

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
        super().__init__(driver)
        self._seats = seats
        self._slots = SlotCount(period_ns)

    def open(self) -> None:
        """Open the driver, at the start or for a reset; no earlier effort acts any more."""
        for axis_index in self._seats:
            if axis_index is not None:
                axis_index[0].drop(axis_index[1])
        super().open()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the driver's samples, and close the loads' books with them."""
        states = self._driver.read(deadline_ns)
        slots = self._slots.passed(deadline_ns)
        for state, axis_index in zip(states, self._seats, strict=False):
            if axis_index is not None:
                side, which = axis_index
                side.pass_slots(which, slots)
                if state.valid and math.isfinite(state.position):
                    side.take(which, state.position)
        return states

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Add the loads to the commands; a safe command stays what it is."""
        sent = []
        for command, axis_index in zip(commands, self._seats, strict=True):
            if axis_index is None:
                sent.append(command)
            elif command is SAFE_COMMAND:
                axis_index[0].rest(axis_index[1])
                sent.append(command)
            else:
                effort = command.effort + axis_index[0].effort(axis_index[1])
                sent.append(
                    AxisCommand(effort, command.velocity, command.position, command.damping)
                )
        self._driver.write(sent)
