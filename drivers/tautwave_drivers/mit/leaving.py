"""Switching motors off: whether one is off is judged by its own report, not by what was sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from tautwave.contracts import Clock, FramePort
from tautwave.errors import DriverError
from tautwave_drivers.mit import damiao
from tautwave_drivers.mit.axis import Axis

AGAIN_NS, PAUSE_NS = 500_000_000, 50_000_000
"""How long the second try may take, for all motors together, and the pause in between."""
ROUND_NS = 10_000_000
ROUNDS = 3
ERRORS = frozenset(damiao.STATES) - {damiao.DISABLED, damiao.ENABLED}
"""States in which the torque is off as well."""


def leave(port: FramePort, clock: Clock, axes: Sequence[Axis]) -> dict[str, str]:
    """Send torque zero and disable to all; return by axis who did not confirm it, and why."""
    unconfirmed: dict[str, str] = {axis.spec.name: "no answer to disable" for axis in axes}
    by_id = {axis.motor.feedback_id: axis for axis in axes}
    try:
        _drop(port, clock)
        for axis in axes:
            port.send(axis.motor.id, axis.command(0.0))
        for _ in range(ROUNDS):
            for axis in axes:
                if axis.spec.name in unconfirmed:
                    port.send(axis.motor.id, damiao.DISABLE)
            until = clock.now_ns() + ROUND_NS
            while unconfirmed and clock.now_ns() < until and clock.wait(port, until):
                frame = port.receive()
                axis_of = None if frame is None else by_id.get(frame[0])
                if frame is None or axis_of is None:
                    continue
                feedback = damiao.feedback(frame[1], axis_of.motor.id)
                if feedback is None:
                    continue
                if feedback.state == damiao.DISABLED or feedback.state in ERRORS:
                    unconfirmed.pop(axis_of.spec.name, None)
                elif axis_of.spec.name in unconfirmed:
                    unconfirmed[axis_of.spec.name] = (
                        f"it still says {damiao.state_text(feedback.state)} after disable"
                    )
            if not unconfirmed:
                break
    except DriverError as err:
        unconfirmed = dict.fromkeys(unconfirmed, str(err))
    return {
        axis.spec.name: f"{axis.label}: {unconfirmed[axis.spec.name]}"
        for axis in axes
        if axis.spec.name in unconfirmed
    }


def leave_again(
    clock: Clock,
    connect: Callable[[], FramePort],
    axes: Sequence[Axis],
    doubtful: Mapping[str, str],
) -> dict[str, str]:
    """Try again, on a port that `connect` opens anew where it is lost; return the rest."""
    left = dict(doubtful)
    until = clock.now_ns() + AGAIN_NS
    while True:
        asked = [axis for axis in axes if axis.spec.name in left]
        try:
            left = leave(connect(), clock, asked)
        except DriverError as err:
            left = dict.fromkeys(left, str(err))
        now = clock.now_ns()
        if not left or now + PAUSE_NS >= until:
            return left
        clock.sleep_until(now + PAUSE_NS)


def _drop(port: FramePort, clock: Clock) -> None:
    """Discard frames that were received before: they confirm nothing."""
    clock.wait(port, clock.now_ns())
    for _ in range(1000):
        if port.receive() is None:
            return
