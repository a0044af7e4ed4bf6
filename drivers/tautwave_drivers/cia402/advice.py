"""Sentences about a drive that hangs or falls: what it shows, what was sent, where to look."""

from __future__ import annotations

from tautwave_drivers.cia402.emergency import error_words
from tautwave_drivers.cia402.modes import mode_name
from tautwave_drivers.cia402.states import (
    REMOTE,
    VOLTAGE_ENABLED,
    State,
    command_words,
    decode,
    status_words,
)

_LOOK = {
    State.NOT_READY: "it is starting or testing itself: look at its logic supply and its display",
    State.SWITCH_ON_DISABLED: (
        "look at STO and the enable and quick stop inputs, and whether 6040h reaches the drive "
        "(RPDO mapped and valid, node operational, SYNC sent)"
    ),
    State.READY: "look at the power supply, its contactor and the charging of the DC link",
    State.SWITCHED_ON: (
        "look at STO, the brake, commutation, and the interpolation period 60C2h against SYNC"
    ),
    State.OPERATION_ENABLED: "look whether 6040h still reaches the drive",
    State.QUICK_STOP_ACTIVE: "look at the quick stop input and option 605Ah",
    State.FAULT_REACTION_ACTIVE: "look at fault reaction 605Eh: the axis may not come to rest",
    State.FAULT: "the cause is still there: see the error code's remedy in the drive's manual",
    State.UNKNOWN: "look whether 6041h is mapped where the master reads it",
}


def hang_text(
    name: str,
    statusword: int,
    sent: int,
    cycles: int,
    *,
    mode: int,
    display: int | None,
    error_code: int,
) -> str:
    """Return the sentence for a drive that stays in its state for `cycles` cycles."""
    state = decode(statusword)
    text = (
        f"{name} hangs in {status_words(statusword)} for {cycles} cycles, "
        f"last sent {command_words(sent)}"
    )
    if error_code:
        text += f", error {error_words(error_code)}"
    if state is State.SWITCHED_ON and display != mode:
        return (
            f"{text}: {mode_name(mode)} is asked for in 6060h, 6061h shows {mode_name(display)}; "
            "look whether 6502h has the mode, halt is off and 6060h is written"
        )
    if state not in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        if not statusword & REMOTE:
            text += "; it does not listen to the bus (remote, bit 9): look for local control"
        if state is not State.NOT_READY and not statusword & VOLTAGE_ENABLED:
            text += "; it has no power voltage (bit 4): look at the supply, fuses and STO"
    return f"{text}; {_LOOK[state]}"


def silence_text(name: str, sent: int, cycles: int) -> str:
    """Return the sentence for a drive whose statusword does not come."""
    return (
        f"{name}: no statusword for {cycles} cycles, last sent {command_words(sent)}; look at "
        "power, node id and bit rate, whether the TPDO with 6041h is valid, the node operational "
        "and SYNC sent"
    )


def fall_text(name: str, statusword: int, error_code: int) -> str:
    """Return the sentence for a drive that left OPERATION ENABLED by itself."""
    state = decode(statusword)
    text = f"{name} left OPERATION ENABLED by itself for {status_words(statusword)}"
    if error_code:
        text += f", error {error_words(error_code)}"
    if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        return text if error_code else f"{text}: a fault; its error code is in 603Fh"
    if state is State.NOT_READY:
        return f"{text}: it was reset or lost its logic supply"
    if state is State.QUICK_STOP_ACTIVE:
        return f"{text}: a quick stop of its own; look at its inputs and limit switches"
    if state is State.UNKNOWN:
        return f"{text}; {_LOOK[state]}"
    return f"{text}: its power stage was dropped; look at STO, enable input and power voltage"


def mode_lost_text(name: str, mode: int, display: int | None) -> str:
    """Return the sentence for a drive that left its mode while enabled."""
    return (
        f"{name} left {mode_name(mode)} for {mode_name(display)} while enabled; look for a second "
        "master, a reset, or 6060h mapped and sent as something else"
    )
