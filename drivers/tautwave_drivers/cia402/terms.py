"""What a state machine is asked for, how long it waits, and the events it reports."""

from __future__ import annotations

import enum
from typing import NamedTuple


class Goal(enum.Enum):
    """What a machine works towards."""

    ENABLE = "enable"
    DISABLE = "disable"
    QUICK_STOP = "quick stop"


class DisableMethod(enum.Enum):
    """How to disable: at once (9), by shutdown (8, 7), or by disable operation (5, 6, 7)."""

    COAST = "disable voltage"
    SHUTDOWN = "shutdown"
    RAMP = "disable operation"


class Timeouts(NamedTuple):
    """How long things may take, in cycles of the caller."""

    transition: int = 2000
    not_ready: int = 10000
    mode: int = 2000
    stop: int = 5000
    fault_reset: int = 500
    silence: int = 500
    edge: int = 20
    total: int = 30000

    @classmethod
    def at_rate(cls, rate_hz: float) -> Timeouts:
        """Return the default times (defaults are those of 1 kHz) at another rate, >= 2 cycles."""
        return cls(*(max(2, round(cycles * rate_hz / 1000.0)) for cycles in cls()))


class Quirks(NamedTuple):
    """What is particular about one drive.

    `quick_stop_option` is 605Ah as read, None if unknown; `resume` allows transition 16 where that
    option lets the drive rest in QUICK STOP ACTIVE; `fault_resets` is how often a fault may be
    reset until the goal is reached (some drives need two), 0 for never; `mode_when_enabled`: 6061h
    shows the mode only in OPERATION ENABLED, and is confirmed there, with safe targets until then.
    """

    quick_stop_option: int | None = None
    resume: bool = False
    fault_resets: int = 3
    timeouts: Timeouts = Timeouts()
    mode_when_enabled: bool = False


class Event(NamedTuple):
    """Something that happened, as a sentence; `fatal` if the axis has left the state asked for."""

    text: str
    fatal: bool
