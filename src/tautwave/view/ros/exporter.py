"""From a run's shared memory to ROS 2's topics, and a dead-man back."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from tautwave.clock import MonotonicClock
from tautwave.config import Rig
from tautwave.config.guard import parse_json
from tautwave.errors import ConfigError, RecordingError
from tautwave.view.ros.dead_man import TOPIC, DeadMan
from tautwave.view.ros.diagnostics import ended, statuses
from tautwave.view.ros.messages import (
    Bool,
    DiagnosticArray,
    DiagnosticStatus,
    Header,
    JointState,
    WrenchStamped,
)
from tautwave.view.ros.node import Node, taken
from tautwave.view.ros.states import joint_state, joints_of, stamp, tips_of, whole, wrench
from tautwave.view.watched import Watched

SOURCE = "ros"
FASTEST_HZ = 100.0
LOOK_NS = 10_000_000
DIAGNOSED_NS = 1_000_000_000
SETTLE_NS = 200_000_000
"""After the last message, before the node goes: for readers to fetch it."""


def refuse_rate(rate_hz: float) -> None:
    """Refuse a rate that these topics are not for.

    Raises
    ------
    ConfigError
        It is above 100 Hz.
    """
    if rate_hz > FASTEST_HZ:
        raise ConfigError(
            f"--rate {rate_hz:g}: at most {FASTEST_HZ:g} Hz, for displays and planners; every row"
            " is in the recording, as a ROS 2 message, and on `tautwave view --foxglove`"
        )


class Exporter:
    """Publishes one run.

    Parameters
    ----------
    run : Watched
        The run.
    rig : Rig
        What runs.
    node : Node
        Where it is published.
    rate_hz : float
        Of joint states and wrenches.
    allow_commands : bool
        Listen to the dead-man's topic.

    Raises
    ------
    ConfigError
        Commands are allowed for a rig that takes none.
    """

    def __init__(
        self, run: Watched, rig: Rig, node: Node, rate_hz: float, *, allow_commands: bool
    ) -> None:
        if allow_commands and run.facts.get("mailbox") is None:
            raise ConfigError(
                "--allow-commands: this run accepts no commands: its rig has no `operate` block, or"
                " its clock is fake"
            )
        self.run = run
        self.node = node
        self.topics: list[str] = []
        columns = run.live.columns
        self._joints = [
            (joints, self._publisher(f"{side}/joint_states", JointState))
            for side, joints in joints_of(columns, rig).items()
        ]
        self._tips = [
            (f"{side}_tip", tip, self._publisher(f"{side}/wrench", WrenchStamped))
            for side, tip in tips_of(columns, rig).items()
        ]
        self._diagnostics = self._publisher("/diagnostics", DiagnosticArray)
        self._bools = node.subscription(TOPIC, Bool) if allow_commands else None
        self._dead_man = DeadMan(self._send)
        self._every_ns = round(1e9 / rate_hz)
        self._time = list(columns).index("time_s")

    def _publisher(self, topic: str, message: Any) -> Any:
        self.topics.append(self.node.full(topic))
        return self.node.publisher(topic, message)

    def export(self, clock: MonotonicClock) -> None:
        """Publish until the run has ended."""
        look_ns = publish_ns = diagnose_ns = clock.now_ns()
        recent: list[list[float]] = []
        fresh: list[list[float]] = []
        while True:
            over = self.run.ended
            now = clock.now_ns()
            rows = self.run.tap.take()
            recent += rows
            fresh += rows
            if self._bools is not None and not over:
                self._dead_man.hear([one.data for one in taken(self._bools)], now)
            if fresh and (over or now >= publish_ns):
                publish_ns = max(publish_ns + self._every_ns, now - self._every_ns)
                self._publish(fresh)
                fresh = []
            if over:
                break
            if now >= diagnose_ns:
                diagnose_ns = now + DIAGNOSED_NS
                self._diagnose(recent)
                recent = []
            look_ns = max(look_ns + LOOK_NS, now)
            clock.sleep_until(look_ns)
        news = parse_json(self.run.tap.news() or "[]")
        self._tell(ended(self.run.live, news))
        clock.sleep_until(clock.now_ns() + SETTLE_NS)

    def _publish(self, rows: Sequence[Sequence[float]]) -> None:
        """Publish of each device the newest row that has all its samples; nothing is held."""
        for joints, writer in self._joints:
            row = _newest(rows, joints.valid)
            if row is not None:
                at = stamp(row[self._time], self.run.tap.epoch_ns)
                writer.write(joint_state(joints, row, at))
        for frame, tip, writer in self._tips:
            row = _newest(rows, tip.valid)
            if row is not None:
                at = stamp(row[self._time], self.run.tap.epoch_ns)
                writer.write(wrench(tip, row, at, frame))

    def _diagnose(self, rows: Sequence[Sequence[float]]) -> None:
        state = "" if self._bools is None else self._dead_man.state
        news = parse_json(self.run.tap.news() or "[]")
        self._tell(statuses(self.run.live, rows, self.run.tap.missed, news, state))

    def _tell(self, found: list[DiagnosticStatus]) -> None:
        self._diagnostics.write(DiagnosticArray(Header(stamp(0.0, time.time_ns()), ""), found))

    def _send(self, line: str) -> None:
        with suppress(RecordingError):  # it has ended meanwhile, or lets go for want of a `held`
            self.run.command(SOURCE, line)


def _newest(rows: Sequence[Sequence[float]], valid: Sequence[int]) -> Sequence[float] | None:
    return next((row for row in reversed(rows) if whole(row, valid)), None)
