"""Exception and function codes as text.

Source: MODBUS Application Protocol Specification V1.1b3, 7 (exception codes).
"""

from __future__ import annotations

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

FUNCTIONS = {
    3: "read registers",
    4: "read input registers",
    6: "write register",
    16: "write registers",
    23: "read and write registers",
    43: "identify",
}


def exception_text(code: int) -> str:
    """Return an exception code as text."""
    return f"{EXCEPTIONS.get(code, 'unknown exception')} (exception {code:02X})"


def function_text(code: int) -> str:
    """Return a function code as text."""
    return f"{FUNCTIONS.get(code, 'function')} (FC {code})"
