"""A driver whose motors damp near walls only: the controller does not know of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from tautwave.contracts import Driver
from tautwave.runtime.control import Control
from tautwave.types import SAFE_COMMAND, AxisCommand, JointState
from tautwave.wrapper import DriverWrapper


class DampedAxis(NamedTuple):
    """An axis whose motor damps on command.

    `which` it is in the controller; `damping` [N m s/rad or N s/m]; it acts from `reach` [rad or m]
    before the wall on, and until the axis is twice as far away.
    """

    which: int
    damping: float
    reach: float


class DampingDriver(DriverWrapper):
    """A driver some of whose motors damp on command: near a wall, in it, and while the axis stops.

    A wall's effort and its damper are of one command, so neither acts without the other. Where an
    axis is not known to be away from its wall, it is damped.

    Parameters
    ----------
    driver : Driver
        The driver.
    axes : sequence of DampedAxis or None
        Per axis of the driver, None where nothing is commanded.
    control : Control
        Has the walls, as they are tuned, and the axes; also an attribute, for another controller
        that takes its place.
    """

    def __init__(self, driver: Driver, axes: Sequence[DampedAxis | None], control: Control) -> None:
        super().__init__(driver)
        self._axes = axes
        self.control = control
        self._on = [True] * len(axes)

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the driver's samples, and see how far each axis is from its wall."""
        states = self._driver.read(deadline_ns)
        for at, (state, axis) in enumerate(zip(states, self._axes, strict=True)):
            if axis is None or not state.valid:
                continue
            site = self.control.quick[axis.which].site
            if site.has_wall:
                depth = site.wall.side * (state.position - site.wall.position)
                far = axis.reach * (2.0 if self._on[at] else 1.0)
                self._on[at] = not depth < -far  # NaN: damped
            else:
                self._on[at] = False
        return states

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Send the commands, with the damper of each axis that is to be damped."""
        sent = []
        for on, command, axis in zip(self._on, commands, self._axes, strict=True):
            if axis is None or command is SAFE_COMMAND:
                sent.append(command)
            elif on or self.control.axes[axis.which].stopping:
                sent.append(command._replace(damping=axis.damping))
            else:
                sent.append(command)
        self._driver.write(sent)
