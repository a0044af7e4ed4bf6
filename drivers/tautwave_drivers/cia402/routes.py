"""The master's program: for each goal and each state of a drive, which transition is next.

`ROUTES` and `TRANSITIONS` together are the whole way from any state to any goal; `machine` only
adds time to it: confirmation of the mode, timeouts, repeats and fault resets.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from tautwave_drivers.cia402 import states as s
from tautwave_drivers.cia402.states import TRANSITIONS, State
from tautwave_drivers.cia402.terms import DisableMethod, Goal

Route: TypeAlias = Goal | DisableMethod
"""A goal; `Goal.DISABLE` has one route for each method."""


class Step(NamedTuple):
    """What to do about a drive in one state.

    Attributes
    ----------
    command : int
        Controlword to send.
    transition : int or None
        The transition that it asks for, None for waiting.
    timeouts : tuple of str
        Names of the `Timeouts` whose sum the state may last; empty for any time.
    pause : int or None
        A word sent in between, for drives that look at commands only when the word changes.
    reached : bool
        This state is the goal.
    """

    command: int = s.DISABLE_VOLTAGE
    transition: int | None = None
    timeouts: tuple[str, ...] = ()
    pause: int | None = None
    reached: bool = False


def _take(number: int, *timeouts: str, pause: int | None = None, reached: bool = False) -> Step:
    command = TRANSITIONS[number].command
    assert command is not None
    return Step(command, number, timeouts, pause, reached)


_ANY_TIME = Step()
_REACHED = Step(reached=True)

AWAIT_MODE = Step(s.SWITCH_ON, timeouts=("mode",))
"""SWITCHED ON before 6061h shows the mode asked for."""

ROUTES: dict[Route, dict[State, Step]] = {
    Goal.ENABLE: {
        State.NOT_READY: Step(timeouts=("not_ready",)),
        State.SWITCH_ON_DISABLED: _take(2, "transition", pause=s.DISABLE_VOLTAGE),
        State.READY: _take(3, "transition", pause=s.SHUTDOWN),
        State.SWITCHED_ON: _take(4, "transition", pause=s.SWITCH_ON),
        # found enabled, with an unknown target: disable it first
        State.OPERATION_ENABLED: _take(5, "transition", pause=s.SHUTDOWN),
        State.QUICK_STOP_ACTIVE: _take(12, "stop", "transition"),
        State.FAULT_REACTION_ACTIVE: Step(timeouts=("stop",)),
        State.FAULT: _take(15),
        State.UNKNOWN: Step(timeouts=("transition",)),
    },
    Goal.QUICK_STOP: {
        State.NOT_READY: _REACHED,
        State.SWITCH_ON_DISABLED: _REACHED,
        State.READY: _take(7, reached=True),
        State.SWITCHED_ON: _take(10, reached=True),
        State.OPERATION_ENABLED: _take(11, "transition"),
        State.QUICK_STOP_ACTIVE: Step(s.QUICK_STOP, reached=True),
        State.FAULT_REACTION_ACTIVE: _ANY_TIME,
        State.FAULT: _REACHED,
        State.UNKNOWN: _ANY_TIME,
    },
    DisableMethod.RAMP: {
        State.NOT_READY: _REACHED,
        State.SWITCH_ON_DISABLED: _REACHED,
        State.READY: _take(7, "transition", "stop"),
        State.SWITCHED_ON: _take(6, "transition", "stop"),
        State.OPERATION_ENABLED: _take(5, "transition", "stop"),
        State.QUICK_STOP_ACTIVE: _take(12, "transition", "stop"),
        State.FAULT_REACTION_ACTIVE: _ANY_TIME,
        State.FAULT: _REACHED,
        State.UNKNOWN: _ANY_TIME,
    },
    DisableMethod.COAST: {
        State.NOT_READY: _REACHED,
        State.SWITCH_ON_DISABLED: _REACHED,
        State.READY: _take(7, "transition"),
        State.SWITCHED_ON: _take(10, "transition"),
        State.OPERATION_ENABLED: _take(9, "transition"),
        State.QUICK_STOP_ACTIVE: _take(12, "transition"),
        State.FAULT_REACTION_ACTIVE: _ANY_TIME,
        State.FAULT: _REACHED,
        State.UNKNOWN: _ANY_TIME,
    },
}
ROUTES[DisableMethod.SHUTDOWN] = ROUTES[DisableMethod.RAMP] | {
    State.OPERATION_ENABLED: _take(8, "transition", "stop")
}
"""Route to state to step; every state has one."""
