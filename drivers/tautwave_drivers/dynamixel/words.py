"""What servos report, in words: hardware errors, and why an instruction was refused.

Sources: ROBOTIS e-manual, "Shutdown(63)" of the X series (bits of the hardware error status, 70),
"DYNAMIXEL Protocol 2.0", "Error", and "DYNAMIXEL Protocol 1.0", "Error".
"""

from __future__ import annotations

from tautwave_drivers.dynamixel.packet import ALERT

HARDWARE = {
    0: "input voltage outside its limits",
    2: "overheated",
    3: "motor encoder failed",
    4: "electrical shock, or too little power",
    5: "overloaded for too long",
}
"""Bits of the hardware error status (70)."""

STATUS = {
    1: "it could not carry the instruction out",
    2: "it does not know the instruction",
    3: "the instruction arrived damaged",
    4: "the value is out of range",
    5: "the value is too short for its register",
    6: "the value is beyond a limit set in the servo",
    7: "the register cannot be written now, or not at all",
}
"""Error numbers of a protocol 2.0 status packet."""

FIRST = {
    0: "input voltage outside its limits",
    1: "goal outside the angle limits",
    2: "overheated",
    3: "instruction out of range",
    4: "instruction arrived damaged",
    5: "overloaded for too long",
    6: "instruction unknown",
}
"""Bits of a protocol 1.0 status packet's error byte."""


def hardware_words(status: int, shutdown: int | None = None) -> str:
    """Return a hardware error status in words; with `shutdown` (63), what the servo did.

    Bits that no manual names are told as numbers.
    """
    bits = [bit for bit in range(8) if status >> bit & 1]
    told = " and ".join(HARDWARE.get(bit, f"hardware error bit {bit}") for bit in bits)
    if not bits:
        return "no hardware error"
    if shutdown is None:
        return told
    if status & shutdown:
        return f"{told}; it has switched its torque off until it is rebooted"
    return f"{told}; its torque stays on (Shutdown(63) leaves this error out)"


def status_words(error: int) -> str:
    """Return the error byte of a protocol 2.0 status packet in words, without the alert bit."""
    number = error & ~ALERT
    return STATUS.get(number, f"error number {number}") if number else "no error"


def first_words(error: int) -> str:
    """Return the error byte of a protocol 1.0 status packet in words."""
    bits = [bit for bit in range(8) if error >> bit & 1]
    return " and ".join(FIRST.get(bit, f"error bit {bit}") for bit in bits) or "no error"
