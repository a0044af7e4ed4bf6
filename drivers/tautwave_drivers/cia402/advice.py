"""Messages about a drive that is stuck or faulted: what it shows, what was sent, where to look."""

from __future__ import annotations

from tautwave_drivers.cia402.emergency import error_text
from tautwave_drivers.cia402.modes import mode_name
from tautwave_drivers.cia402.states import (
    REMOTE,
    VOLTAGE_ENABLED,
    State,
    command_text,
    decode,
    status_text,
)

_LOOK = {
    State.NOT_READY: "it is starting up or running a self-test: check its logic supply and display",
    State.SWITCH_ON_DISABLED: (
        "check STO and the enable and quick stop inputs, and that 6040h reaches the drive "
        "(RPDO mapped and valid, node operational, SYNC sent)"
    ),
    State.READY: "check the power supply, its contactor and the charging of the DC link",
    State.SWITCHED_ON: (
        "check STO, the brake (60FEh may hold it), commutation, and the interpolation period 60C2h "
        "against SYNC"
    ),
    State.OPERATION_ENABLED: "check that 6040h still reaches the drive",
    State.QUICK_STOP_ACTIVE: "check the quick stop input and option 605Ah",
    State.FAULT_REACTION_ACTIVE: "check fault reaction 605Eh: the axis may not come to rest",
    State.FAULT: "the cause persists: see the error code in the drive's manual",
    State.UNKNOWN: "check that 6041h is mapped where the master reads it",
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
    """Return the message for a drive that stays in its state for `cycles` cycles."""
    state = decode(statusword)
    text = (
        f"{name} is stuck in {status_text(statusword)} for {cycles} cycles, "
        f"last sent {command_text(sent)}"
    )
    if error_code:
        text += f", error {error_text(error_code)}"
    if state is State.SWITCHED_ON and display != mode:
        return (
            f"{text}: {mode_name(mode)} is requested in 6060h, but 6061h shows "
            f"{mode_name(display)}; check that 6502h has the mode, halt (bit 8) is off and 6060h "
            "is written; a drive that shows it only once enabled takes mode_display: when_enabled"
        )
    if state is State.OPERATION_ENABLED and display != mode:
        return (
            f"{text}: {mode_name(mode)} is requested in 6060h, but 6061h still shows "
            f"{mode_name(display)}; check that 6502h has the mode and that 6061h can be read"
        )
    if state not in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        if not statusword & REMOTE:
            text += "; it ignores the bus (remote, bit 9, is 0): check for local control"
        if state is not State.NOT_READY and not statusword & VOLTAGE_ENABLED:
            text += "; it has no main supply voltage (bit 4): check the supply, fuses and STO"
    return f"{text}; {_LOOK[state]}"


def silence_text(name: str, sent: int, cycles: int) -> str:
    """Return the message for a drive whose statusword does not come."""
    return (
        f"{name}: no statusword for {cycles} cycles, last sent {command_text(sent)}; check "
        "power, node id and bit rate, and that the TPDO with 6041h is valid, the node operational "
        "and SYNC sent"
    )


def fall_text(name: str, statusword: int, error_code: int) -> str:
    """Return the message for a drive that left OPERATION ENABLED on its own."""
    state = decode(statusword)
    text = f"{name} left OPERATION ENABLED on its own and is in {status_text(statusword)}"
    if error_code:
        text += f", error {error_text(error_code)}"
    if state in (State.FAULT, State.FAULT_REACTION_ACTIVE):
        return text if error_code else f"{text}: a fault; read its error code from 603Fh"
    if state is State.NOT_READY:
        return f"{text}: it was reset or lost its logic supply"
    if state is State.QUICK_STOP_ACTIVE:
        return f"{text}: a quick stop by the drive itself; check its inputs and limit switches"
    if state is State.UNKNOWN:
        return f"{text}; {_LOOK[state]}"
    return f"{text}: its power stage was switched off; check STO, enable input and power voltage"


def mode_lost_text(name: str, mode: int, display: int | None) -> str:
    """Return the message for a drive that left its mode while enabled."""
    return (
        f"{name} changed from {mode_name(mode)} to {mode_name(display)} while enabled; "
        "look for a second master, a reset, or 6060h mapped and sent as something else"
    )
