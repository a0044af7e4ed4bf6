"""What servos report, as text: hardware errors, and why an instruction was rejected.

Sources: ROBOTIS e-manual, "Shutdown(63)" of the X series (bits of the hardware error status, 70),
"DYNAMIXEL Protocol 2.0", "Error", and "DYNAMIXEL Protocol 1.0", "Error".
"""

from __future__ import annotations

from collections.abc import Collection

from tautwave_drivers.causes import Cause
from tautwave_drivers.dynamixel.protocol import packet
from tautwave_drivers.dynamixel.protocol.packet import ALERT

HARDWARE = {
    0: "input voltage outside its limits",
    2: "overheated",
    3: "motor encoder failed",
    4: "electrical shock, or too little power",
    5: "overloaded for too long",
}
"""Bits of the hardware error status (70)."""

STATUS = {
    1: "instruction failed",
    2: "unknown instruction",
    3: "CRC error in the instruction",
    4: "the value is out of range",
    5: "the value is too short for its register",
    6: "the value exceeds a limit set in the servo",
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


def hardware_text(status: int, shutdown: int | None = None) -> str:
    """Return a hardware error status as text; with `shutdown` (63), what the servo did.

    Bits that are not in a manual appear as numbers.
    """
    bits = [bit for bit in range(8) if status >> bit & 1]
    errors = " and ".join(HARDWARE.get(bit, f"hardware error bit {bit}") for bit in bits)
    if not bits:
        return "no hardware error"
    if shutdown is None:
        return errors
    if status & shutdown:
        return f"{errors}; its torque is off until it is rebooted"
    return f"{errors}; its torque stays on (Shutdown(63) does not include this error)"


def status_text(error: int) -> str:
    """Return the error byte of a protocol 2.0 status packet as text, without the alert bit."""
    number = error & ~ALERT
    return STATUS.get(number, f"error number {number}") if number else "no error"


def protocol1_text(error: int) -> str:
    """Return the error byte of a protocol 1.0 status packet as text."""
    bits = [bit for bit in range(8) if error >> bit & 1]
    return " and ".join(FIRST.get(bit, f"error bit {bit}") for bit in bits) or "no error"


BAD_CRC = Cause(
    "with a wrong checksum", "check cable, plugs, supply and baud rate, and for a second master"
)
OF_LENGTH = Cause("of another length", "is another program on the line?")
TWICE = Cause("from two servos with one id", "give one of them another id")
OF_OTHERS = Cause("of servos that were not asked", "give each servo its own id")
NO_PACKETS = Cause(
    "no packets of protocol 2.0", "check baud; servos of other makers speak another protocol"
)


def cause_of(heard: bytes | bytearray, device_id: int, asked: Collection[int]) -> Cause | None:
    """Return why what came in a cycle has no sample of a servo that was asked; None: silence."""
    at = heard.find(packet.HEADER)
    if at < 0:
        return NO_PACKETS if heard else None
    seen: set[int] = set()
    strange: Cause | None = None
    while at >= 0:
        buffer = bytearray(heard[at:])
        whole = len(buffer) >= 7 and len(buffer) >= 7 + int.from_bytes(buffer[5:7], "little")
        who = buffer[4] if len(buffer) > 4 else -1
        one = packet.take_packet(buffer) if whole else None
        if one is None or one.device_id != who:
            if who == device_id:
                return BAD_CRC if whole else OF_LENGTH
        elif one.instruction == packet.STATUS and who == device_id:
            if who in seen:
                return TWICE
            strange = OF_LENGTH
        elif one.instruction == packet.STATUS and who not in asked and who != packet.BROADCAST:
            strange = Cause(f"of servo {who}, which was not asked", "give each servo its own id")
        seen.add(who)
        at = heard.find(packet.HEADER, at + 1)
    return strange
