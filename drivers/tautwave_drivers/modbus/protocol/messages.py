"""Exception and function codes as text.

Source: MODBUS Application Protocol Specification V1.1b3, 7 (exception codes).
"""

from __future__ import annotations

from tautwave_drivers.causes import Cause

EXCEPTIONS = {
    1: "function code not supported",
    2: "no such register",
    3: "value or count not accepted",
    4: "device failure",
    5: "accepted, but takes longer",
    6: "device busy",
    7: "refused",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "no answer behind the gateway",
}

BEHIND_A_GATEWAY = (10, 11)
"""Exceptions of a gateway, not of the drive behind it."""

FUNCTIONS = {
    1: "read coils",
    2: "read discrete inputs",
    3: "read registers",
    4: "read input registers",
    5: "write coil",
    6: "write register",
    15: "write coils",
    16: "write registers",
    23: "read and write registers",
    43: "identify",
}


def of_unit(found: int, asked: int) -> Cause:
    """Return the cause of an answer with another unit."""
    return Cause(
        f"of unit {found} instead of {asked}",
        f"set unit: {found} if that is the drive, or have the server answer as the unit it was "
        "asked for",
    )


def of_function(found: int, asked: int) -> Cause:
    """Return the cause of an answer to another function."""
    return Cause(
        f"to function code {found} instead of {asked}",
        "is another master on the line, or does the drive not know that function (function_codes)?",
    )


OF_TRANSACTION = Cause(
    "with another transaction id",
    "the server has to return the id it was sent; a serial server that only passes bytes on wants "
    "link: rtu",
)
TOO_LATE = Cause(
    "to requests that were given up before",
    "raise turnaround_s, or late_s and the bus' divisor, or look for what delays them",
)
OF_CRC = Cause("with a wrong CRC", "check baud, parity, stop_bits, termination and shielding")
OF_LENGTH = Cause("of another length or address than asked for", "is another master on the line?")
CUT_SHORT = Cause(
    "shorter than their Modbus TCP header says",
    "does the server count the unit and all that follows it as the length (MBAP)? Else its answers "
    "break off on the way",
)
NO_TCP = Cause("no Modbus TCP frames", "a serial server that only passes bytes on wants link: rtu")
NO_RTU = Cause(
    "no RTU frames", "check baud, parity and stop_bits; a Modbus TCP server wants link: tcp"
)


def of_exception(code: int) -> Cause:
    """Return the cause of a gateway's exception."""
    return Cause(
        exception_text(code),
        "check the gateway's serial side: baud, parity, wiring, and the drive's unit id",
    )


def exception_text(code: int) -> str:
    """Return an exception code as text."""
    return f"{EXCEPTIONS.get(code, 'unknown exception')} (exception {code:02X})"


def function_text(code: int) -> str:
    """Return a function code as text."""
    return f"{FUNCTIONS.get(code, 'function')} (FC {code})"
