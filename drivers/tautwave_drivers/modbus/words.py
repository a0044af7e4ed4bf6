"""Exceptions and lost links in words.

Source: MODBUS Application Protocol Specification V1.1b3, 7 (exception codes).
"""

from __future__ import annotations

EXCEPTIONS = {
    1: "it does not know this function code",
    2: "it has no such register",
    3: "it does not take this value or count",
    4: "it failed to carry it out",
    5: "it needs longer to carry it out",
    6: "it is busy",
    7: "it refuses",
    8: "its memory has a parity error",
    10: "the gateway has no way to it",
    11: "nothing answers behind the gateway",
}

FUNCTIONS = {
    3: "read registers",
    4: "read input registers",
    6: "write register",
    16: "write registers",
    23: "read and write registers",
    43: "identify",
}


def exception_words(code: int) -> str:
    """Return an exception code in words."""
    return f"{EXCEPTIONS.get(code, 'an exception no manual names')} (exception {code:02X})"


def function_words(code: int) -> str:
    """Return a function code in words."""
    return f"{FUNCTIONS.get(code, 'function')} (FC {code})"
