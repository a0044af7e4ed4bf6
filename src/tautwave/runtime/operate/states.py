"""States of an operated rig and the transitions between them, as a table."""

from __future__ import annotations

from typing import NamedTuple

IDLE = "idle"
ALIGNING = "aligning"
ENGAGED = "engaged"
CLUTCHED = "clutched"
HOLDING = "holding"
STOPPING = "stopping"
STATES = (IDLE, ALIGNING, ENGAGED, CLUTCHED, HOLDING, STOPPING)

ENGAGE = "engage"
CLUTCH = "clutch"
HOLD = "hold"
REST = "rest"
STOP = "stop"
SCALE = "scale"
COMMANDS = (ENGAGE, CLUTCH, HOLD, REST, STOP, SCALE)
"""What a person asks for."""

BUTTONS = tuple(word for word in COMMANDS if word != SCALE)
"""Those that need no argument."""

ALIGNED = "aligned"
BLOCKED = "blocked"
FAULT = "fault"
RELEASED = "released"
PARTED = "parted"
LOST = "lost"
EVENTS = (ALIGNED, BLOCKED, FAULT, RELEASED, PARTED, LOST)
"""What the controller finds.

parted: the pairs cannot take another scale while they hold; lost: a session with the other site is
over.
"""

TRANSITIONS: dict[tuple[str, str], str] = {
    (IDLE, ENGAGE): ALIGNING,
    (IDLE, HOLD): HOLDING,
    (ALIGNING, ALIGNED): ENGAGED,
    (ALIGNING, BLOCKED): HOLDING,
    (ALIGNING, HOLD): HOLDING,
    (ALIGNING, REST): IDLE,
    (ALIGNING, RELEASED): HOLDING,
    (ALIGNING, LOST): HOLDING,
    (ENGAGED, CLUTCH): CLUTCHED,
    (ENGAGED, HOLD): HOLDING,
    (ENGAGED, RELEASED): HOLDING,
    (ENGAGED, LOST): HOLDING,
    (CLUTCHED, ENGAGE): ALIGNING,
    (CLUTCHED, HOLD): HOLDING,
    (CLUTCHED, REST): IDLE,
    (HOLDING, ENGAGE): ALIGNING,
    (HOLDING, REST): IDLE,
    (ENGAGED, PARTED): ALIGNING,
    **{(state, SCALE): state for state in (IDLE, ENGAGED, CLUTCHED, HOLDING)},
    **{(state, STOP): STOPPING for state in STATES if state != STOPPING},
    **{(state, FAULT): HOLDING for state in STATES if state != STOPPING},
}
"""State and command or event, and the state that follows; what is not here is refused."""


AFTER_FAULT = "engage: not possible after a fault; see what failed, then give rest"
"""Why a rig does not engage in any state."""


class Standing(NamedTuple):
    """The state, and whether a fault has to be acknowledged (by `rest`) before engaging."""

    state: str = IDLE
    faulted: bool = False


def follow(now: Standing, word: str) -> Standing | None:
    """Return what follows a command or an event, None if it is refused here."""
    if word == ENGAGE and now.faulted:
        return None
    state = TRANSITIONS.get((now.state, word))
    if state is None:
        return None
    faulted = word == FAULT or (now.faulted and word != REST)
    return Standing(state, faulted)


def refusal(now: Standing, word: str) -> str:
    """Say why a command is refused, and what is possible."""
    if word == ENGAGE and now.faulted:
        return AFTER_FAULT
    possible = [command for command in COMMANDS if follow(now, command) is not None]
    return f"{word}: not possible while {now.state}; possible: {', '.join(possible) or 'nothing'}"
