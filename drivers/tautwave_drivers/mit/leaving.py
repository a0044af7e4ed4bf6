"""Switching motors off: whether one is off is judged by its own report, not by what was sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from tautwave.contracts import Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.axis import Axis

ROUND_NS, ROUNDS = 10_000_000, 3
"""How long a report is awaited before disable is sent again, and how often it is sent."""
LATE_ROUND_NS, LATE_ROUNDS = 50_000_000, 10
"""The same of the second try: a busy bus answers disable long after it was sent."""
ERRORS = frozenset(damiao.STATES) - {damiao.DISABLED, damiao.ENABLED}
"""States in which the torque is off as well."""


def leave(port: FramePort, clock: Clock, axes: Sequence[Axis]) -> dict[str, str]:
    """Send torque zero and disable to all; return by axis who did not confirm it, and why."""
    left = {axis.spec.name: f"{axis.label}: no answer to disable" for axis in axes}
    try:
        _drop(port, clock)
        _until_off(port, clock, axes, left, ROUNDS, ROUND_NS)
    except DriverError as err:
        _say(axes, left, err)
    return left


def leave_again(
    clock: Clock,
    connect: Callable[[], FramePort],
    axes: Sequence[Axis],
    doubtful: Mapping[str, str],
) -> dict[str, str]:
    """Try again, on a port that `connect` opens anew where it is lost; return the rest.

    What has come since `leave` counts: it answers the disable that was sent there.
    """
    left = dict(doubtful)
    for _ in range(LATE_ROUNDS):
        began = clock.now_ns()
        try:
            _until_off(connect(), clock, axes, left, 1, LATE_ROUND_NS)
        except DriverError as err:
            _say(axes, left, err)
        if not left:
            break
        clock.sleep_until(began + LATE_ROUND_NS)
    return left


def _until_off(
    port: FramePort,
    clock: Clock,
    axes: Sequence[Axis],
    left: dict[str, str],
    rounds: int,
    round_ns: int,
) -> None:
    """Send torque zero, then disable in rounds to those left; take out who confirms it."""
    by_id = {axis.motor.feedback_id: axis for axis in axes}
    for axis in axes:
        if axis.spec.name in left:
            port.send(axis.motor.id, axis.command(0.0))
    for _ in range(rounds):
        for axis in axes:
            if axis.spec.name in left:
                port.send(axis.motor.id, damiao.DISABLE)
        until = clock.now_ns() + round_ns
        while left and clock.now_ns() < until and clock.wait(port, until):
            frame = port.receive()
            axis_of = None if frame is None else by_id.get(frame[0])
            if frame is None or axis_of is None or axis_of.spec.name not in left:
                continue
            feedback = damiao.feedback(frame[1], axis_of.motor.id)
            if feedback is None:
                continue
            if feedback.state == damiao.DISABLED or feedback.state in ERRORS:
                del left[axis_of.spec.name]
            else:  # or an answer to an older command
                said = damiao.state_text(feedback.state)
                left[axis_of.spec.name] = f"{axis_of.label}: it still says {said} after disable"
        if not left:
            break


def _say(axes: Sequence[Axis], left: dict[str, str], err: DriverError) -> None:
    left |= {axis.spec.name: f"{axis.label}: {err}" for axis in axes if axis.spec.name in left}


def _drop(port: FramePort, clock: Clock) -> None:
    """Discard frames that were received before: they confirm nothing."""
    clock.wait(port, clock.now_ns())
    for _ in range(1000):
        if port.receive() is None:
            return
