"""Statusword and controlword of CiA 402: states, flags, commands and the 16 transitions.

Source: CiA 402-2 v3.0 (IEC 61800-7-201), objects 6040h and 6041h, and its state diagram.
"""

from __future__ import annotations

import enum
from typing import NamedTuple


class State(enum.Enum):
    """State of a drive; UNKNOWN is a statusword without a meaning in the standard."""

    NOT_READY = "NOT READY TO SWITCH ON"
    SWITCH_ON_DISABLED = "SWITCH ON DISABLED"
    READY = "READY TO SWITCH ON"
    SWITCHED_ON = "SWITCHED ON"
    OPERATION_ENABLED = "OPERATION ENABLED"
    QUICK_STOP_ACTIVE = "QUICK STOP ACTIVE"
    FAULT_REACTION_ACTIVE = "FAULT REACTION ACTIVE"
    FAULT = "FAULT"
    UNKNOWN = "no state of CiA 402"


STATUS_CODES = (
    (0x4F, 0x00, State.NOT_READY),
    (0x4F, 0x40, State.SWITCH_ON_DISABLED),
    (0x6F, 0x21, State.READY),
    (0x6F, 0x23, State.SWITCHED_ON),
    (0x6F, 0x27, State.OPERATION_ENABLED),
    (0x6F, 0x07, State.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, State.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, State.FAULT),
)
"""Mask, value, state: the state is the one whose value the masked statusword has."""

_STATE_BITS = 0x6F


def _state_of(word: int) -> State:
    for mask, value, state in STATUS_CODES:
        if word & mask == value:
            return state
    return State.UNKNOWN


_BY_BITS = tuple(_state_of(word) for word in range(_STATE_BITS + 1))


def decode(statusword: int) -> State:
    """Return the state in a statusword."""
    return _BY_BITS[statusword & _STATE_BITS]


TORQUE_STATES = frozenset(
    (State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, State.FAULT_REACTION_ACTIVE)
)
"""States in which the drive applies torque."""

VOLTAGE_ENABLED = 1 << 4
WARNING = 1 << 7
REMOTE = 1 << 9
TARGET_REACHED = 1 << 10
INTERNAL_LIMIT = 1 << 11
MODE_BIT_12 = 1 << 12
MODE_BIT_13 = 1 << 13

SHUTDOWN = 0x0006
SWITCH_ON = 0x0007
DISABLE_OPERATION = 0x0007
ENABLE_OPERATION = 0x000F
DISABLE_VOLTAGE = 0x0000
QUICK_STOP = 0x0002
FAULT_RESET = 0x0080
HALT = 1 << 8

_COMMANDS = (
    (0x80, 0x80, "fault reset"),
    (0x87, 0x06, "shutdown"),
    (0x8F, 0x07, "switch on"),
    (0x8F, 0x0F, "enable operation"),
    (0x82, 0x00, "disable voltage"),
    (0x86, 0x02, "quick stop"),
)


def command_text(controlword: int) -> str:
    """Return a controlword as text: `0x000F (enable operation)`."""
    for mask, value, words in _COMMANDS:
        if controlword & mask == value:
            halt = ", halt" if controlword & HALT else ""
            return f"0x{controlword:04X} ({words}{halt})"
    return f"0x{controlword:04X}"


def status_text(statusword: int) -> str:
    """Return a statusword as text: state, then the flags common to all modes."""
    flags = [
        "voltage on" if statusword & VOLTAGE_ENABLED else "no voltage",
        "remote" if statusword & REMOTE else "not remote",
    ]
    if statusword & WARNING:
        flags.append("warning")
    if statusword & TARGET_REACHED:
        flags.append("target reached")
    if statusword & INTERNAL_LIMIT:
        flags.append("internal limit active")
    return f"{decode(statusword).value} (0x{statusword:04X}: {', '.join(flags)})"


class Transition(NamedTuple):
    """One arrow of the state diagram; `command` is None where the drive takes it by itself."""

    number: int
    source: State | None
    target: State
    command: int | None


TRANSITIONS = (
    Transition(0, None, State.NOT_READY, None),
    Transition(1, State.NOT_READY, State.SWITCH_ON_DISABLED, None),
    Transition(2, State.SWITCH_ON_DISABLED, State.READY, SHUTDOWN),
    Transition(3, State.READY, State.SWITCHED_ON, SWITCH_ON),
    Transition(4, State.SWITCHED_ON, State.OPERATION_ENABLED, ENABLE_OPERATION),
    Transition(5, State.OPERATION_ENABLED, State.SWITCHED_ON, DISABLE_OPERATION),
    Transition(6, State.SWITCHED_ON, State.READY, SHUTDOWN),
    Transition(7, State.READY, State.SWITCH_ON_DISABLED, DISABLE_VOLTAGE),
    Transition(8, State.OPERATION_ENABLED, State.READY, SHUTDOWN),
    Transition(9, State.OPERATION_ENABLED, State.SWITCH_ON_DISABLED, DISABLE_VOLTAGE),
    Transition(10, State.SWITCHED_ON, State.SWITCH_ON_DISABLED, DISABLE_VOLTAGE),
    Transition(11, State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE, QUICK_STOP),
    Transition(12, State.QUICK_STOP_ACTIVE, State.SWITCH_ON_DISABLED, DISABLE_VOLTAGE),
    Transition(13, None, State.FAULT_REACTION_ACTIVE, None),
    Transition(14, State.FAULT_REACTION_ACTIVE, State.FAULT, None),
    Transition(15, State.FAULT, State.SWITCH_ON_DISABLED, FAULT_RESET),
    Transition(16, State.QUICK_STOP_ACTIVE, State.OPERATION_ENABLED, ENABLE_OPERATION),
)
"""Start (0) and the 16 transitions of CiA 402-2; `source` None: power-on (0), any state (13)."""
