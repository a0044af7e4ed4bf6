"""Unit words 60A8h and 60A9h: prefix and unit by the codes of CiA 303-2, as factors to SI."""

from __future__ import annotations

import math

_UNITS = {  # of a rotary or linear position
    0x01: ("m", 1.0),
    0x10: ("rad", 1.0),
    0x40: ("gon", math.tau / 400.0),
    0x41: ("deg", math.tau / 360.0),
    0x42: ("arcmin", math.tau / 21600.0),
    0x43: ("arcsec", math.tau / 1296000.0),
    0xB4: ("rev", math.tau),
    0xC1: ("in", 0.0254),
    0xC2: ("ft", 0.3048),
}
_LENGTHS = (0x01, 0xC1, 0xC2)
_INCREMENTS = (0x00, 0xB5)
"""Codes of a drive that counts its encoder's increments: no dimension, or a step."""
_TIMES = {0x00: ("s", 1.0), 0x03: ("s", 1.0), 0x47: ("min", 60.0), 0x48: ("h", 3600.0)}


def _prefix(word: int) -> float:
    """Return the power of ten in the highest byte (signed)."""
    exponent = word >> 24 & 0xFF
    return float(10.0 ** (exponent - 0x100 if exponent >= 0x80 else exponent))


def unit_word(notation: int, dimension: int) -> int:
    """Return notation and dimension index (6089h and 608Ah, 608Bh and 608Ch) as a unit word.

    Source: CiA 402, edition 2: dimensions by the codes that CiA 303-2 has too; A4h is rev/min, ACh
    a step.
    """
    unit = {0xA4: 0x00B44700, 0xAC: 0x00B50000}.get(dimension, dimension << 16)
    return (notation & 0xFF) << 24 | unit


def position_unit(word: int) -> float | None:
    """Return the SI value [rad or m] of one count by 60A8h; None for increments or what is unknown.

    Source: CiA 402-2 60A8h, codes CiA 303-2; Nanotec "User-defined units" lists the same codes.
    """
    unit = _UNITS.get(word >> 16 & 0xFF)
    return None if unit is None else unit[1] * _prefix(word)


def velocity_unit(word: int) -> float | None:
    """Return the SI value [rad/s or m/s] of one count by 60A9h; None as for `position_unit`.

    The second byte is the time that divides (47h: minute). It is the speed at the place the drive
    means, motor or gear output; that is for its manual to say.
    """
    unit = _UNITS.get(word >> 16 & 0xFF)
    time = _TIMES.get(word >> 8 & 0xFF)
    if unit is None or time is None:
        return None
    return unit[1] * _prefix(word) / time[1]


def is_increments(word: int) -> bool:
    """Return whether the unit of 60A8h or 60A9h is one increment (per second), or not stated."""
    unit, time = word >> 16 & 0xFF, word >> 8 & 0xFF
    return unit in _INCREMENTS and not word >> 24 and time in (0x00, 0x03)


def is_length(word: int) -> bool:
    """Return whether the unit of 60A8h or 60A9h is a length, of the axis itself; else an angle."""
    return word >> 16 & 0xFF in _LENGTHS


def unit_text(word: int) -> str:
    """Return a unit as text: `10**-3 rev/min`."""
    exponent = word >> 24 & 0xFF
    power = exponent - 0x100 if exponent >= 0x80 else exponent
    code = word >> 16 & 0xFF
    unknown = "increments" if code in _INCREMENTS else f"unit {code:02X}h of CiA 303-2"
    unit = _UNITS.get(code, (unknown,))[0]
    time = _TIMES.get(word >> 8 & 0xFF, ("?",))[0] if word >> 8 & 0xFF else ""
    scale = f"10**{power} " if power else ""
    return f"{scale}{unit}/{time}" if time else f"{scale}{unit}"
