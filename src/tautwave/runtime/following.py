"""A driver some of whose axes take positions: between them and the loop stand goals and springs.

To the loop such an axis takes velocity and measures effort: it is where its goal is, and the effort
is that of a spring from there to the device (`tautwave.laws.servo.follower`). A command moves the
goal after the delay that the driver declares; the device is sent at once to where it will be, so
that the delay is no part of its lag. A host that stalls sends nothing, and the device stays.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from tautwave.columns import Column
from tautwave.contracts import Driver, Row
from tautwave.laws.servo.follower import FollowerParams, goal_effort, next_goal
from tautwave.types import AxisCommand, CommandDelay, JointState
from tautwave.wrapper import DriverWrapper

FOLLOWED = Column(
    "followed",
    "rad, m",
    "followers: where the device was measured last; `position` is its goal, and"
    " `measured_effort` the spring between them",
)
"""What is recorded of an axis that takes positions."""


class Goal:
    """The goal of one axis; `sent` is ahead of it by the commands that are on their way."""

    def __init__(self, params: FollowerParams, delay: CommandDelay) -> None:
        self._params = params
        self._late = delay.remainder_s / params.period
        self._way = deque([math.nan] * (delay.periods + 2), maxlen=delay.periods + 2)
        self.place = self.sent = math.nan

    def clear(self) -> None:
        """Discard the device's position."""
        self.place = self.sent = math.nan

    def take(self, state: JointState) -> JointState:
        """Return what the loop sees of a sample; the first one says where the goal begins."""
        if not state.valid or not math.isfinite(state.position):
            return state
        self.place = state.position
        if math.isnan(self.sent):
            self.sent = self.place
            self._way.extend([self.place] * len(self._way))
        goal = self._way[1]
        if self._late > 0.0:
            goal += self._late * (self._way[0] - goal)
        return state._replace(
            position=goal, velocity=math.nan, effort=goal_effort(self._params, goal, self.place)
        )

    def move(self, command: AxisCommand) -> AxisCommand:
        """Return a command with where the device is to go; NaN before its first sample."""
        if not math.isnan(self.sent):
            self.sent = next_goal(self._params, self.sent, command.velocity, self.place)
            self._way.append(self.sent)
        return AxisCommand(0.0, command.velocity, self.sent)


class FollowingDriver(DriverWrapper):
    """A driver with followers among its axes.

    Parameters
    ----------
    driver : Driver
        The driver.
    names : sequence of str
        Full names of its axes.
    params : sequence
        Of each axis; None where it is no follower.
    """

    def __init__(
        self, driver: Driver, names: Sequence[str], params: Sequence[FollowerParams | None]
    ) -> None:
        super().__init__(driver)
        self._goals = [None if p is None else Goal(p, driver.command_delay) for p in params]
        self.columns = [
            f"{name}.{FOLLOWED.name}" for name, goal in zip(names, self._goals, strict=True) if goal
        ]

    def open(self) -> None:
        """Open the driver; goals begin where the devices are then."""
        for goal in self._goals:
            if goal is not None:
                goal.clear()
        super().open()

    def read(self, deadline_ns: int) -> Sequence[JointState]:
        """Return the driver's samples, of followers the goal and the effort of the spring."""
        return [
            state if goal is None else goal.take(state)
            for state, goal in zip(self._driver.read(deadline_ns), self._goals, strict=True)
        ]

    def write(self, commands: Sequence[AxisCommand]) -> None:
        """Send commands, followers to their goals."""
        self._driver.write(
            [
                command if goal is None else goal.move(command)
                for command, goal in zip(commands, self._goals, strict=True)
            ]
        )

    def fill(self, row: Row, at: int) -> None:
        """Record where the devices were measured last; NaN before that."""
        for goal in self._goals:
            if goal is not None:
                row[at] = goal.place
                at += 1
